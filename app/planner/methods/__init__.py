"""The planners that are compared, one file each, named as the planner; see `app.planner.method`.

Each defines `planner(search, descent, gradient_steps)`, sized by what the paper's tree simulates for a decision.
"""
