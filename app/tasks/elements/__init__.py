"""Elements that tasks are made of: aims, layouts, sizes, and what a task has to define."""
