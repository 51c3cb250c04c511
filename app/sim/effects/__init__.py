"""Physical effects beyond the nominal model, one file each; the folder is the list (see `app.sim.model.catalogue`)."""
