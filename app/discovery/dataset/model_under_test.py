"""The model under test, and the catalogue of candidate causes of its error."""

import re
from collections.abc import Callable, Collection, Iterator
from dataclasses import dataclass, replace
from typing import Literal, TypeAlias, final

import jax
import numpy as np
from jaxtyping import Float32, Float64

from app.core.geometry.shapes.base import GripperFingers
from app.core.geometry.shapes.tools import Finger
from app.core.measured_setup import FoundTable, MeasuredSetup, SourcedSize
from app.core.messages import Parameter
from app.discovery import sensor_actuator_errors
from app.discovery.dataset.bowls import PouredBowls
from app.discovery.dataset.object_kinds import ROPE, ObjectTraits
from app.discovery.sensor_actuator_errors.base import Apparatus, Values
from app.sim import effects
from app.sim.effects.base import MIDDLE, MIDDLE_M, REACH_M, Effect, is_place
from app.sim.files import files_of
from app.sim.model.numerics import NUMERICS, POUR_NUMERICS, ROD_NUMERICS, RodUnknown
from app.sim.model.params import PARAMETERS, ROD_PARAMETERS, index, with_stiffness_up_to
from app.sim.model.scene import Scene
from app.sim.parameter import NullPrior, ParameterSpec
from app.sim.rods.scene import RodScene
from app.sim.state import State
from app.sim.tools.base import COORDINATES

Theta: TypeAlias = Float64[np.ndarray, " P"]
"""Values of all parameters of a `Catalogue`, in its order."""
InitialState: TypeAlias = Callable[[jax.Array], State]
Family: TypeAlias = Literal["sensing", "actuation", "physics", "numerics"]

_UNSAID = 3.0
"""Steps of a size that nobody said are so many times as long, and its prior with them: people who measure a rope's mass
err by less than a fifth, and ropes of one size and other making differ by a factor of two."""


@final
@dataclass(frozen=True, kw_only=True)
class RodModel:
    """The object as a rod; `contact`: further fields of `RodPhysics`, by name."""

    scene: RodScene
    contact: tuple[tuple[str, float], ...] = ()
    unknowns: tuple[tuple[str, RodUnknown], ...] = tuple(ROD_NUMERICS.items())
    """`ROD_NUMERICS`, with longer steps of unmeasured quantities."""


@final
@dataclass(frozen=True, kw_only=True)
class Subject:
    """A task's simulator as discovery uses it.

    `time_scale`: real seconds in one simulated second; `mass_kg`, `length_m`, `radius_m`: the object's; `low_m`: below
    this height the tool can touch it; `nominal`: values of `PARAMETERS`, of which `calibrated` are fitted whatever the
    cause. `rods`: the object as a rod, which is simulated instead of the scene's material points where it is given.
    """

    scene: Scene
    time_scale: float
    mass_kg: float
    length_m: float
    radius_m: float
    low_m: float
    particle_count: int
    nominal: Float32[np.ndarray, " P"]
    calibrated: tuple[str, ...]
    rods: RodModel | None = None
    unsaid: frozenset[str] = frozenset()
    """Sizes that the data do not give, by their names in `object_description.SIZES`."""
    finger: Finger | None = None
    """The tool, where it is a finger and known which it is."""
    kind: ObjectTraits = ROPE
    paddle_half_m: tuple[float, float] | None = None
    """Half the width and half the thickness of the paddle; None of another tool."""
    fingers: GripperFingers | None = None
    """Fingers of a tool that holds the object all the while."""
    initial_state: InitialState = State.at_rest
    """State of the object's particles at places (B, N, 3) where they are at rest; not of rods."""
    bowls: PouredBowls | None = None
    """Those from and into which a liquid is poured."""
    priors: tuple[Parameter, ...] = ()
    """Those of the `calibrated` parameters that are known beforehand; the others are practically free."""

    @property
    def gravity_scale(self) -> float:
        """The simulation's weight over the real one."""
        gravity = self.scene.gravity_m_s2 if self.rods is None else self.rods.scene.gravity_m_s2
        return gravity / 9.81

    @property
    def step_s(self) -> float:
        """Time step, in real time."""
        return (self.scene.dt_s if self.rods is None else self.rods.scene.dt_s) * self.time_scale

    @property
    def is_ensemble(self) -> bool:
        """True if every push is simulated from several beginnings: of rods, and of pieces, which are chaotic."""
        return self.rods is not None or self.kind.is_chaotic

    @property
    def tool_coordinates(self) -> int:
        """Numbers of a tool's pose that the simulator takes: 3, 7 with its quaternion, or 8 with its opening."""
        return 3 if self.rods is not None else max(COORDINATES[tool.motion] for tool in self.scene.tools)

    def catalogue(
        self, *, origin_m: tuple[float, float] = (0.0, 0.0), reach_m: tuple[float, float] = REACH_M
    ) -> "Catalogue":
        """The causes that it may be asked about: see `catalogue`."""
        known = catalogue(self.rods, kind=self.kind, origin_m=origin_m, reach_m=reach_m)
        return replace(known, priors=self.priors)

    def numeric(self, name: str) -> "Subject":
        """The subject with one of `NUMERICS` at 1, which change what is compiled."""
        return replace(self, scene=NUMERICS[name].change(self.scene))


@final
@dataclass(frozen=True, kw_only=True)
class Cause:
    """Candidate cause of a model error: an effect by its file's name, or a numeric one.

    `columns` are where its parameters stand in a catalogue's `specs`; the first `switches` of them make it vanish.
    `reach_m`: see `Effect`.
    """

    name: str
    family: Family
    about: str
    columns: tuple[int, ...]
    switches: int
    reach_m: float | None = None
    odd: tuple[int, ...] = ()
    """Columns of parameters that change their sign where the object's other end is called the first."""
    placed: bool = False
    """True if the other parameters are a place on the table, as `effects.base.place` makes them."""

    def axis_of(self, column: int) -> tuple[int, ...]:
        """The axis along which a column is this cause's place; nothing where it is none."""
        return tuple(axis for axis in range(2) if self.placed and column == self.columns[self.switches + axis])


@final
@dataclass(frozen=True, kw_only=True)
class Catalogue:
    """All causes and their parameters: the simulator's phi first, then the apparatus's, then numerics."""

    specs: tuple[ParameterSpec, ...]
    causes: tuple[Cause, ...]
    apparatus: tuple[tuple[Apparatus, int], ...]
    """Each with the column of its first parameter."""
    rods: bool = False
    """True for objects as rods."""
    kind: ObjectTraits = ROPE
    origin_m: tuple[float, float] = (0.0, 0.0)
    """Origin of its places in the frame in which they are reported."""
    reach_m: tuple[float, float] = REACH_M
    """Farthest that something may have its place from the middle of the table, along x and y."""
    priors: tuple[Parameter, ...] = ()
    """Intervals of parameters that are known beforehand."""

    def column(self, name: str) -> int:
        """Column of a parameter. KeyError if there is none of that name."""
        return [spec.name for spec in self.specs].index(name)

    def cause(self, name: str) -> Cause:
        """The cause called `name`."""
        return next(cause for cause in self.causes if cause.name == name)

    def told_m(self, column: int) -> float:
        """Offset of a place [m] when it is reported; 0 for other parameters."""
        return next((self.origin_m[axis] for cause in self.causes for axis in cause.axis_of(column)), 0.0)

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


def setup_of(subject: Subject) -> MeasuredSetup | None:
    """Setup of recordings that say no sizes: all of it is the task's; None where the tool is unknown."""
    finger = subject.finger
    if finger is None or subject.rods is None:
        return None
    sizes = {
        "length_m": subject.length_m,
        "radius_m": subject.radius_m,
        "mass_kg": subject.mass_kg,
        "finger_radius_m": finger.radius_m,
        "finger_half_width_m": finger.half_width_m,
        "finger_yaw_rad": finger.yaw_rad,
    }
    return MeasuredSetup(
        sizes=tuple(SourcedSize(name=name, value=value, source="task") for name, value in sizes.items()),
        table=FoundTable(),
    )


def unknowns_of(unsaid: Collection[str]) -> tuple[tuple[str, RodUnknown], ...]:
    """`ROD_NUMERICS` without these sizes: one rule, steps and priors `_UNSAID` times as wide."""
    return tuple(
        (name, replace(unknown, step=_UNSAID * unknown.step, about=f"{unknown.about[:-1]}, three times as wide."))
        if unknown.size in unsaid
        else (name, unknown)
        for name, unknown in ROD_NUMERICS.items()
    )


def catalogue(
    rods: RodModel | None = None,
    *,
    kind: ObjectTraits = ROPE,
    origin_m: tuple[float, float] = (0.0, 0.0),
    reach_m: tuple[float, float] = REACH_M,
) -> Catalogue:
    """Catalogue of all effect files of simulator and apparatus, and numerics; all parameters, libraries' too.

    `rods`: of an object as a rod, on which not every effect acts; `kind`: of object, likewise. Parameters stand in the
    same columns, but numerics.
    `origin_m`, `reach_m`: see `Catalogue`.
    """
    stiffest = Scene.stiffest_pa if rods is None else rods.scene.max_rigidity_n_m2 / rods.scene.second_moment_m4
    specs = list(with_stiffness_up_to(PARAMETERS if rods is None else ROD_PARAMETERS, stiffest))
    causes = list[Cause]()
    for name, module in files_of(effects):
        effect = module.EFFECT
        if not effect.catalogued or kind.name not in effect.objects or (rods is not None and effect.rod is None):
            continue
        columns = tuple(index(spec.name) for spec in effect.parameters)
        causes.append(_cause(name, "physics", _about(module.__doc__ or ""), columns, effect))
    held = list[tuple[Apparatus, int]]()
    for name, module in files_of(sensor_actuator_errors):
        effect = module.EFFECT
        first = len(specs)
        specs += effect.parameters
        held.append((effect, first))
        columns = tuple(range(first, len(specs)))
        if kind.name in effect.objects:
            causes.append(_cause(name, effect.family, _about(module.__doc__ or ""), columns, None))
    # What is compiled can only be finer, wider or earlier.
    numerics = [_numeric(name, each.about) for name, each in NUMERICS.items()]
    if kind.is_poured:
        numerics = [
            replace(_numeric(name, each.about, each.low, each.null_prior), liquid_null_prior=each.liquid_null_prior)
            for name, each in POUR_NUMERICS.items()
        ]
    if rods is not None:
        numerics = [_numeric(name, each.about, each.low, each.null_prior) for name, each in rods.unknowns]
    for spec in numerics:
        specs.append(spec)
        causes.append(_cause(spec.name, "numerics", spec.about, (len(specs) - 1,), None))
    x, y = (middle + origin for middle, origin in zip(MIDDLE_M, origin_m, strict=True))
    specs = [replace(spec, about=spec.about.replace(MIDDLE, f"({x:g}, {y:g}) m")) for spec in specs]
    for cause in causes:
        for axis, column in enumerate(cause.columns[cause.switches :] if cause.placed else ()):
            specs[column] = replace(
                specs[column],
                low=round(MIDDLE_M[axis] - reach_m[axis], 9),
                high=round(MIDDLE_M[axis] + reach_m[axis], 9),
            )
    return Catalogue(
        specs=tuple(specs),
        causes=tuple(causes),
        apparatus=tuple(held),
        rods=rods is not None,
        kind=kind,
        origin_m=origin_m,
        reach_m=reach_m,
    )


def _cause(name: str, family: Family, about: str, columns: tuple[int, ...], effect: Effect | None) -> Cause:
    switches = effect.switches if effect is not None and effect.switches is not None else len(columns)
    reach_m = effect.reach_m if effect is not None else None
    odd = () if effect is None else tuple(index(parameter) for parameter in effect.odd)
    return Cause(
        name=name,
        family=family,
        about=about,
        columns=columns,
        switches=switches,
        reach_m=reach_m,
        odd=odd,
        placed=effect is not None and is_place(effect.parameters[switches:]),
    )


def _about(doc: str) -> str:
    """The first sentence of a file's docstring."""
    return re.split(r"\.\s+(?=[A-Z])", " ".join(doc.split("\n\n")[0].split()))[0].rstrip(".") + "."


def _numeric(name: str, about: str, low: float = 0.0, null_prior: NullPrior | None = None) -> ParameterSpec:
    return ParameterSpec(
        name=name,
        unit="1",
        nominal=0.0,
        low=low,
        high=2.0,
        typical=1.0,
        scale="linear",
        about=about,
        null_prior=null_prior,
    )
