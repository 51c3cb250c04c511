"""MCAP files: one an episode, crash-safe, in schemas that Foxglove shows as they are."""
