"""MuJoCo, whose compiled module declares no types: named `Any` once, here."""

import logging
from typing import Any, Final, Protocol

import mujoco as _mujoco

from app.core.errors import SimulationError

mujoco: Any = _mujoco
TOOL: Final = "tool"
"""Name of the tool's body in every world."""
_BAD = mujoco.mjtWarning
_UNSTABLE: Final = [int(kind) for kind in (_BAD.mjWARN_BADQPOS, _BAD.mjWARN_BADQVEL, _BAD.mjWARN_BADQACC)]
"""Warnings after which MuJoCo has put a world back to its first state, and its clock to zero."""
mujoco.set_mju_user_warning(logging.getLogger(__name__).warning)  # Else they go to a file in the working directory.


class Stepped(Protocol):
    """Step parameters common to the physics of all MuJoCo worlds; see `physics.WorldPhysics`."""

    @property
    def time_step_s(self) -> float: ...  # noqa: D102 - named for what it is
    @property
    def gravity_m_s2(self) -> float: ...  # noqa: D102
    @property
    def friction_stiffness(self) -> float: ...  # noqa: D102


def new_spec(physics: Stepped) -> Any:
    """An empty model: angles in radians, elliptic friction cones, discrete integration."""
    spec = mujoco.MjSpec()
    spec.compiler.degree = False
    spec.option.timestep = physics.time_step_s
    spec.option.gravity = [0.0, 0.0, -physics.gravity_m_s2]
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_DISCRETE
    spec.option.cone = mujoco.mjtCone.mjCONE_ELLIPTIC
    spec.option.impratio = physics.friction_stiffness
    return spec


def advance(model: Any, data: Any) -> None:
    """Make one time step of a world.

    Raises SimulationError where it does not stay finite: MuJoCo alone would go on from the first state, unseen.
    """
    time_s = data.time
    mujoco.mj_step(model, data)
    if data.warning.number[_UNSTABLE].any():
        raise SimulationError(
            f"MuJoCo's world became unstable after {time_s:.1f} s: what is hidden in it may be too strong, or its time "
            "step too long. Hide less of it, or take another seed."
        )
