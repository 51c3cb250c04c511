"""Faults on purpose, and how soon the arm is at rest after each: `python -m bench.faults`."""
