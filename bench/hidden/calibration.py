"""Training data of confidence: `python -m bench.hidden.calibration lines.jsonl --studies 400`, then `--table FILE`.

Each study is a recording of one of three worlds (MuJoCo's chain, its elastic cable, our rod in other numerics), with
rope, finger, cameras' noise and frictions drawn anew and none, one, two or unknown effects hidden in it, and goes
through discovery's refit and screening. Its features are a line of the file; what is done is not done again, so files
of several machines can be joined, and an interrupted run goes on. The softmax is fitted to all lines, and tried on each
tenth of them that it was not fitted to, and on each world by what was learnt in the others. `--before FILE`: what that
table says is thought before, so that a few hundred studies change it and need not replace it; it must not know them.
"""

import json
import os
from collections.abc import Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import dataclass
from itertools import pairwise
from multiprocessing import get_context
from pathlib import Path
from typing import Annotated, Any, Final, Literal, TypeAlias, final

import numpy as np
import tyro
from jaxtyping import Float64
from rich.console import Console
from rich.progress import track
from rich.table import Table
from scipy.optimize import minimize
from scipy.special import log_softmax, softmax
from threadpoolctl import threadpool_limits

from app.core.errors import SimulationError
from app.core.geometry.scene_description import Rope
from app.discovery.dataset.model_under_test import catalogue
from app.discovery.inference.calibration import Calibration, calibration, calibration_in, features
from app.discovery.inference.decide import (
    NAMED,
    further_suspects,
    is_sized,
    refit_cause,
    rivals_of,
    with_further,
)
from app.discovery.inference.held_out import held_out_gain, held_out_gain_of_linear
from app.discovery.inference.refine import RefinedModel, refine
from app.discovery.inference.screen import CandidateCause, Screening, refit, screen
from app.discovery.inference.weighing import Prior
from app.discovery.residuals.forces import FORMULA
from app.discovery.residuals.predict import Predictor
from app.discovery.residuals.rows import Residuals
from app.discovery.residuals.simulation_batch import SimulationBatch, prepare
from app.evaluation.intervals import share
from app.evaluation.results_log import lines
from app.jobs.discovery_subject import subject_of
from app.policy.random_pushes import PushDesign
from app.rig.simulated.effect_sampling import injectable_effects
from app.tasks import load
from bench.hidden.draws import Chosen, kinds, outsiders
from bench.hidden.own_ropes import OwnRope
from bench.hidden.ropes import RopeCase
from bench.hidden.sizes import FLAT, drawn_cameras

World: TypeAlias = Literal["chain", "cable", "own"]
WORLDS: Final[dict[World, float]] = {"chain": 0.55, "cable": 0.2, "own": 0.25}
"""The engines that make recordings, and the share of each."""
NONE, TWO, UNKNOWN = 0.22, 0.08, 0.08
"""Shares of studies with nothing hidden, with two effects, and with one that no catalogue has."""
SIZES: Final = 0.7, 2.0
"""Range of hidden sizes, in typical ones, log-uniform."""
EPISODES: Final = (5, 6, 8, 10, 12)
PUSHES: Final = (4, 6, 8)
MANY_EPISODES: Final = (8, 10, 14, 20)
MANY_PUSHES: Final = (10, 14, 20)
"""The same of studies of many pushes, 80 to 400."""
WHOLE: Final = PushDesign(episodes=10, pushes=10)
_WHOLE_EVERY: Final = 3
"""One study in so many is as large as those that discovery's aims are about."""
FOLDS: Final = 10
_WEIGHT_PENALTY, _BIAS_PENALTY = 0.3, 1.0
"""Penalties on squared weights and biases, in the loss of all studies."""
_ON: Final = 2.0
"""The same on how far both go from a table that is learnt on, as a multiple: of 0.5 to 8 that by which 210 studies that
were left out are likeliest."""
_LOG_DETERMINANT, _LOG_PUSHES = 10, 12
"""Columns of features: half the logarithm of a precision's determinant, and the logarithm of the number of pushes."""
_SURE: Final = 4.0
"""Standard errors at which a cause of an even prior is expected to be named: its evidence is then 6 nats."""
_EDGES: Final = (0.0, 0.3, 0.5, 0.7, 0.8, 0.9, 1.0)


def drawn(seed: int, number: int, *, many: bool = False) -> tuple[World, RopeCase | OwnRope]:
    """The study of that number, with few pushes or many; the same whatever others are drawn."""
    rng = np.random.default_rng([seed, number])
    world: World = rng.choice(list(WORLDS), p=list(WORLDS.values())).item()
    inside, outside = _hideable(world)
    kind = rng.uniform()
    count = 0 if kind < NONE else 2 if kind < NONE + TWO else 1
    unknown = bool(outside) and NONE + TWO < kind < NONE + TWO + UNKNOWN
    names = rng.choice(outside if unknown else inside, count, replace=False).tolist()
    hidden = tuple(Chosen(effect=name, size=float(np.exp(rng.uniform(*np.log(SIZES))))) for name in sorted(names))
    plan = PushDesign(episodes=int(rng.choice(EPISODES)), pushes=int(rng.choice(PUSHES)))
    if number % _WHOLE_EVERY == 0:
        plan = WHOLE
    if many:
        plan = PushDesign(episodes=int(rng.choice(MANY_EPISODES)), pushes=int(rng.choice(MANY_PUSHES)))
    own_seed = int(rng.integers(2**31))
    _, noise_m = drawn_cameras(own_seed)
    if world == "own":
        return world, OwnRope(seed=own_seed, hidden=hidden, plan=plan, flat=FLAT, noise_m=noise_m)
    return world, RopeCase(seed=own_seed, world=world, hidden=hidden, plan=plan, flat=FLAT, noise_m=noise_m)


def _hideable(world: World) -> tuple[Sequence[str], Sequence[str]]:
    """Effects that a world without images can hide: those of the catalogue, and others."""
    if world == "own":
        return kinds("own"), outsiders("own")
    hideable = {
        name: effect for name, effect in injectable_effects().items() if effect.in_world or effect.drive is not None
    }
    if world == "cable":
        hideable = {name: effect for name, effect in hideable.items() if not effect.in_world}
    hideable = {name: effect for name, effect in hideable.items() if Rope in effect.bodies}
    inside = sorted(name for name, effect in hideable.items() if effect.catalogued)
    return inside, sorted(hideable.keys() - set(inside))


@threadpool_limits.wrap(limits=1, user_api="blas")
def studied(world: World, case: RopeCase | OwnRope, refits: int = 0) -> dict[str, Any]:
    """Features of a case's screening, with the hidden truth, and refits of so many likely causes and of none."""
    study, subject = case.record(), subject_of(case.task)
    predictor = Predictor(subject, subject.catalogue())
    trials = prepare(study, subject)
    screening = screen(predictor, trials, refit(predictor, trials))
    trials = trials.with_ends(screening.ends)
    causes, table = features(screening)
    probabilities, _ = calibration().probabilities(screening)
    likeliest = sorted(screening.suspects, key=lambda suspect: -probabilities[suspect.cause])[:refits]
    models = {suspect.cause: refit_cause(predictor, trials, screening, suspect) for suspect in likeliest}
    nothing = refine(predictor, trials, screening, ()) if refits else None
    return {
        "world": world,
        "hidden": [[each.effect, each.size] for each in case.hidden],
        "task": case.task.name,
        "pushes": len(study.pushes),
        "causes": causes,
        "features": np.round(table, 5).tolist(),
        "refits": {
            suspect.cause: _refit_of(predictor, screening, suspect, models[suspect.cause]) for suspect in likeliest
        },
        "nothing": nothing and round(nothing.log_evidence - screening.weighing.log_evidence, 2),
        "further": _further_of(predictor, trials, screening, list(models.values())),
    }


def _refit_of(
    predictor: Predictor, screening: Screening, suspect: CandidateCause, model: RefinedModel
) -> dict[str, Any]:
    """Gain of a refitted cause over nothing."""
    rivals = rivals_of(predictor.catalogue, screening, suspect)
    return {
        **_gain_of(suspect, model, screening.weighing.log_evidence, (screening.data, screening.prior)),
        "held_out_of_linear": np.round(held_out_gain_of_linear(screening, suspect, rivals), 3).tolist(),
        "sized": is_sized(predictor.catalogue, model),
        "trust": model.trust,
    }


def _further_of(
    predictor: Predictor, trials: SimulationBatch, screening: Screening, models: Sequence[RefinedModel]
) -> dict[str, Any]:
    """Gain of a second cause beside the best refitted one; nothing where that is no likelier than nothing."""
    best = max(models, key=lambda model: model.log_evidence, default=None)
    if best is None or best.log_evidence < screening.weighing.log_evidence:
        return {}
    found = dict[str, Any]()
    for suspect in further_suspects(best)[:1]:
        both = with_further(predictor, trials, screening, best, suspect)
        gain = _gain_of(suspect, both, best.log_evidence, (best.data, best.prior))
        found = {"beside": best.causes[0], "cause": suspect.cause, **gain}
    return found


def _gain_of(
    suspect: CandidateCause, model: RefinedModel, without: float, simpler: tuple[Residuals, Prior]
) -> dict[str, Any]:
    """Evidence of a cause by its screening and its refit [nats], and gain of left-out episodes over a simpler model."""
    return {
        "linear": round(suspect.finding.log_bayes, 2),
        "log_bayes": round(model.log_evidence - without, 2),
        "held_out": np.round(held_out_gain(simpler, model), 3).tolist(),
    }


@final
@dataclass(frozen=True, kw_only=True, eq=False)
class Lines:
    """Studies as arrays: features (S, C, F), and truth (S, C + 1), with nothing hidden as the last column."""

    causes: tuple[str, ...]
    features: Float64[np.ndarray, "S C F"]
    true: Float64[np.ndarray, "S D"]
    worlds: tuple[World, ...]

    @classmethod
    def of(cls, read: Sequence[Mapping[str, Any]]) -> "Lines":
        """Studies that have all causes; an effect outside the catalogue counts as the unknown force."""
        causes = max((tuple(line["causes"]) for line in read), key=len)
        whole = [line for line in read if tuple(line["causes"]) == causes]
        true = np.zeros((len(whole), len(causes) + 1))
        for row, line in zip(true, whole, strict=True):
            at = [causes.index(name if name in causes else FORMULA) for name, _ in line["hidden"]]
            row[at or [-1]] = 1.0
        worlds = tuple(line["world"] for line in whole)
        return cls(causes=causes, features=np.array([line["features"] for line in whole]), true=true, worlds=worlds)

    def __len__(self) -> int:
        return len(self.features)


def learnt(known_lines: Lines, chosen: Sequence[int] | None = None, before: Calibration | None = None) -> Calibration:
    """The softmax that makes the hidden truth in the chosen studies most likely, with small weights.

    `before`: a table from which weights and biases go no farther than the studies ask for.
    """
    chosen = range(len(known_lines)) if chosen is None else chosen
    x, true = known_lines.features[list(chosen)], known_lines.true[list(chosen)]
    usual = np.sqrt((x**2).mean((0, 1))) + 1e-9 if before is None else before.usual
    z, width, count = x / usual, x.shape[2], x.shape[1]
    penalty = np.concatenate([np.full(width, _WEIGHT_PENALTY), np.full(count, _BIAS_PENALTY), [1e-3]])
    start = np.zeros(width + count + 1)
    if before is not None:
        penalty, start = _ON * penalty, _values_of(before, known_lines)

    def loss(values: Float64[np.ndarray, " V"]) -> tuple[float, Float64[np.ndarray, " V"]]:
        logs = log_softmax(_logits(z, values), axis=1)
        # Of two that are hidden either is right.
        right = np.where(true > 0, logs, -np.inf)
        total = np.logaddexp.reduce(right, axis=1)
        slope = np.exp(logs) - np.exp(right - total[:, None])
        weights = np.einsum("sc,scf->f", slope[:, :-1], z)
        gradient, gone = np.concatenate([weights, slope.sum(0)]), values - start
        return float(-total.sum() + 0.5 * (penalty * gone**2).sum()), gradient + penalty * gone

    found = minimize(loss, start, jac=True, method="L-BFGS-B", options={"maxiter": 1000}).x
    return Calibration(
        usual=usual,
        weights=found[:width],
        biases=dict(zip(known_lines.causes, found[width:-1].tolist(), strict=True)),
        nothing=float(found[-1]),
        studies=len(x) + (before.studies if before else 0),
    )


def _values_of(table: Calibration, known_lines: Lines) -> Float64[np.ndarray, " V"]:
    """Weights, biases and the bias of nothing, in the order in which they are learnt."""
    usual = float(np.mean(list(table.biases.values())))  # Of a cause that is new.
    biases = [table.biases.get(cause, usual) for cause in known_lines.causes]
    return np.concatenate([table.weights, biases, [table.nothing]])


def _logits(z: Float64[np.ndarray, "S C F"], values: Float64[np.ndarray, " V"]) -> Float64[np.ndarray, "S D"]:
    width = z.shape[2]
    causes = z @ values[:width] + values[width:-1]
    return np.concatenate([causes, np.full((len(z), 1), values[-1])], axis=1)


def said(table: Calibration, known_lines: Lines) -> Float64[np.ndarray, "S D"]:
    """The probabilities of each study's causes, and of nothing."""
    return softmax(_logits(known_lines.features / table.usual, _values_of(table, known_lines)), axis=1)


def left_out(known_lines: Lines, before: Calibration | None = None) -> Float64[np.ndarray, "S D"]:
    """Cross-validated probabilities: of each study by what was learnt from the other tenths."""
    fold = np.random.default_rng(0).integers(0, FOLDS, len(known_lines))
    found = np.zeros_like(known_lines.true)
    for number in range(FOLDS):
        own = fold == number
        found[own] = said(learnt(known_lines, np.flatnonzero(~own).tolist(), before), known_lines)[own]
    return found


def of_other_worlds(known_lines: Lines, before: Calibration | None = None) -> Float64[np.ndarray, "S D"]:
    """Probabilities of each study by what was learnt in the other worlds."""
    worlds = np.array(known_lines.worlds)
    found = np.zeros_like(known_lines.true)
    for world in np.unique(worlds):
        own = worlds == world
        found[own] = said(learnt(known_lines, np.flatnonzero(~own).tolist(), before), known_lines)[own]
    return found


def main(
    path: tyro.conf.Positional[Path],
    /,
    *,
    studies: Annotated[int, tyro.conf.arg(help="to have at the end")] = 0,
    seed: Annotated[int, tyro.conf.arg(help="of what is drawn")] = 0,
    workers: Annotated[int, tyro.conf.arg(help="processes")] = os.cpu_count() or 1,
    refits: Annotated[int, tyro.conf.arg(help="likeliest causes that are refitted, too")] = 0,
    many: Annotated[bool, tyro.conf.arg(help="studies of 80 to 400 pushes instead of 20 to 100")] = False,
    before: Annotated[Path | None, tyro.conf.arg(help="a table to learn on from, learnt from other studies")] = None,
    table: Annotated[Path | None, tyro.conf.arg(help="where to write what is learnt, as JSON")] = None,
) -> None:
    """Run the missing studies, learn from all of them, and print the reliability."""
    terminal = Console()
    done = {(line["seed"], line["number"]) for line in lines(path)} if path.exists() else set[tuple[int, int]]()
    missing = [number for number in range(studies) if (seed, number) not in done]
    with (
        ProcessPoolExecutor(workers, mp_context=get_context("spawn")) as pool,
        path.open("a", encoding="utf-8") as file,
    ):
        made = [pool.submit(_line, (seed, number), refits, many=many) for number in missing]
        for future in track(as_completed(made), "studies", total=len(made), console=terminal, disable=not made):
            file.write(json.dumps(future.result()) + "\n")
            file.flush()
    known_lines = Lines.of([line for line in lines(path) if "features" in line])
    known = None if before is None else calibration_in(before)
    terminal.print(_shown(left_out(known_lines, known), known_lines, "each left out of what was learnt"))
    if len(set(known_lines.worlds)) > 1:
        elsewhere = of_other_worlds(known_lines, known)
        terminal.print(_shown(elsewhere, known_lines, "each by what was learnt in other worlds"))
    terminal.print(_resolution(known_lines))
    if table is not None:
        made_of = learnt(known_lines, before=known)
        table.write_text(json.dumps(_told(made_of), indent=1) + "\n", encoding="utf-8")


def _line(order: tuple[int, int], refits: int, *, many: bool) -> dict[str, Any]:
    seed, number = order
    try:
        found = studied(*drawn(seed, number, many=many), refits)
    except (SimulationError, ValueError) as error:  # A world became unstable, or a rod left what it can simulate.
        found = {"failure": str(error)}
    return {"seed": seed, "number": number, **found}


def _resolution(known_lines: Lines) -> Table:
    """Standard error of each cause in a study of 100 random pushes, and pushes that a confident name would take.

    From the Fisher information about a cause with all nuisances and habits projected out, the median over studies.
    """
    rods = catalogue(subject_of(load("rope_push@rods")).rods)
    shown = Table(title="Resolution: typical sizes are told from nothing at four standard errors")
    for heading in ("cause", *WORLDS, "pushes for four standard errors, of a typical size"):
        shown.add_column(heading)
    log_det, log_pushes = (
        known_lines.features.reshape(*known_lines.features.shape[:2], 2, -1).sum(2)[:, :, column].T
        for column in (_LOG_DETERMINANT, _LOG_PUSHES)
    )
    for cause, logs, pushes in zip(known_lines.causes, log_det, np.exp(log_pushes), strict=True):
        if cause == FORMULA:
            continue
        each = np.expm1(2 * logs / rods.cause(cause).switches) / pushes
        errors = {world: 1 / np.sqrt(100 * np.median(each[np.array(known_lines.worlds) == world])) for world in WORLDS}
        worst = max(errors.values())
        shown.add_row(cause, *(f"{error:.2f}" for error in errors.values()), f"{100 * (_SURE * worst) ** 2:.0f}")
    return shown


def _told(table: Calibration) -> dict[str, Any]:
    return {
        "studies": table.studies,
        "usual": np.round(table.usual, 5).tolist(),
        "weights": np.round(table.weights, 5).tolist(),
        "biases": {cause: round(bias, 4) for cause, bias in table.biases.items()},
        "nothing": round(table.nothing, 4),
    }


def _shown(found: Float64[np.ndarray, "S D"], known_lines: Lines, by: str) -> Table:
    """Table of the reliability of stated probabilities, and of the rate of named causes."""
    shown = Table(title=f"{len(known_lines)} drawn studies, {by}")
    for heading in ("said", "studies", "mean", "right, with Wilson's 95 % interval"):
        shown.add_column(heading)
    likeliest = found.argmax(1)
    right = known_lines.true[np.arange(len(found)), likeliest] > 0
    for low, high in pairwise(_EDGES):
        own = (found.max(1) > low) & (found.max(1) <= high)
        if own.any():
            rate, mean = share(right[own].tolist()), f"{found.max(1)[own].mean():.2f}"
            interval = f"{rate.value:.2f} ({rate.low:.2f} to {rate.high:.2f})"
            shown.add_row(f"{low:.1f} to {high:.1f}", str(own.sum()), mean, interval)
    named = [n for n, cause in enumerate(known_lines.causes) if cause != FORMULA]
    names = np.isin(likeliest, named)
    sure = names & (found.max(1) > NAMED)
    nothing = known_lines.true[:, named].sum(1) == 0
    for text, own in (("a cause was hidden", ~nothing), ("none of the catalogue was", nothing)):
        wrong, named = int((sure & ~right)[own].sum()), int((sure & right)[own].sum())
        shown.add_row(text, str(own.sum()), "", f"named above {NAMED}: {named} right, {wrong} wrong")
    return shown


if __name__ == "__main__":
    tyro.cli(main)
