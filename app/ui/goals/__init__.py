"""Setting a goal in the browser: the draft, and the widgets that draw it."""

from app.ui.goals.tab import GoalTab

__all__ = ["GoalTab"]
