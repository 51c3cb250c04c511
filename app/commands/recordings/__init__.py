"""List, show, check, label, recover, export or delete recordings."""
