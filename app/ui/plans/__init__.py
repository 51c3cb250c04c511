"""The tab Plans: every branch of a plan, moments of two of them in the scene, and a motion edited by its ends."""

from app.ui.plans.tab import Plans

__all__ = ["Plans"]
