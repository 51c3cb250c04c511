"""Soup that is poured at random as water is, at more of a tilt."""

from app.policy.random_pours import SOUP_FURTHER_RAD
from app.rig.simulated.testbeds.pour_water import BowlPours

TESTBED = BowlPours(SOUP_FURTHER_RAD)
