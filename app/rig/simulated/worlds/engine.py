"""MuJoCo, whose compiled module declares no types: named `Any` once, here."""

from typing import Any, Final, Protocol

import mujoco as _mujoco

mujoco: Any = _mujoco
TOOL: Final = "tool"
"""Name of the tool's body in every world."""


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
