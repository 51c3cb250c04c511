"""Work with recordings: list, show, check, label, recover, migrate, export, import, prune."""
