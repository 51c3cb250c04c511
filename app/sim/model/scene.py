"""Scene of a simulation, without parameters to be estimated: grid, time step, bodies, tools, smoothing."""

from dataclasses import dataclass, field
from typing import final

import numpy as np
from jaxtyping import Float32

from app.core.errors import ParameterError
from app.sim.materials.base import Law, Material
from app.sim.materials.elastic import Elastic
from app.sim.model.registry import known_materials
from app.sim.tools.base import Tool
from app.sim.tools.finger import FingerCollider

CFL = 0.7
"""Largest allowed `dt c / cell` for the elastic wave speed c. Measured on ropes with 25 % of random deformation that a
finger pushes: stable up to 0.9, not at 1.0; what is squeezed grows stiffer, hence the margin."""


@final
@dataclass(frozen=True, kw_only=True)
class Body:
    """One object, or all pieces of one kind: its particles share its volume evenly.

    `stiffness` is its own as a share of phi's. A rope of radius `bending_radius_m` may be drawn with particles out to
    another one, `radius_m`, as perception or the grid ask for: it then bends like the true one.
    """

    volume_m3: float
    density_kg_m3: float
    material: Material = field(default_factory=Elastic)
    stiffness: float = 1.0
    radius_m: float | None = None
    bending_radius_m: float | None = None

    def __post_init__(self) -> None:
        for name in ("volume_m3", "density_kg_m3", "stiffness", "radius_m", "bending_radius_m"):
            value = getattr(self, name)
            if value is not None and not (np.isfinite(value) and value > 0):
                raise ParameterError(f"Body {name} = {value:g} must be positive and finite.")
        if not isinstance(getattr(self.material, "law", None), Law):
            raise ParameterError.unknown("material", str(self.material), known_materials())

    @property
    def share(self) -> float:
        """Share of phi's stiffness at which E I is that of the true radius: I = pi r^4 / 4 of a round cross section."""
        if self.radius_m is None or self.bending_radius_m is None:
            return self.stiffness
        return self.stiffness * (self.bending_radius_m / self.radius_m) ** 4


@final
@dataclass(frozen=True, kw_only=True)
class Scene:
    """Bodies on a table (the plane z = 0), and what touches them.

    A path of the tools has the coordinates of `tools` in their order (see `tools.base.Motion`). Raises ParameterError
    where a number is not finite or the numbers do not fit together.
    """

    bodies: tuple[Body, ...]
    tools: tuple[Tool, ...] = (FingerCollider(radius_m=0.009),)
    low: tuple[float, float, float] = (0.15, -0.45, -0.025)
    """Lower corner of the grid [m]; a particle within half a cell of the grid's boundary makes its candidate NaN."""
    high: tuple[float, float, float] = (0.95, 0.45, 0.10)
    cell_m: float = 0.0125
    """Cell size: about twice the spacing of 300 particles in a rope of 0.4 m and 8 mm radius; finer ones tear ropes."""
    dt_s: float = 7e-4
    stiffest_pa: float = 1e5
    """The largest stiffness of phi that is simulated: `dt_s` has to bear it."""
    gravity_m_s2: float = 9.81
    contact_margin_m: float = 0.003
    """Particles are centres of matter: contact begins at this distance from a tool, half a particle spacing."""
    contact_width_m: float = 0.002
    """The sigmoid's width: a fifth of a cell, so that the gradient reaches the particles next to the tool."""
    contact_substeps: float = 2.0
    """Substeps in which a particle inside a tool is moved out: fewer are stiffer, 2 is the edge of stability."""
    escape_speed_m_s: float = 2.0
    """The fastest that happens: a finger may start in the middle of the object."""
    slip_speed_m_s: float = 1e-3
    """Below it friction fades in linearly: Coulomb's law itself has no derivative at rest."""
    damping_1_s: float = 0.5
    """Rate at which all motion decays: air, and dissipation that the nominal model does not resolve."""

    def __post_init__(self) -> None:
        for name, value in vars(self).items():
            if name not in ("bodies", "tools") and not np.all(np.isfinite(value)):
                raise ParameterError(f"Scene {name} = {value} is not finite.")
        if not self.bodies:
            raise ParameterError("A scene needs at least one body.")
        self._require_positive()
        self._require_grid()
        self._require_stable()

    @property
    def shape(self) -> tuple[int, int, int]:
        """Number of grid nodes along x, y and z."""
        nodes = np.rint((np.asarray(self.high) - np.asarray(self.low)) / self.cell_m).astype(int) + 1
        return int(nodes[0]), int(nodes[1]), int(nodes[2])

    @property
    def stable_dt_s(self) -> float:
        """The largest stable time step for the stiffest material that is simulated."""
        return min(
            CFL * self.cell_m / float(np.sqrt(self.stiffest_pa * body.share * (lam + 2 * mu) / body.density_kg_m3))
            for body in self.bodies
            for mu, lam in [body.material.lame()]
        )

    def split(self, particle_count: int) -> tuple[int, ...]:
        """Number of particles of each body, in proportion to its volume."""
        volumes = np.cumsum([body.volume_m3 for body in self.bodies])
        ends = np.rint(particle_count * volumes / volumes[-1]).astype(int)
        return tuple(int(count) for count in np.diff(ends, prepend=0))

    def clip_to_grid(self, x: Float32[np.ndarray, "N 3"]) -> Float32[np.ndarray, "N 3"]:
        """The particles [m]; those off the grid, or too near its boundary to be simulated, in the nearest cell."""
        low, high = np.asarray(self.low, np.float32), np.asarray(self.high, np.float32)
        return np.clip(x, low + np.float32(self.cell_m), high - np.float32(self.cell_m))

    def _require_positive(self) -> None:
        contact = ("contact_width_m", "contact_substeps", "escape_speed_m_s", "slip_speed_m_s")
        for name in ("cell_m", "dt_s", "stiffest_pa", *contact):
            if getattr(self, name) <= 0:
                raise ParameterError(f"Scene {name} = {getattr(self, name):g} must be positive.")
        for name in ("contact_margin_m", "damping_1_s"):
            if getattr(self, name) < 0:
                raise ParameterError(f"Scene {name} = {getattr(self, name):g} must not be negative.")

    def _require_grid(self) -> None:
        if min(self.shape) < 4:
            raise ParameterError(
                f"The grid from {self.low} to {self.high} has fewer than 4 nodes a side: {self.shape}."
            )
        layers = -self.low[2] / self.cell_m
        if layers < 1 or abs(layers - round(layers)) > 1e-3:
            raise ParameterError(
                f"The grid's lower end z = {self.low[2]:g} m must be a whole number of cells ({self.cell_m:g} m) below "
                "the table at z = 0."
            )

    def _require_stable(self) -> None:
        if self.dt_s > self.stable_dt_s:
            raise ParameterError(
                f"dt_s = {self.dt_s:g} s is above the stable limit {self.stable_dt_s:.3g} s for a stiffness of "
                f"{self.stiffest_pa:g} Pa on cells of {self.cell_m:g} m; shorten it."
            )
