"""Calibrating a camera from the console, step by step."""

from app.ui.placing.tab import PlacingTab

__all__ = ["PlacingTab"]
