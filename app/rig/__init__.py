"""Rigs, the sources of frames and the targets of motions: simulated, replayed or real."""
