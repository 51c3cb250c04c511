"""Recordings as discovery takes them: pushes, the subject with its causes, and labels of its particles."""
