"""A moment of the world as tests of hidden effects make it, and effects by their names."""

import numpy as np

from app.core.geometry.track import Track
from app.rig.simulated.effect_sampling import injectable_effects
from app.rig.simulated.injected_effects.base import Hidden, InjectedEffect, Moment
from app.rig.simulated.worlds.effect_injector import Intrusion
from app.rig.simulated.worlds.physics import WorldPhysics
from app.rig.simulated.worlds.rope_world import RopeWorld
from tests.rig.scene import FINGER, ROPE, straight_rope

SEGMENTS = 40


def effect(name: str) -> Hidden:
    return injectable_effects()[name]


def injected(name: str, *values: float) -> InjectedEffect:
    return InjectedEffect(name=name, effect=effect(name), values=np.array(values, float))


def world(*hidden: InjectedEffect, physics: WorldPhysics | None = None) -> RopeWorld:
    return RopeWorld(ROPE, FINGER, straight_rope(), physics=physics, intrusion=Intrusion(hidden))


def moment(**given: object) -> Moment:
    """A rope along y through x = 0.5 at rest, with the finger far above it; what is given stands instead."""
    x = np.column_stack([np.full(SEGMENTS, 0.5), np.linspace(-0.195, 0.195, SEGMENTS), np.full(SEGMENTS, 0.008)])
    still = Moment(
        time_s=0.0,
        session=0.0,
        period_s=0.002,
        gravity_m_s2=9.81,
        radius_m=0.008,
        length_m=0.01,
        x=x,
        v=np.zeros((SEGMENTS, 3)),
        mass=np.full(SEGMENTS, 0.002),
        tool=np.array([0.5, 0.0, 0.3]),
        tool_v=np.zeros(3),
        toward=np.tile([0.0, 0.0, 1.0], (SEGMENTS, 1)),
        gap_m=np.full(SEGMENTS, 0.2),
    )
    return still._replace(**given)


def moving(x_m_s: float, y_m_s: float) -> np.ndarray:
    """Every segment at that velocity."""
    return np.tile([x_m_s, y_m_s, 0.0], (SEGMENTS, 1))


def track(yaw: float = 0.0) -> Track:
    """Down, 10 cm along x in a second, a second's rest, 4 cm back, and up; the tool turned by `yaw`."""
    times = np.linspace(0.0, 4.0, 201)
    x = 0.5 + 0.1 * np.interp(times, [0.5, 1.5, 2.5, 3.0], [0.0, 1.0, 1.0, 0.6])
    z = np.interp(times, [0.0, 0.4, 3.6, 4.0], [0.1, 0.006, 0.006, 0.1])
    turn = np.tile([np.cos(yaw / 2), 0.0, 0.0, np.sin(yaw / 2)], (len(times), 1))
    return Track(times_s=times, poses=np.column_stack([x, np.zeros_like(x), z, turn]))
