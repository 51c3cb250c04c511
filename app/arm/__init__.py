"""An arm in a process of its own: what it is told and says, what it refuses, and what it does when nobody speaks."""
