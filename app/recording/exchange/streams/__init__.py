"""Streams of measured data in files of other programs: their list, their mapping, and what the mapping selects."""
