"""A rod scene: the rope, the finger and the table that a rod simulation is made for, and its numerical constants."""

from dataclasses import dataclass
from math import pi
from typing import NamedTuple, final

import numpy as np
from jaxtyping import Float32, Float64

from app.core.bounds import check_range

_SPACING_M = 0.010
_FEWEST, _MOST = 11, 129
"""Nodes: a GPU's blocks have room for so many."""
_TIGHTEST = 1.25
_STEP_S = 1e-3
_STIFFEST = 4
"""Default of the largest rigidity, as a multiple of the nominal one."""
_MOST_VISCOUS = 1.3
"""Largest viscosity, as a multiple of the nominal one."""
_FARTHEST_M = 100.0
_YOUNG_PA, _VISCOSITY_PA_S = 1.865e4, 311.0
"""Bending modulus and viscosity: 6e-5 N m^2 and 1e-6 N m^2 s for a rope of 8 mm radius."""


@final
@dataclass(frozen=True, kw_only=True)
class Wall:
    """A fixed block on the table, from corner to corner (x, y) [m], higher than the rope."""

    low_m: tuple[float, float]
    high_m: tuple[float, float]
    friction: float = 0.3

    def __post_init__(self) -> None:
        """Raises ParameterError for a number that cannot be."""
        for axis in (0, 1):
            check_range("Wall low_m", self.low_m[axis], -_FARTHEST_M, _FARTHEST_M)
            check_range("Wall high_m", self.high_m[axis], self.low_m[axis], _FARTHEST_M)
        check_range("Wall friction", self.friction, 0.0, 5.0)

    @classmethod
    def with_gap(cls, x_m: float, gap_m: float, half_length_m: float, thickness_m: float) -> tuple["Wall", "Wall"]:
        """A wall along y about (x, 0) with an opening in its middle, as `tools.box.WallsWithGap`."""
        sides = (x_m - thickness_m / 2, x_m + thickness_m / 2)
        return (
            cls(low_m=(sides[0], -half_length_m), high_m=(sides[1], -gap_m / 2)),
            cls(low_m=(sides[0], gap_m / 2), high_m=(sides[1], half_length_m)),
        )


@final
@dataclass(frozen=True, kw_only=True)
class RodScene:
    """A rope on the table z = 0 and a finger with a round tip, in SI units without any scaling.

    Seen from above, the finger is all that is within its radius of a core, a line of twice `finger_half_width_m` about
    its middle, at `finger_yaw_rad` from the x axis. `spacing_m`: the distance of neighbouring nodes, about. Raises
    ParameterError for a number that cannot be.
    """

    length_m: float
    radius_m: float
    mass_kg: float
    finger_radius_m: float
    finger_half_width_m: float = 0.0
    """0 is round."""
    finger_yaw_rad: float = 0.0
    gravity_m_s2: float = 9.81
    spacing_m: float = _SPACING_M
    dt_s: float = 1e-3
    tightest_m: float | None = None
    """Radius of the tightest bend of the centreline; None: five quarters of the rope's, whose inner side has to fit."""
    walls: tuple[Wall, ...] = ()
    """Walls on the table; at least as thick as the distance of nodes, or the rope would pass between them."""
    mass_shares: tuple[float, ...] | None = None
    """Mass shares of the nodes, of a rope that is not uniform: it may have knots or tassels at its ends."""
    stiffest_n_m2: float | None = None
    """The largest bending rigidity that is simulated; None: four times the nominal one."""

    def __post_init__(self) -> None:
        """Raises ParameterError for a number that cannot be."""
        check_range("length_m", self.length_m, 0.02, 10.0)
        check_range("radius_m", self.radius_m, 5e-4, 0.05)
        check_range("mass_kg", self.mass_kg, 1e-4, 10.0)
        check_range("finger_radius_m", self.finger_radius_m, 1e-3, 0.05)
        check_range("finger_half_width_m", self.finger_half_width_m, 0.0, 0.05)
        check_range("finger_yaw_rad", self.finger_yaw_rad, -2 * pi, 2 * pi)
        check_range("gravity_m_s2", self.gravity_m_s2, 0.0, 100.0)
        check_range("spacing_m", self.spacing_m, 1e-3, 0.1)
        check_range("dt_s", self.dt_s, 1e-6, 2e-3)
        check_range("nodes, of length_m and spacing_m,", float(self.nodes), float(_FEWEST), float(_MOST))
        for wall in self.walls:
            for low, high in zip(wall.low_m, wall.high_m, strict=True):
                check_range("sides of a wall, of low_m and high_m,", high - low, self.rest_m, 2 * _FARTHEST_M)
        if self.stiffest_n_m2 is not None:
            check_range("stiffest_n_m2", self.stiffest_n_m2, 1e-9, 1.0)
        if self.mass_shares is not None:
            check_range("number of mass_shares", float(len(self.mass_shares)), float(self.nodes), float(self.nodes))
            check_range("least of mass_shares", min(self.mass_shares), 0.1 / self.nodes, 1.0)
            check_range("sum of mass_shares", sum(self.mass_shares), 0.999, 1.001)

    @property
    def nodes(self) -> int:
        """Number of nodes along the rope, odd, so that one is in its middle."""
        return max(_FEWEST, 2 * round(self.length_m / self.spacing_m / 2) + 1)

    @property
    def rest_m(self) -> float:
        """Rest length of a segment [m]."""
        return self.length_m / (self.nodes - 1)

    @property
    def node_mass_kg(self) -> float:
        """Mass of an inner node; those at the ends have half of it."""
        return self.mass_kg / (self.nodes - 1)

    def masses(self) -> Float64[np.ndarray, " N"]:
        """Masses of the nodes [kg]."""
        if self.mass_shares is not None:
            return self.mass_kg * np.array(self.mass_shares)
        masses = np.full(self.nodes, self.node_mass_kg)
        masses[[0, -1]] /= 2
        return masses

    @property
    def max_rigidity_n_m2(self) -> float:
        """The largest bending rigidity that its time steps bear [N m^2]."""
        return self.stiffest_n_m2 or _STIFFEST * self.nominal_physics()["rigidity"]

    @property
    def max_viscosity_n_m2_s(self) -> float:
        """The largest viscosity in bending that its time steps bear [N m^2 s]."""
        return _MOST_VISCOUS * self.nominal_physics()["viscosity"]

    @property
    def second_moment_m4(self) -> float:
        """Second moment of area of the round cross section: I = pi r^4 / 4."""
        return pi * self.radius_m**4 / 4

    def nominal_physics(self) -> dict[str, float]:
        """Values of `RodPhysics` for a limp rope: 6e-5 N m^2 at 8 mm radius, and in proportion to r^4."""
        return {
            "rigidity": _YOUNG_PA * self.second_moment_m4,
            "table_friction": 0.5,
            "finger_friction": 0.3,
            "viscosity": _VISCOSITY_PA_S * self.second_moment_m4,
            "yield_curvature": 5.0,
            "permanent_set": 1.0,
            "rest_curvature": 0.0,
            "climb": 0.0,
            "press": 1.0,
            "margin": 0.0,
            "creep": 1e-4,
            "mass": self.mass_kg,
            "finger_half_width": self.finger_half_width_m,
            "finger_yaw": self.finger_yaw_rad,
        }


@final
class Numbers(NamedTuple):
    """Constants of a time step, in the order of `Numbers` in rod.h.

    Contact stiffnesses are as large as explicit steps of a millisecond bear, or of `dt` where that is longer: shares of
    m / dt^2. Shorter steps converge.
    """

    dt: float
    rest: float
    stretch: float
    stretch_damping: float
    table: float
    table_damping: float
    finger: float
    finger_damping: float
    onset: float
    own: float
    own_damping: float
    thickness: float
    gravity: float
    stop: float
    tightest: float
    node_mass: float
    centring: float


_PARALLEL = 0.1
"""A segment so near to a flat finger's direction [rad] meets it between its ends, as one of 10 mm does whose middle is
pressed half a millimetre into the penalty of contact."""

_STRETCH, _STRETCH_MARGIN = 2.5, 0.32
"""Stiffness of stretch, as a share of m / dt^2, at most: and as a share of the limit of stability."""


def numbers_of(scene: RodScene, smoothing: float) -> Numbers:
    """The constants of a scene whose bending is smoothed by beta = `smoothing` (see `smoother_of`).

    A chain of masses and springs s m / dt^2 is stable where s q < 4 for all squared differences q in 0..4; smoothing
    divides by 1 + beta q^2, which thin ropes, with little bending, have little of.
    """
    m, rest = scene.node_mass_kg, scene.rest_m
    step = max(scene.dt_s, _STEP_S)
    spring, damper = m / step**2, m / step
    roughest = min(4.0, max(smoothing, 1e-9) ** -0.5)
    limit = 4 * (step / scene.dt_s) ** 2 * (1 + smoothing * roughest**2) / roughest
    stretch = min(_STRETCH, _STRETCH_MARGIN * limit)
    return Numbers(
        dt=scene.dt_s,
        rest=rest,
        stretch=stretch * spring * rest,
        stretch_damping=0.0125 * damper,
        table=0.05 * spring,
        table_damping=0.15 * damper,
        finger=0.375 * spring,
        finger_damping=0.19 * damper,
        onset=5e-4,
        own=0.375 * spring,
        own_damping=0.19 * damper,
        thickness=2 * scene.radius_m,
        gravity=scene.gravity_m_s2,
        stop=0.2 * spring * rest**2,
        tightest=rest / (scene.tightest_m or _TIGHTEST * scene.radius_m),
        node_mass=m,
        centring=2 * _PARALLEL * (scene.finger_radius_m + scene.radius_m) / rest,
    )


def smoothing_of(scene: RodScene, stiffness_n_m: float, damping_n_m_s: float) -> float:
    """The number beta = (dt c + dt^2 K) / (rest^2 m) for bending stiffness K [N m] and damping c [N m s] of a joint."""
    dt = scene.dt_s
    return (dt * damping_n_m_s + dt**2 * stiffness_n_m) / (scene.rest_m**2 * scene.node_mass_kg)


def smoother_of(scene: RodScene, smoothing: float) -> Float64[np.ndarray, "N N"]:
    """The matrix A = I + beta D2^T D2 that takes the linear part of bending and its damping implicitly.

    D2 takes second differences. A^-1 times a change of velocity stabilises it, and changes no equilibrium.
    """
    second = np.diff(np.eye(scene.nodes), 2, axis=0)
    return np.eye(scene.nodes) + smoothing * second.T @ second


def factors_of(matrix: Float64[np.ndarray, "N N"]) -> Float32[np.ndarray, "3 N"]:
    """Factors of a symmetric matrix with two bands beside its diagonal: 1 / D, and the bands of L, of L D L^T."""
    n = len(matrix)
    lower = np.linalg.cholesky(matrix)
    diagonal = np.diag(lower)
    unit = lower / diagonal
    factors = np.zeros((3, n), np.float32)
    factors[0] = 1 / diagonal**2
    factors[1, 1:] = np.diag(unit, -1)
    factors[2, 2:] = np.diag(unit, -2)
    return factors
