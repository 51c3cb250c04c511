"""An arm in a process of its own: its commands and states, its refusals, and its behaviour without commands."""
