"""Writing of recordings: one file at a time, appended to, replaced and checked beforehand."""
