"""What to do with recordings: list, show, check, label, recover, export, import, prune."""
