"""Errors of our own discretisation and contact, as causes that discovery weighs beside effects: one entry each."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Final, final

from app.sim.model.scene import Scene
from app.sim.parameter import NullPrior

OURS: Final = "it is an error of our own numerics, which another engine does not have"
"""Reason why numerics cannot be injected into a world."""
_OF_EACH_ROPE: Final = "it differs from rope to rope, and is fitted whatever the cause"
_EARLIER_M: Final = 1.5e-3


@final
@dataclass(frozen=True, kw_only=True)
class SceneNumerics:
    """A change of the scene of material points, which is compiled anew for it. `about` says what all of it is."""

    about: str
    change: Callable[[Scene], Scene]


def _refine(scene: Scene) -> Scene:
    x, y, z = scene.low
    return replace(scene, cell_m=0.8 * scene.cell_m, dt_s=0.8 * scene.dt_s, low=(x, y, 0.8 * z))


def _widen(scene: Scene) -> Scene:
    return replace(scene, contact_width_m=1.5 * scene.contact_width_m)


def _touch_earlier(scene: Scene) -> Scene:
    return replace(scene, contact_margin_m=scene.contact_margin_m + _EARLIER_M)


NUMERICS: Mapping[str, SceneNumerics] = {
    "resolution": SceneNumerics(about="Share of the way to a grid and time step finer by a fifth.", change=_refine),
    "contact_softness": SceneNumerics(about="Share of the way to contacts half as wide again.", change=_widen),
    "contact_distance": SceneNumerics(
        about="Share of the way to contacts that begin 1.5 mm earlier.", change=_touch_earlier
    ),
}
"""Our own discretisation as pseudo-effects, so that its errors are not taken for physics."""


@final
@dataclass(frozen=True, kw_only=True)
class PourUnknown:
    """A number of pours that no recording says. `step`: a share, see `about`; `low` and null priors: in steps.

    `null_prior` is that of a liquid with pieces, `liquid_null_prior` that of one without.
    """

    about: str
    step: float
    liquid_null_prior: NullPrior
    low: float = -2.0
    null_prior: NullPrior = (0.0, 1.0)


@final
@dataclass(frozen=True, kw_only=True)
class RodUnknown:
    """A field of `RodPhysics` that differs from rope to rope and is not measured: a usual deviation is a `step`.

    `relative`: the step is of its logarithm. `about` says what a step more is; `null_prior`: of steps.
    """

    field: str
    step: float
    about: str
    null_prior: NullPrior
    relative: bool = False
    low: float = -2.0
    """The least number of steps that means anything."""
    size: str = ""
    """The object's size that says it, by its name in `object_description.SIZES`; empty: none does."""
    not_injectable: str = OURS


ROD_NUMERICS: Mapping[str, RodUnknown] = {
    "contact_distance": RodUnknown(
        field="margin",
        step=7e-4,
        about="Share of the way to a finger and a rope that meet 0.7 mm earlier.",
        null_prior=(-0.429, 0.724),
    ),
    "finger_climb": RodUnknown(
        field="climb",
        step=0.25,
        about="Share of the way to a rope that slips up and down the finger by a quarter of its way more.",
        null_prior=(-0.21, 0.789),
    ),
    "finger_press": RodUnknown(
        field="press",
        step=0.25,
        about="Share of the way to a finger's tip of whose push the table bears a quarter more.",
        null_prior=(1.116, 1.456),
    ),
    "bending_viscosity": RodUnknown(
        field="viscosity",
        step=0.7,
        relative=True,
        about="Logarithm of the rope's viscosity in bending, in 0.7.",
        null_prior=(-0.599, 1.085),
        not_injectable=_OF_EACH_ROPE,
    ),
    "lasting_bends": RodUnknown(
        field="permanent_set",
        step=-0.3,
        low=0.0,
        about="Share of the way to bends of which 30 % less lasts.",
        null_prior=(0.263, 0.385),
        not_injectable=_OF_EACH_ROPE,
    ),
    "bend_yield": RodUnknown(
        field="yield_curvature",
        step=0.4,
        relative=True,
        about="Logarithm of the curvature that lasts, in 0.4.",
        null_prior=(-0.023, 1.013),
        not_injectable=_OF_EACH_ROPE,
    ),
    "rope_mass": RodUnknown(
        field="mass",
        step=0.2,
        relative=True,
        about="Logarithm of the rope's mass, in 0.2.",
        null_prior=(-0.221, 1.543),
        size="mass_kg",
        not_injectable=_OF_EACH_ROPE,
    ),
}
"""Numbers of the rod and its contact that are fitted with every cause, so that what they explain is not taken for one.

Steps are what ropes of MuJoCo's chain, of drawn sizes, differ by in fits of the rod to them (docs/discovery-model.md).
"""
POUR_NUMERICS: Mapping[str, PourUnknown] = {
    "outflow": PourUnknown(
        about="Share of the way to a model of which a fifth more flows out.",
        step=0.2,
        liquid_null_prior=(-0.26, 0.25),
    ),
    "lip_height": PourUnknown(
        about="Share of the way to a bowl whose lip keeps a twentieth of the liquid back.",
        step=0.05,
        liquid_null_prior=(-0.7, 0.36),
    ),
    "spilt": PourUnknown(
        about="Share of the way to pours of which a tenth of what arrives has fallen beside the other bowl.",
        step=0.1,
        low=0.0,
        null_prior=(0.4, 0.3),
        liquid_null_prior=(0.52, 0.31),
    ),
}
"""Errors of a liquid's cells and contacts, which are as thick as what flows over a lip, and what nobody sees.

They are fitted with every cause to what was poured, so that a model that pours too much or too early is not taken for a
thicker liquid, and drops that are lost not for less of it: in two episodes of a world's pours 1 and 3 % were. Priors of
a liquid without pieces are learnt (docs/decisions/0041-what-a-liquid-seems-to-be.md).
"""
ANY_NUMERICS = frozenset(NUMERICS) | frozenset(ROD_NUMERICS) | frozenset(POUR_NUMERICS)
