"""The physical parameters phi: their specifications, nominal values, and the validation of arrays.

phi has one row a candidate, shape (B, P), float32, in physical units; the columns are those of `PARAMETERS`.
"""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace
from functools import cache

import numpy as np
from jaxtyping import Float, Float32

from app.core.errors import ParameterError
from app.sim.effects.base import Effect
from app.sim.model.catalogue import EFFECTS
from app.sim.parameter import ParameterSpec

NOMINAL_PHYSICS = (
    ParameterSpec(
        name="stiffness",
        unit="Pa",
        nominal=2.0e4,
        low=1.0e3,
        high=5.0e6,
        scale="log",
        scaling=(0, -1),
        about="Young's modulus of the object; for a rope it stands for its resistance to bending.",
    ),
    ParameterSpec(
        name="table_friction",
        unit="1",
        nominal=0.4,
        low=0.02,
        high=1.5,
        scale="log",
        about="Coulomb friction coefficient between the object and the table.",
    ),
)


def parameters_with(effects: Sequence[Effect]) -> tuple[ParameterSpec, ...]:
    """The columns of phi for a simulator with these effects."""
    return NOMINAL_PHYSICS + tuple(spec for effect in effects for spec in effect.parameters)


PARAMETERS = parameters_with(EFFECTS)

_TIME_SCALE, _GRAVITY_SCALE = 5.0, 12.0
"""Those of the simulated rope of material points (`tasks.rope_push`), for which effects say what is typical."""


def rod_parameters_of(effects: Sequence[Effect]) -> tuple[ParameterSpec, ...]:
    """The parameters of effects on rods, which move in real time under their real weight."""
    return tuple(spec.in_real_units(_TIME_SCALE, _GRAVITY_SCALE) for effect in effects for spec in effect.parameters)


ROD_PARAMETERS = NOMINAL_PHYSICS + rod_parameters_of(EFFECTS)
"""`PARAMETERS` as rods have them: in the same columns, with other ranges and typical values of the effects."""


def with_stiffness_up_to(specs: Sequence[ParameterSpec], stiffest_pa: float) -> tuple[ParameterSpec, ...]:
    """`specs`, with the range of stiffness ending at `stiffest_pa`, the most that a simulator's time steps bear."""
    return with_stiffness_between(specs, 0.0, stiffest_pa)


def with_stiffness_between(specs: Sequence[ParameterSpec], low_pa: float, high_pa: float) -> tuple[ParameterSpec, ...]:
    """`specs`, with the range of stiffness cut down to `low_pa` to `high_pa`, and its nominal value moved into that."""

    def cut(spec: ParameterSpec) -> ParameterSpec:
        low, high = max(spec.low, low_pa), min(spec.high, high_pa)
        return replace(spec, low=low, high=high, nominal=min(max(spec.nominal, low), high))

    return tuple(cut(spec) if spec.name == "stiffness" else spec for spec in specs)


def phi_with_nulls(values: Mapping[str, float]) -> Float32[np.ndarray, " P"]:
    """`values` as phi; parameters of effects that are missing, as in an older model, are at their nulls.

    Raises ParameterError where what every simulation needs is not among them.
    """
    missing = [spec.name for spec in NOMINAL_PHYSICS if spec.name not in values]
    if missing:
        raise ParameterError(f"The model lacks {', '.join(missing)}; calibrate one with this version.")
    return np.array([values.get(spec.name, spec.nominal) for spec in PARAMETERS], np.float32)


def acting(phi: Float[np.ndarray, " P"], names: Collection[str] = ()) -> tuple[Effect, ...]:
    """The effects that `phi` needs: those not at their null, and those with one of the parameters `names`.

    A simulator of them alone does the same in less time: a GPU's adjoint takes half as long again with all.
    """
    nominal = nominal_phi()

    def needed(effect: Effect) -> bool:
        switches = effect.parameters[: effect.switches]
        differs = any(np.float32(phi[index(spec.name)]) != nominal[index(spec.name)] for spec in switches)
        return differs or any(spec.name in names for spec in effect.parameters)

    return tuple(effect for effect in EFFECTS if needed(effect))


def columns_of(effects: Sequence[Effect]) -> list[int]:
    """Column indices in phi of the parameters of a simulator with these effects."""
    return [index(spec.name) for spec in parameters_with(effects)]


def odd_values(phi: Float[np.ndarray, " P"]) -> tuple[float, ...]:
    """Values of the parameters that change their sign with the end of the object that is called the first."""
    return tuple(float(value) for value in phi[_odd_columns()])


def with_orientation(phi: Float32[np.ndarray, " P"], sign: float) -> Float32[np.ndarray, " P"]:
    """`phi` of an object whose first end is the other one (`sign` -1), or nobody knows which (0: what is even acts)."""
    other = phi.copy()
    other[_odd_columns()] *= sign
    return other


def index(name: str) -> int:
    """The column of phi that holds `name`; UsageError with the known names where there is none."""
    names = [spec.name for spec in PARAMETERS]
    if name not in names:
        raise ParameterError.unknown("parameter", name, names)
    return names.index(name)


def nominal_phi() -> Float32[np.ndarray, " P"]:
    """The nominal model: every effect at its null value."""
    return np.array([spec.nominal for spec in PARAMETERS], np.float32)


def validate(
    phi: Float[np.ndarray, "*batch P"], specs: Sequence[ParameterSpec] = PARAMETERS
) -> Float32[np.ndarray, "*batch P"]:
    """`phi` as float32, or a ParameterError that names the first entry that is non-finite or outside its range."""
    values = np.asarray(phi, np.float32)
    if values.shape[-1:] != (len(PARAMETERS),):
        raise ParameterError(f"phi has shape {values.shape}; its last axis must have {len(PARAMETERS)} entries.")
    require_ranges(specs, values.reshape(-1, len(PARAMETERS)))
    return values


def require_ranges(specs: Sequence[ParameterSpec], phi: Float32[np.ndarray, "B P"]) -> None:
    """Raises ParameterError for the first entry that is non-finite or outside its range, and says whose it is."""
    low, high = (np.array(ends, np.float32) for ends in zip(*((spec.low, spec.high) for spec in specs), strict=True))
    wrong = np.argwhere(~((phi >= low) & (phi <= high)))
    if len(wrong):
        candidate, column = wrong[0]
        spec = specs[column]
        whose = f"Candidate {candidate}: " if len(phi) > 1 else ""
        raise ParameterError(
            f"{whose}{spec.name} = {phi[candidate, column]:g} is outside its range {spec.low:g} to {spec.high:g} "
            f"(unit {spec.unit})."
        )


@cache
def _odd_columns() -> list[int]:
    return [index(name) for effect in EFFECTS for name in effect.odd]
