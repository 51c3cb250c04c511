"""Actions: their parameters, tracks and checks, by what a tool does: sweeps, carries, pours, passages."""
