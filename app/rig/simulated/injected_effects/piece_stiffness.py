"""Stiffness of pieces: those in a liquid are so many times as stiff as they usually are."""

from app.rig.simulated.injected_effects.base import SOUPS, Hidden, InjectedParameter, plain

HIDDEN = Hidden(
    family="physics",
    bodies=SOUPS,
    quantities=(InjectedParameter(name="piece_stiffness", unit="1", null=1.0, typical=0.4, low=0.1, high=2.5),),
    draw=plain,
)
