"""The physical parameters of the simulated world, in one place, so that a world can differ in any of them."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from types import MappingProxyType
from typing import Final, final

from jaxtyping import Float64
from numpy import ndarray

from app.core.geometry.scene_description import Rope, RopeModel

HOME_TOOL_M = (0.30, 0.0, 0.30)
"""Position of the tool tip before its first motion: over the near edge of the table, out of the cameras' way."""


@final
@dataclass(frozen=True, kw_only=True)
class RopePhysics:
    """Bending of the rope: a chain of capsules joined by two hinges, each an elasto-plastic spring.

    Stiffness times segment length is the flexural rigidity EI: 0.006 N m/rad x 10 mm = 6e-5 N m^2, that of a limp
    16 mm rope (an elastic rod of that thickness would have E of about 19 kPa). Beyond `bend_yield_rad` a segment keeps
    its bend, as a laid rope does. Across the table plane the hinges are stiffer and elastic, because a soft chain that
    is squeezed under the finger otherwise locks into an arch that a rope's own skin would not allow.
    """

    segments: int = 40
    bend_stiffness_n_m_rad: float = 0.006
    bend_damping_n_m_s_rad: float = 1e-4
    bend_yield_rad: float = 0.05
    lift_stiffness_n_m_rad: float = 0.05
    lift_damping_n_m_s_rad: float = 5e-4
    bend_limit_rad: float = 1.0


@final
@dataclass(frozen=True, kw_only=True)
class CablePhysics:
    """Bending of a rope as a cable of mass points: elastic, about a straight line, like the limpest ropes.

    `rigidity_n_m2`: flexural rigidity EI, a quarter of the chain's. A cable keeps no bend: only the table's friction
    holds a curve, with a radius above about (EI / (friction x weight per length))^(1/3), here 27 mm. `bend_damping_s`:
    bending moment per rate of curvature, in EI; more of it, or of segments, takes more iterations. `stretch_time_s`:
    time constant in which segments return to their lengths.
    """

    segments: int = 32
    rigidity_n_m2: float = 1.5e-5
    bend_damping_s: float = 0.01
    stretch_time_s: float = 0.004


@final
@dataclass(frozen=True, kw_only=True)
class RollingPhysics:
    """Resistance of loose beans to rolling, and to spinning about the contact: MuJoCo's lengths [m].

    `rolling_m` is a tenth of a bean's radius: coefficients of rolling resistance reach 0.1 for angular grains (Ai et
    al. 2011, "Assessment of rolling resistance models in discrete element simulations"), and beans are not round.
    `spin_m`: two thirds of the friction coefficient times a contact patch of 4 mm across, as of two flattish sides.
    """

    rolling_m: float = 5e-4
    spin_m: float = 1e-3


@final
@dataclass(frozen=True, kw_only=True)
class ClothPhysics:
    """A light woven cloth: it hardly stretches, and bends freely.

    `membrane_n_m`: Young's modulus times thickness; a cloth of 12 g that hangs from a grip of 60 mm stretches by 2 %.
    `cloth_half_thickness_m`: of the contact layer; time step and mesh need more than a real cloth has. `air_drag_1_s`:
    decay rate of motion through the air. `hold_time_s`: time constant in which held nodes follow.
    """

    membrane_n_m: float = 100.0
    poisson: float = 0.2
    membrane_damping_s: float = 1e-3
    cloth_half_thickness_m: float = 0.002
    air_drag_1_s: float = 3.0
    hold_time_s: float = 0.010


@final
@dataclass(frozen=True, kw_only=True)
class WorldPhysics:
    """Friction, contact and time step. Coulomb coefficients: nylon rope on wood 0.4-0.6; on a smooth finger 0.3.

    `contact_time_s` is the time constant in which contacts push apart; at least twice the time step (MuJoCo's rule).
    `friction_stiffness` is MuJoCo's `impratio`: above 1 the rope at rest creeps less. `cable`: the rope's model, where
    it is not the chain of `rope`. `cloth`: of a cloth. `bulk_pa`: bulk modulus of a liquid, whose bowls' friction is
    `finger_friction` over that of a finger times their own.
    """

    rope: RopePhysics = field(default_factory=RopePhysics)
    cable: CablePhysics | None = None
    rolling: RollingPhysics = field(default_factory=RollingPhysics)
    cloth: ClothPhysics = field(default_factory=ClothPhysics)
    table_friction: float = 0.5
    finger_friction: float = 0.3
    gravity_m_s2: float = 9.81
    time_step_s: float = 0.002
    contact_time_s: float = 0.006
    friction_stiffness: float = 10.0
    finger_length_m: float = 0.12
    bulk_pa: float = 4e4

    @property
    def segments(self) -> int:
        """Number of the rope's segments."""
        return self.rope.segments if self.cable is None else self.cable.segments


ROPE_WORLDS: Final[Mapping[RopeModel, WorldPhysics]] = MappingProxyType(
    {"chain": WorldPhysics(), "cable": WorldPhysics(cable=CablePhysics(), contact_time_s=0.010)}
)
"""Nominal physics of the rope worlds: the same materials on the same table, with different mechanics."""
BEAN_WORLD: Final = WorldPhysics(table_friction=0.4)
"""Nominal physics of beans on a table."""
CLOTH_WORLD: Final = WorldPhysics(table_friction=0.5, finger_friction=0.8)
"""Nominal physics of a cloth in a gripper."""
LIQUID_WORLD: Final = WorldPhysics(table_friction=0.4)
"""Nominal physics of a liquid in bowls."""


_LENGTH_M, _RADIUS_M = 0.40, 0.008
"""Size of the rope to which the stiffness and yield of `ROPE_WORLDS` belong."""


def with_size(physics: WorldPhysics, rope: Rope) -> WorldPhysics:
    """The same material in a rope of another size: rigidity grows with the fourth power of the radius.

    The chain's segments grow with its length, and its hinges' angles with them: it yields at the same curvature. Across
    the table plane its hinges are unchanged.
    """
    stiffer, longer = (rope.radius_m / _RADIUS_M) ** 4, rope.length_m / _LENGTH_M
    chain, cable = physics.rope, physics.cable
    chain = replace(
        chain,
        bend_stiffness_n_m_rad=chain.bend_stiffness_n_m_rad * stiffer / longer,
        bend_damping_n_m_s_rad=chain.bend_damping_n_m_s_rad * stiffer / longer,
        bend_yield_rad=chain.bend_yield_rad * longer,
    )
    if cable is not None:
        cable = replace(cable, rigidity_n_m2=cable.rigidity_n_m2 * stiffer)
    return replace(physics, rope=chain, cable=cable)


Position = Float64[ndarray, "3"]
"""x y z [m] in the world frame."""
Centreline = Float64[ndarray, "K 3"]
"""Points [m] along the middle of the rope, end to end."""
