"""One file a task, named as the task."""
