"""Requests of an operator besides modes and decisions: goals, models, demonstrations, calibrations."""
