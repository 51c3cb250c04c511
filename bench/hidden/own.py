"""Recordings of our own material points in other numerics: `python -m bench.hidden.own ORDERS.json -o FOLDER`.

A process of its own. ORDERS.json is a list of {name, seed, hidden: [[effect, size], ...]}; sizes are in typical ones.
Each makes FOLDER/NAME/recordings/*.mcap and FOLDER/NAME/truth.json. All are simulated side by side.
"""

import argparse
import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, final

import numpy as np
from jaxtyping import Float64

from app.discovery.dataset.model_under_test import Catalogue, Subject, Theta, catalogue
from app.discovery.residuals.predict import Predictor
from app.jobs.discovery_subject import subject_of
from app.policy.random_pushes import PushDesign
from app.rig.simulated.effect_sampling import MISTUNED
from app.sim.parameter import ParameterSpec
from app.tasks import load
from app.tasks.elements.curves import fill_tube
from bench.hidden.outside import OUTSIDE
from bench.hidden.recorded import write
from bench.own_world import DENSER, OwnWorld, finer

_TASK = "rope_push"
_BEYOND = np.array([spec.nominal for effect in OUTSIDE.values() for spec in effect.parameters])
_PLACES = (0.45, 0.65), (-0.15, 0.15)
"""Range of places where pushes pass: x and y [m]; as in MuJoCo's world."""
_TIMES = -0.25, 0.25
"""Range of session times of an abrupt change."""


@final
@dataclass(frozen=True, kw_only=True)
class Order:
    """Recordings to be made: a folder's name, a seed, and effects with their sizes in typical ones."""

    name: str
    seed: int
    hidden: tuple[tuple[str, float], ...]


@final
@dataclass(frozen=True, kw_only=True, eq=False)
class World:
    """Hidden parameters of one world: those of the catalogue, and of `OUTSIDE` in their order."""

    theta: Theta
    beyond: Float64[np.ndarray, " Q"]
    effects: list[dict[str, Any]]

    @property
    def strange(self) -> bool:
        """True if anything of `OUTSIDE` acts."""
        return bool((self.beyond != _BEYOND).any())


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("orders", type=Path)
    parser.add_argument("-o", "--output", type=Path, required=True)
    parser.add_argument("--episodes", type=int, default=8)
    parser.add_argument("--pushes", type=int, default=8)
    options = parser.parse_args()
    record(read_orders(options.orders), PushDesign(episodes=options.episodes, pushes=options.pushes), options.output)


def read_orders(path: Path) -> list[Order]:
    """Orders in a file."""
    return [
        Order(name=each["name"], seed=each["seed"], hidden=tuple(map(tuple, each["hidden"])))
        for each in json.loads(path.read_text(encoding="utf-8"))
    ]


def record(orders: Sequence[Order], plan: PushDesign, folder: Path) -> None:
    """All of them, each with its truth beside the folder of its recordings."""
    task, known = load(_TASK), catalogue()
    subject = subject_of(task)
    worlds = [world_of(order, known, subject) for order in orders]
    starts = np.stack(
        [fill_tube(task.start(order.seed), task.rope.radius_m, DENSER * subject.particle_count) for order in orders]
    )
    beyond = np.stack([world.beyond for world in worlds])
    strange = any(world.strange for world in worlds)
    made = OwnWorld(
        predictor=Predictor(subject, known),
        scene=finer(subject.scene),
        plan=plan,
        outside=tuple(OUTSIDE.values()) if strange else (),
    )
    seed = int(np.random.SeedSequence([order.seed for order in orders]).generate_state(1)[0])
    studies = made.record([world.theta for world in worlds], starts, seed, beyond if strange else None)
    for order, world, study in zip(orders, worlds, studies, strict=True):
        write(study, folder / order.name / "recordings")
        truth = {"effects": world.effects, "seed": order.seed, "episodes": plan.episodes, "pushes": plan.pushes}
        (folder / order.name / "truth.json").write_text(json.dumps(truth), encoding="utf-8")


def world_of(order: Order, known: Catalogue, subject: Subject) -> World:
    """Friction and stiffness off by up to 30 %, and every effect with a direction, sign and place of its own."""
    rng = np.random.default_rng(order.seed)
    theta, beyond = known.nominal(subject), _BEYOND.copy()
    for name in subject.calibrated:
        theta[known.column(name)] *= rng.uniform(1 - MISTUNED, 1 + MISTUNED)
    effects = list[dict[str, Any]]()
    for name, size in order.hidden:
        if name in OUTSIDE:
            effect = OUTSIDE[name]
            first = sum(len(other.parameters) for other in list(OUTSIDE.values())[: list(OUTSIDE).index(name)])
            values = _drawn(rng, effect.parameters, effect.switches or len(effect.parameters), size)
            beyond[first : first + len(values)] = values
            effects.append(_told(name, "physics", False, effect.parameters, values, subject))
        else:
            cause = known.cause(name)
            specs = tuple(known.specs[column] for column in cause.columns)
            values = _drawn(rng, specs, cause.switches, size)
            theta[list(cause.columns)] = values
            effects.append(_told(name, cause.family, True, specs, values, subject))
    return World(theta=theta, beyond=beyond, effects=effects)


def _drawn(
    rng: np.random.Generator, specs: Sequence[ParameterSpec], switches: int, size: float
) -> Float64[np.ndarray, " V"]:
    """Switches as a vector of that length in typical sizes, in any possible direction; places where pushes come by."""
    ahead = rng.standard_normal(switches)
    ahead /= np.linalg.norm(ahead)
    values = [_switched(spec, size * part) for spec, part in zip(specs, ahead.tolist(), strict=False)]
    rest = specs[switches:]
    if len(rest) == len(_PLACES):
        values += [float(rng.uniform(*bounds)) for bounds in _PLACES]
    else:
        values += [float(rng.uniform(*_TIMES)) if spec.unit == "session" else spec.nominal for spec in rest]
    return np.array(values)


def _switched(spec: ParameterSpec, size: float) -> float:
    """A switch at so many typical sizes from its null, on the other side where its range ends there."""
    assert spec.typical is not None
    null, typical = spec.coordinate(spec.nominal), spec.coordinate(spec.typical)
    return spec.value(null + (abs(size) if spec.nominal in (spec.low, spec.high) else size) * (typical - null))


def _told(
    name: str,
    family: str,
    catalogued: bool,
    specs: Sequence[ParameterSpec],
    values: Float64[np.ndarray, " V"],
    subject: Subject,
) -> dict[str, Any]:
    """Entry of the truth in the format of `dipac hide`: real values in SI units."""

    def real(spec: ParameterSpec, value: float) -> float:
        return spec.real(value, subject.time_scale, subject.gravity_scale)

    parameters = {
        spec.name: {"value": real(spec, value), "unit": spec.unit, "null": real(spec, spec.nominal)}
        for spec, value in zip(specs, values.tolist(), strict=True)
    }
    return {"effect": name, "family": family, "catalogued": catalogued, "parameters": parameters}


if __name__ == "__main__":
    main()
