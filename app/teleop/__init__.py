"""Moving the tool by hand: what a browser says is held, the rules of the dead-man, and what the arm is told."""

from app.teleop.pilot import Pilot

__all__ = ["Pilot"]
