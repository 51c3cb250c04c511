"""Launches, rollouts and their gradients, memory and devices, and the checks of what goes in."""
