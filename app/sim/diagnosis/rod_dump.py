"""Rod cases as a dump has them: a header in JSON and arrays by their names (`app.sim.diagnosis.dump` has the file)."""

from collections.abc import Mapping
from dataclasses import is_dataclass
from typing import Any

import jax.numpy as jnp
import numpy as np

from app.sim.diagnosis.rod_failure_diagnosis import RodCase
from app.sim.model.entries import check_parameters, effect_names, fields_entry, from_entry, named_effects
from app.sim.rods import scene as scenes
from app.sim.rods.checks import RodSetup, require_rod_shapes
from app.sim.rods.effect import RodSetting
from app.sim.rods.rollout import RodPhysics
from app.sim.rods.scene import RodScene
from app.sim.rods.state import RodState


def rod_header(case: RodCase) -> dict[str, Any]:
    """The setup. Raises UsageError where it has an effect that is no file of app/sim/effects."""
    setup = case.setup
    return {
        "scene": fields_entry(setup.scene),
        "effects": effect_names(setup.effects),
        "parameters": [spec.name for spec in setup.specs()],
    }


def rod_arrays(case: RodCase) -> dict[str, Any]:
    """All arrays by part and name."""
    parts = {"physics": case.physics, "state": case.state, "setting": case.setting}
    named = {f"{part}.{name}": leaf for part, given in parts.items() for name, leaf in given._asdict().items()}
    return {"phi": case.phi, "tool": case.tool, **named}


def rod_case_of(header: Mapping[str, Any], arrays: Mapping[str, np.ndarray]) -> RodCase:
    """The case. Raises UsageError, RecordingError, ParameterError or KeyError for what this version does not know."""
    known = {name: kind for name, kind in vars(scenes).items() if isinstance(kind, type) and is_dataclass(kind)}
    scene = RodScene(**{name: from_entry(entry, known) for name, entry in header["scene"].items()})
    setup = RodSetup(scene=scene, effects=named_effects(header["effects"]))
    check_parameters(setup.specs(), header["parameters"])

    def part(name: str, kind: type[Any]) -> Any:
        return kind(**{field: jnp.asarray(arrays[f"{name}.{field}"]) for field in kind._fields})

    case = RodCase(
        setup=setup,
        physics=part("physics", RodPhysics),
        phi=arrays["phi"],
        state=part("state", RodState),
        tool=arrays["tool"],
        setting=part("setting", RodSetting),
    )
    require_rod_shapes(setup, case.physics, case.phi, case.state, case.tool, case.setting)
    return case
