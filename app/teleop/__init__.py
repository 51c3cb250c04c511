"""Teleoperation by jogging: the browser's samples, the rules of the dead-man, and the commands to the arm."""

from app.teleop.pilot import Pilot

__all__ = ["Pilot"]
