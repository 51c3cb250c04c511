"""What is doubted: the simulator of a task with its nominal model, and every cause that may be missing in it."""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Literal, TypeAlias, final

import numpy as np
from jaxtyping import Float32, Float64

from app.discovery import apparatus as apparatus_files
from app.discovery.apparatus.base import Apparatus, Values
from app.sim import effects
from app.sim.effects.base import Effect
from app.sim.files import files_of
from app.sim.parameter import ParameterSpec
from app.sim.params import PARAMETERS, index, with_stiffness_up_to
from app.sim.scene import Scene

Theta: TypeAlias = Float64[np.ndarray, " P"]
"""Values of all parameters of a `Catalogue`, in its order."""
Family: TypeAlias = Literal["sensing", "actuation", "physics", "numerics"]

NUMERICS = {
    "resolution": "Share of the way to a grid and time step finer by a fifth.",
    "contact_softness": "Share of the way to contacts half as wide again.",
    "contact_distance": "Share of the way to contacts that begin 1.5 mm earlier.",
}
"""Our own discretisation as pseudo-effects: what it explains is not taken for physics."""
_EARLIER_M = 1.5e-3


@final
@dataclass(frozen=True, kw_only=True)
class Subject:
    """A task's simulator as discovery uses it.

    `haste`: real seconds in one simulated second; `mass_kg`, `length_m`, `radius_m`: the object's; `low_m`: below this
    height the tool can touch it; `nominal`: values of `PARAMETERS`, of which `calibrated` are fitted whatever the
    cause.
    """

    scene: Scene
    haste: float
    mass_kg: float
    length_m: float
    radius_m: float
    low_m: float
    particle_count: int
    nominal: Float32[np.ndarray, " P"]
    calibrated: tuple[str, ...]

    @property
    def heft(self) -> float:
        """The simulation's weight over the real one."""
        return self.scene.gravity_m_s2 / 9.81

    def numeric(self, name: str) -> Scene:
        """The scene with one of `NUMERICS` at 1."""
        scene = self.scene
        if name == "resolution":
            x, y, z = scene.low
            return replace(scene, cell_m=0.8 * scene.cell_m, dt_s=0.8 * scene.dt_s, low=(x, y, 0.8 * z))
        if name == "contact_distance":
            return replace(scene, contact_margin_m=scene.contact_margin_m + _EARLIER_M)
        return replace(scene, contact_width_m=1.5 * scene.contact_width_m)


@final
@dataclass(frozen=True, kw_only=True)
class Cause:
    """Something that may be wrong: an effect by its file's name, or a numeric one.

    `columns` are where its parameters stand in a catalogue's `specs`; the first `switches` of them make it vanish.
    `reach_m`: see `Effect`.
    """

    name: str
    family: Family
    about: str
    columns: tuple[int, ...]
    switches: int
    reach_m: float | None = None

    @property
    def placed(self) -> bool:
        """Whether the other parameters are a place on the table."""
        return len(self.columns) - self.switches == 2


@final
@dataclass(frozen=True, kw_only=True)
class Catalogue:
    """All causes and their parameters: the simulator's phi first, then the apparatus's, then numerics."""

    specs: tuple[ParameterSpec, ...]
    causes: tuple[Cause, ...]
    apparatus: tuple[tuple[Apparatus, int], ...]
    """Each with the column of its first parameter."""

    def column(self, name: str) -> int:
        """Where a parameter stands. KeyError where there is none of that name."""
        return [spec.name for spec in self.specs].index(name)

    def cause(self, name: str) -> Cause:
        """The cause called `name`."""
        return next(cause for cause in self.causes if cause.name == name)

    def wrong(self, theta: Theta) -> Iterator[tuple[Apparatus, Values]]:
        """The apparatus's effects that are not at their null, with their values."""
        for effect, first in self.apparatus:
            values = theta[first : first + len(effect.parameters)]
            if values.any():
                yield effect, values

    def nominal(self, subject: Subject) -> Theta:
        """The subject's model, with nothing wrong."""
        theta = np.array([spec.nominal for spec in self.specs])
        theta[: len(subject.nominal)] = subject.nominal
        return theta


def catalogue() -> Catalogue:
    """Every effect file of the simulator and of the apparatus, and numerics; all parameters, libraries' too."""
    specs, causes = list(with_stiffness_up_to(PARAMETERS, Scene.stiffest_pa)), list[Cause]()
    for name, module in files_of(effects):
        effect = module.EFFECT
        if not effect.catalogued:
            continue
        columns = tuple(index(spec.name) for spec in effect.parameters)
        causes.append(_cause(name, "physics", _about(module.__doc__ or ""), columns, effect))
    held = list[tuple[Apparatus, int]]()
    for name, module in files_of(apparatus_files):
        effect = module.EFFECT
        first = len(specs)
        specs += effect.parameters
        held.append((effect, first))
        columns = tuple(range(first, len(specs)))
        causes.append(_cause(name, effect.family, _about(module.__doc__ or ""), columns, None))
    for name, about in NUMERICS.items():
        specs.append(_numeric(name, about))
        causes.append(_cause(name, "numerics", about, (len(specs) - 1,), None))
    return Catalogue(specs=tuple(specs), causes=tuple(causes), apparatus=tuple(held))


def _cause(name: str, family: Family, about: str, columns: tuple[int, ...], effect: Effect | None) -> Cause:
    switches = effect.switches if effect is not None and effect.switches is not None else len(columns)
    reach_m = effect.reach_m if effect is not None else None
    return Cause(name=name, family=family, about=about, columns=columns, switches=switches, reach_m=reach_m)


def _about(doc: str) -> str:
    """The first sentence of a file's docstring."""
    return " ".join(doc.split("\n\n")[0].split()).split(". ")[0].rstrip(".") + "."


def _numeric(name: str, about: str) -> ParameterSpec:
    return ParameterSpec(name=name, unit="1", nominal=0.0, low=-2.0, high=2.0, typical=1.0, scale="linear", about=about)
