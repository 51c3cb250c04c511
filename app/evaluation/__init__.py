"""Episodes of a task by a method, on the simulated cell in lock step, and their statistics."""
