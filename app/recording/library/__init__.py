"""A folder of recordings: its index, labels, clips, repair, renewal and removal."""
