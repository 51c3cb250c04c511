"""What touches objects: tools that follow a path and things that stand around, one shape a file."""
