"""Define an effect, a table that turns, and simulate one push of a rope without it and with it, side by side.

Start it with `python examples/05_effect.py --turn-rate 2.0`; as a file of `app/sim/effects` it is in all simulators.
"""

from math import pi
from typing import Any

import jax.numpy as jnp
import numpy as np
import tyro
import warp as wp

from app.core.types import Points
from app.sim.effects.base import MIDDLE_M, Effect, NodeContext, linear
from app.sim.model.params import parameters_with
from app.sim.model.scene import Body, Scene
from app.sim.runtime.rollout import make_rollout
from app.sim.state import State
from app.tasks.elements.curves import fill_tube

MIDDLE_X, MIDDLE_Y = wp.constant(MIDDLE_M[0]), wp.constant(MIDDLE_M[1])


@wp.func
def turned_velocity(v: wp.vec3, node: NodeContext, phi: Any, at: int) -> wp.vec3:
    """The velocity after one substep on a table that turns at w = phi[at]: a = 2 w (v_y, -v_x) + w^2 (x, y).

    In the table's frame (Coriolis 1835, "Sur les équations du mouvement relatif des systèmes de corps").
    """
    w, x, y = phi[at], node.x[0] - MIDDLE_X, node.x[1] - MIDDLE_Y
    return v + node.dt * wp.vec3(2.0 * w * v[1] + w * w * x, w * w * y - 2.0 * w * v[0], 0.0)


EFFECT = Effect(
    parameters=(linear("turn_rate", "rad/s", (-5.0, 1.0, 5.0), "Rate at which the table turns about its middle."),),
    node_velocity=turned_velocity,
)
SCENE = Scene(bodies=(Body(volume_m3=pi * 0.008**2 * 0.3, density_kg_m3=800.0),), dt_s=4e-4)
PARTICLES, STEPS, SPEED_M_S = 200, 1000, 0.25


def main(turn_rate: float = 2.0) -> Points:
    """Both ropes [m] after a push across their middle, (2, N, 3): on a table at rest, and on one that turns."""
    line = np.linspace([0.40, 0.0, 0.008], [0.70, 0.0, 0.008], 31)
    ropes = State.at_rest(jnp.stack(2 * [fill_tube(line, 0.008, PARTICLES)]))
    tip = np.linspace([0.55, -0.03, 0.006], [0.55, SPEED_M_S * STEPS * SCENE.dt_s - 0.03, 0.006], STEPS + 1)
    phi = np.array(2 * [[spec.nominal for spec in parameters_with((EFFECT,))]])
    phi[1, -1] = turn_rate
    simulate = make_rollout(SCENE, particle_count=PARTICLES, effects=(EFFECT,))
    after = np.asarray(simulate(jnp.asarray(phi), ropes, jnp.stack(2 * [tip])).x)
    x, y, _ = 1e3 * (after[1] - after[0]).mean(0)
    print(f"where the table turns at {turn_rate:g} rad/s, the rope ends {x:+.1f} mm along x, {y:+.1f} mm along y away")
    return after


if __name__ == "__main__":
    tyro.cli(main)
