"""Discovery of the real rope, simulated as a rod: `python -m bench.real_discovery`, some minutes of a core.

For each of the eight pushes the whole chain runs on the seven others: the simulator's nominal model, the same refitted,
and the likeliest cause with it; all three predict the push that was left out. Then: what the chain says of all eight,
and why; what eight pushes say of the gripper, whose width, yaw and offset nobody recorded; and known errors that are
put into these recordings and have to be found again. docs/real-data.md has what came out.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Final, NamedTuple, final

import numpy as np
import tyro
from jaxtyping import Float64
from rich.console import Console
from rich.table import Table
from scipy.stats import qmc
from threadpoolctl import threadpool_limits

from app.commands._named import full_name
from app.core.types import Points
from app.discovery.dataset.model_under_test import Subject
from app.discovery.dataset.study import Study
from app.discovery.inference.decide import NAMED, is_sized
from app.discovery.inference.held_out import held_out_gain
from app.discovery.pipeline import Conclusion, Judged, Stages, conclude, judge
from app.discovery.residuals.simulation_batch import SimulationBatch, prepare
from app.discovery.results.case import CauseResult
from app.discovery.results.gain import error_mm
from app.discovery.results.verdict import ranking_of
from app.discovery.unexplained.formula import UnexplainedForce
from app.discovery.unexplained.residual_test import ResidualTest
from app.jobs.discovery_subject import doubted_in
from app.tasks import load
from bench import real_pushes
from bench.hidden.known_errors import with_error
from bench.leave_one_out import paired
from bench.real_pushes import AXES, TASSELS
from bench.real_rope import chamfer_mm, read_pushes
from bench.rope_pushes import FOLDER, Recorded, recorded_pushes

GRIPPER: Final = ("offset_x", "offset_y", "half_width", "yaw")
"""Parameters of the gripper that were not recorded."""
FREE: Final = ("bend", "finger_friction", "reach", *GRIPPER)
MODELS: Final = 4096
"""Sobol points in the box of `FREE`, for each weight of tassels."""
KNOWN: Final[tuple[tuple[str, tuple[float, ...]], ...]] = (
    ("tcp_offset", (0.008, 0.0, 0.0)),
    ("tcp_offset", (0.0, -0.008, 0.0)),
    ("tcp_offset", (0.015, 0.0, 0.0)),
    ("tcp_offset", (0.0, 0.015, 0.0)),
    ("hand_eye_translation", (0.0, 0.008, 0.0)),
    ("depth_scale", (0.02,)),
    ("mask_erosion", (0.003,)),
)
"""Errors that are put into the recordings. None has to do with times: those of a push were not recorded."""
_NOT_LOOKED_FOR: Final = UnexplainedForce(ResidualTest(probability=0.0, by_chance=1.0), None)
_LISTED: Final = 4
_TOLD: Final = 0.7
"""An interval that is wider than this share of its prior's tells nothing."""
_DOUBT: Final = 0.1


@final
@dataclass(frozen=True, kw_only=True, eq=False)
class Investigated:
    """Verdict of the pipeline on a study, and the intermediate results behind it."""

    found: Judged
    conclusion: Conclusion
    ranking: tuple[CauseResult, ...]

    @property
    def said(self) -> str:
        """The verdict, and why none is named where none is."""
        if self.conclusion.verdict != "none":
            return f"{self.conclusion.verdict}: {', '.join(self.conclusion.names)}"
        return f"none: {'; '.join(self._reasons())}"

    def _reasons(self) -> Iterator[str]:
        decision, screened = self.found.decision, self.found.screening
        yield from (limit.text for limit in self.conclusion.limits if limit.fatal)
        best, nothing = decision.singles[0], decision.nothing
        held = decision.held or held_out_gain((screened.data, screened.prior), best)
        if nothing >= _DOUBT:
            yield f"nothing missing has {nothing:.0%}, and no name is given above {_DOUBT:.0%}"
        if held.gain <= 2 * held.error:
            yield (
                f"with {best.causes[0]} pushes left out are likelier by {held.gain:.1f} +- {held.error:.1f} nats, "
                f"which is less than two standard errors"
            )
        if not is_sized(self.found.predictor.catalogue, best):
            yield f"the size of {best.causes[0]} is at the end of its range, or may be none"
        if decision.accepted is not None and self.conclusion.model is None:  # It predicted worse in use.
            yield from (limit.text for limit in self.conclusion.limits if limit not in self.found.limits)


class Errors(NamedTuple):
    """Errors on a push of three models fitted to the others, and of no motion: displacement and Chamfer [mm]."""

    displacement: Float64[np.ndarray, "4"]
    chamfer: Float64[np.ndarray, "4"]
    cause: str


@threadpool_limits.wrap(limits=1, user_api="blas")
def investigated(study: Study, subject: Subject) -> Investigated:
    """The chain as `dipac discover` has it, but for forces of no cause."""
    found = judge(study, subject, Stages(lambda _: None))
    return Investigated(
        found=found,
        conclusion=conclude(found, _NOT_LOOKED_FOR),
        ranking=ranking_of(found.predictor.catalogue, subject, found.screening, found.decision),
    )


@threadpool_limits.wrap(limits=1, user_api="blas")
def left_out(study: Study, subject: Subject) -> list[Errors]:
    """Each push by models of which nothing was chosen by it."""
    found = list[Errors]()
    for k, push in enumerate(study.pushes):
        rest = replace(study, pushes=tuple(other for other in study.pushes if other is not push))
        found_in_rest = judge(rest, subject, Stages(lambda _: None))
        predictor, decision = found_in_rest.predictor, found_in_rest.decision
        extended = (decision.accepted or decision.singles[0]).estimate  # By the likeliest cause, accepted or not.
        models = [predictor.catalogue.nominal(subject), found_in_rest.about, extended]
        own = prepare(replace(study, pushes=(push,)), subject)
        ends = [*predictor(own, models).after[:, 0], push.before.points]
        cause = decision.singles[0].causes[0]
        displacement, chamfer = np.array([_errors(own, end) for end in ends]).T
        found.append(Errors(displacement, chamfer, cause))
        print(f"push {k + 1}: {cause}, {np.round(found[-1].chamfer, 1).tolist()}", flush=True)
    return found


def _errors(trials: SimulationBatch, end: Points) -> tuple[float, float]:
    return error_mm(trials, 0, end), chamfer_mm(end, trials.observed.after[0])


@final
@dataclass(frozen=True, kw_only=True)
class Told:
    """An unknown of the gripper: its mean and 90 % interval by the pushes, and the interval of its prior."""

    name: str
    mean: float
    low: float
    high: float
    prior: tuple[float, float]

    def __str__(self) -> str:
        """Text in plain numbers, millimetres or degrees."""
        by, unit = (np.degrees(1.0), "degrees") if AXES[self.name].unit == "rad" else (1e3, "mm")
        a, b = (by * end for end in self.prior)
        name = self.name.replace("_", " ")
        interval = f"90 %: {by * self.low:.0f} to {by * self.high:.0f}"
        if self.high - self.low > _TOLD * (self.prior[1] - self.prior[0]):
            return f"{name} cannot be told: {interval} {unit}, of a prior of {a:.0f} to {b:.0f}"
        return f"{name} {by * self.mean:.1f} {unit} ({interval}), of a prior of {a:.0f} to {b:.0f}"


def gripper(pushes: Sequence[Recorded], models: int) -> tuple[list[Told], float]:
    """Posteriors of `GRIPPER` from all pushes with the rod's own numbers free, and the effective number of models."""
    real = real_pushes.real_pushes(list(pushes))
    pool = qmc.Sobol(len(FREE), rng=np.random.default_rng(0)).random(models)
    values = np.stack([AXES[name].value(pool[:, column]) for column, name in enumerate(FREE)], axis=1)
    sums = np.stack([real_pushes.Rope(real, tassels).scores(values, FREE).mm2.sum(1) for tassels in TASSELS])
    weights = np.exp(-0.5 * (sums - sums.min()) * len(real) / sums.min()).sum(0)
    weights /= weights.sum()
    told = list[Told]()
    for name in GRIPPER:
        column, axis = values[:, FREE.index(name)], AXES[name]
        order = np.argsort(column)
        low, high = np.interp([0.05, 0.95], np.cumsum(weights[order]), column[order])
        ends = float(axis.value(np.array(0.05))), float(axis.value(np.array(0.95)))
        told.append(Told(name=name, mean=float(weights @ column), low=float(low), high=float(high), prior=ends))
    return told, float(1 / (weights**2).sum())


def put_back(study: Study, subject: Subject, plain: Investigated) -> Iterator[tuple[str, ...]]:
    """Rows: an injected error, the pipeline's verdict, and its estimate less that without the error."""
    for effect, values in KNOWN:
        known = investigated(with_error(study, effect, np.array(values)), subject)
        rank = [blame.effect for blame in known.ranking].index(effect) + 1
        before, after = (_sizes(each, effect) for each in (plain, known))
        put = " ".join(f"{value:g}" for value in values)
        difference = " ".join(f"{b - a:.4f}" for a, b in zip(before.values(), after.values(), strict=True))
        first = known.ranking[0]
        yield f"{effect} {put}", f"{first.effect} {first.probability:.2f}", str(rank), difference, known.said


def _sizes(known: Investigated, effect: str) -> Mapping[str, float]:
    blame = next(blame for blame in known.ranking if blame.effect == effect)
    return {it.name: it.value for it in blame.estimates}


def main(
    folder: Annotated[Path, tyro.conf.arg(help="where push_NN.npz are")] = FOLDER,
    models: Annotated[int, tyro.conf.arg(help="of the gripper and the rod, a power of two")] = MODELS,
    errors: Annotated[bool, tyro.conf.arg(help="put known errors into the recordings, too")] = True,
) -> None:
    """Print what discovery makes of eight real pushes."""
    if not folder.is_dir():
        print(f"Nothing to measure: the pushes are not in {folder}.")
        return
    console, pushes = Console(width=170, highlight=False), recorded_pushes(folder)
    study = read_pushes(pushes)
    subject = doubted_in(study, load(full_name(study.task, dynamics=None))).subject
    plain = investigated(study, subject)
    console.print(f"All {len(study.pushes)} pushes as {study.task}: {plain.said}")
    for blame in plain.ranking[:_LISTED]:
        sizes = ", ".join(
            f"{it.name} {it.value:.3g} ({it.low:.3g} to {it.high:.3g}) {it.unit}" for it in blame.estimates
        )
        console.print(f"  {blame.effect} {blame.probability:.2f}, {blame.log_bayes:.1f} nats: {sizes}")
    console.print(f"  (named above {NAMED}; nothing missing {plain.found.decision.nothing:.2f})")
    told, count = gripper(pushes, models)
    console.print(f"The gripper, by {count:.0f} of {models} models:", *map(str, told), sep="\n  ")
    console.print(_shown(left_out(study, subject), pushes))
    if errors:
        table = Table("put in", "first", "rank of it", "its size, less without", "verdict", title="Known errors put in")
        for row in put_back(study, subject, plain):
            table.add_row(*row)
        console.print(table)


def _shown(found: Sequence[Errors], pushes: Sequence[Recorded]) -> Table:
    """Errors on pushes left out, by model."""
    table = Table(title="Errors on the push left out, mm")
    names = "model", "displacement", "share of no motion", "Chamfer", "share of no motion", "gain on refitted (90 %)"
    for heading in (*names, "Chamfer of each push"):
        table.add_column(heading)
    moved, flat = (np.array([getattr(each, name) for each in found]) for name in ("displacement", "chamfer"))
    for row, name in enumerate(("nominal", "refitted", "extended by the likeliest cause", "no motion")):
        gain = paired(flat[:, row], flat[:, 1])
        table.add_row(
            name,
            f"{moved[:, row].mean():.1f}",
            f"{moved[:, row].mean() / moved[:, 3].mean():.0%}",
            f"{flat[:, row].mean():.1f}",
            f"{flat[:, row].mean() / flat[:, 3].mean():.0%}",
            f"{gain.mean:.1f} ({gain.low:.1f} to {gain.high:.1f}), {gain.better} of {len(found)}",
            " ".join(f"{error:.1f}" for error in flat[:, row]),
        )
    causes = [f"{push.name}: {each.cause}" for push, each in zip(pushes, found, strict=True)]
    table.caption = "Likeliest cause by the other seven: " + ", ".join(causes)
    return table


if __name__ == "__main__":
    tyro.cli(main)
