"""The reference problem of pouring water: its facts, and how its actions are searched."""
