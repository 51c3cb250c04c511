"""Value of following a rope's ends to predictions: `python -m bench.hidden.ends -o LINES.jsonl --worlds 8`.

MuJoCo's worlds hide an effect along the rope, in a direction and with a size of their own. Models know the effect as it
is, but not which end of the rope is the first, and neither the world's friction nor its stiffness. Each push of an
episode is predicted by the task's nominal model, with what is even along the rope, by what was known of the ends
before it, and with the ends as they are. Errors are mean distances of nodes from the truth [mm].
"""

import argparse
import json
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Final, final

import jax.numpy as jnp
import numpy as np
from jaxtyping import Float64

from app.core.geometry.orientation import UNKNOWN
from app.core.messages import Executed, MessageId, Model, Transition, fresh_id
from app.core.types import Centreline, Points
from app.jobs import jit_cache
from app.jobs.rope_orientation import oriented_phi
from app.jobs.worker_api import nominal_model, track_orientation
from app.policy.random_pushes import PushDesign
from app.rig.simulated.effect_sampling import InjectionRequest, draw, injectable_effects, mistune
from app.rig.simulated.push_session import PushSample, PushSession
from app.rig.simulated.worlds.rope import resample
from app.sim.model.params import PARAMETERS, with_orientation
from app.tasks import load
from bench.hidden.outcome import either_end
from bench.hidden.ropes import view_of

TASK: Final = "rope_push@rods"
EFFECTS: Final = either_end()
_SEEN, _SIZE = 31, 32
"""Streams of random numbers of a seed."""


@final
@dataclass(frozen=True, kw_only=True)
class PredictedPush:
    """One push. `sign`: of the ends as they were taken for before it, times the true one; `log_odds` for the truth.

    `errors_mm`: of the nominal model, with what is even, with what was known, with the truth, and with its contrary.
    `seen_mm`: root mean square distances from what is seen, of the truth and of its contrary.
    """

    effect: str
    size: float
    seed: int
    push: int
    sign: float
    log_odds: float
    errors_mm: tuple[float, ...]
    moved_mm: float
    seen_mm: tuple[float, ...]


def predicted_pushes(effect: str, size: float, seed: int, pushes: int) -> Iterator[PredictedPush]:
    """An episode of random pushes in one world; `size` in typical ones."""
    task, rng = load(TASK), np.random.default_rng([seed, _SEEN])
    hidden = draw([InjectionRequest(effect, size * float(injectable_effects()[effect].main.typical or 0.0))], seed)
    session = PushSession(task, PushDesign(episodes=1, pushes=pushes), mistune(seed, body=task.rope), hidden, seed)
    nominal = nominal_model(TASK)
    names = [quantity.name for quantity in hidden[0].effect.quantities]
    model = _with(nominal, dict(zip(names, hidden[0].values.tolist(), strict=True)))
    orientation, before = UNKNOWN, view_of(task, session.look(), rng).points
    for number in range(pushes):
        take = session.push(session.random())
        after = view_of(task, session.look() if number + 1 < pushes else take.after, rng).points
        line, truth = _nodes(before, orientation.line), _true(take.before.snapshot.nodes)
        first = 1.0 if np.linalg.norm(line - truth) < np.linalg.norm(line[:, ::-1] - truth) else -1.0
        phi = jit_cache.phi_of(model)
        told = oriented_phi(model, before, orientation, line)
        tried = [
            jit_cache.phi_of(nominal),
            with_orientation(phi, 0.0),
            told,
            with_orientation(phi, first),
            with_orientation(phi, -first),
        ]
        there = _true(take.after.snapshot.nodes)[:, :: int(first)]
        made = _transition(before, take, after)
        predicted = _predicted(model, before, line, made, np.stack(tried))
        shown = _nodes(after, predicted[3:].mean(0))
        sign = orientation.sign(line) * first
        orientation = track_orientation(TASK, orientation, made, model)
        yield PredictedPush(
            effect=effect,
            size=size,
            seed=seed,
            push=number,
            sign=sign,
            log_odds=first * orientation.log_odds,
            errors_mm=tuple(1e3 * float(np.linalg.norm(each - there, axis=0).mean()) for each in predicted),
            moved_mm=1e3 * float(np.linalg.norm(there - truth[:, :: int(first)], axis=0).mean()),
            seen_mm=tuple(1e3 * float(np.sqrt(((each - shown) ** 2).sum(0).mean())) for each in predicted[3:]),
        )
        before = after


def _with(model: Model, values: dict[str, float]) -> Model:
    """The model with these values, moved into their ranges."""
    specs = {spec.name: spec for spec in PARAMETERS}
    known = {name: float(np.clip(value, specs[name].low, specs[name].high)) for name, value in values.items()}
    parameters = tuple(replace(each, value=known.get(each.name, each.value)) for each in model.parameters)
    return replace(model, parameters=parameters)


def _nodes(x: Points, near: Centreline) -> Centreline:
    begun = load(TASK).initial_state(jnp.asarray(x)[None], jnp.asarray(near) if near.size else None)
    return np.asarray(begun.centreline[0])


def _true(nodes: Float64[np.ndarray, "K 3"]) -> Centreline:
    rods = load(TASK).rods
    assert rods is not None
    return resample(nodes, rods.scene.nodes)[:, :2].T.astype(np.float32)


def _predicted(
    model: Model, before: Points, line: Centreline, made: Transition, phis: Float64[np.ndarray, "Q P"]
) -> Float64[np.ndarray, "Q 2 n"]:
    """Nodes after the push by each of the models."""
    task, count = load(TASK), len(phis)
    path = task.actions.measured_path(made.executed.tool)
    state = task.initial_state(jnp.tile(jnp.asarray(before), (count, 1, 1)), jnp.asarray(line))
    simulate = jit_cache.action_simulator(TASK, len(before), *jit_cache.needs(TASK, jit_cache.phi_of(model)))
    return np.asarray(simulate(jnp.asarray(phis), state, jnp.tile(jnp.asarray(path), (count, 1, 1))).centreline)


def _transition(before: Points, take: PushSample, after: Points) -> Transition:
    executed = Executed(
        id=fresh_id("executed"),
        time_s=take.command.end_s,
        approved_id=MessageId("rehearsed"),
        outcome="completed",
        reason="",
        times_s=take.command.times_s,
        commanded=take.command.poses,
        measured=take.measured.poses,
    )
    return Transition(
        id=fresh_id("transition"), time_s=take.command.end_s, before=before, executed=executed, after=after
    )


def summary(lines: Sequence[PredictedPush]) -> dict[str, float]:
    """Mean errors by model, shares of signs that were right, wrong and unknown, and how far the rope moved."""
    errors = np.array([line.errors_mm for line in lines])
    signs = np.array([line.sign for line in lines])
    names = ("nominal", "even", "followed", "true", "contrary")
    shares = {
        "right": float((signs > 0).mean()),
        "wrong": float((signs < 0).mean()),
        "unknown": float((signs == 0).mean()),
    }
    return dict(zip(names, errors.mean(0).tolist(), strict=True)) | shares


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("-o", "--output", type=Path, required=True)
    parser.add_argument("--effects", nargs="+", choices=EFFECTS, default=EFFECTS)
    parser.add_argument("--worlds", type=int, default=8, help="of each effect")
    parser.add_argument("--pushes", type=int, default=10)
    parser.add_argument("--sizes", type=float, nargs=2, default=(0.5, 2.0), help="in typical ones, log-uniform between")
    parser.add_argument("--seed", type=int, default=0, help="of the first world")
    options = parser.parse_args()
    with options.output.open("a", encoding="utf-8") as file:
        for effect in options.effects:
            found = list[PredictedPush]()
            for seed in range(options.seed, options.seed + options.worlds):
                size = float(np.exp(np.random.default_rng([seed, _SIZE]).uniform(*np.log(options.sizes))))
                for line in predicted_pushes(effect, size, seed, options.pushes):
                    found.append(line)
                    file.write(f"{json.dumps(asdict(line))}\n")
                    file.flush()
            print(effect, {name: round(value, 3) for name, value in summary(found).items()}, flush=True)


if __name__ == "__main__":
    main()
