"""Direct checks: what finger, table and log say before anything is simulated, each with an interval over episodes."""

from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float64
from scipy.stats import t as student

from app.discovery.dataset.model_under_test import Theta
from app.discovery.residuals.direct_measurements import LEAST_M, direct_rows, row_of
from app.discovery.residuals.predict import Predictor
from app.discovery.residuals.sensitivity import change_of, switch_of
from app.discovery.residuals.simulation_batch import SimulationBatch
from app.discovery.results.case import Estimate

_ARM_M = 0.3
"""Lever arm of the table's slopes, as in `direct`."""
_DEGREE = np.pi / 180


class Taken(NamedTuple):
    """A quantity as measured: the median of each episode in which it was seen, and the least error that any has."""

    values: Float64[np.ndarray, " E"]
    least: float


def direct_checks(predictor: Predictor, trials: SimulationBatch, about: Theta) -> tuple[Estimate, ...]:
    """Direct checks that these recordings allow; the arm's log and the finger against the model's arm and cameras."""
    catalogue = predictor.catalogue
    asked = ("command_delay", "under_reach", "camera_time_offset")
    steps = [switch_of(catalogue, catalogue.cause(name), catalogue.cause(name).columns[0]) for name in asked]
    rows = direct_rows(predictor, trials, about, [change_of(catalogue, about, step) for step in steps])
    episode = np.array([push.episode for push in trials.study.pushes])

    def of(values: Float64[np.ndarray, " K"], seen: Bool[np.ndarray, " K"]) -> Float64[np.ndarray, " E"]:
        return np.array([np.median(values[seen & (episode == number)]) for number in np.unique(episode[seen])])

    def slope(kind: str, column: int) -> Taken:
        """Size of a cause by the rows of a kind; its least is what their least error makes of it, were it one way."""
        J, r, seen = (
            rows.J[:, row_of(kind), column],
            rows.r[:, row_of(kind)],
            np.any(rows.known[:, row_of(kind)], axis=1),
        )
        size, square = steps[column].size, np.maximum((J**2).sum(1), 1e-12)
        rms = float(np.sqrt((J[seen] ** 2).mean())) if seen.any() else 0.0
        return Taken(of((J * r).sum(1) / square * size, seen), LEAST_M[kind] * size / rms if rms > 0 else 0.0)

    def row(kind: str, number: int, unit: float = 1.0) -> Taken:
        values, seen = rows.r[:, row_of(kind)][:, number], rows.known[:, row_of(kind)][:, number]
        return Taken(of(values / unit, seen), LEAST_M[kind] / unit)

    tool = "Where the cameras see the tool against where the arm says it is, along"
    girth = "Of half of its points about its middle line, more than that of its radius."
    checks = [
        ("arm's delay", "By how much the arm's own log is behind its command.", "s", slope("log", 0)),
        ("arm's under-reach", "The share of its way that the arm's log says is missing.", "1", slope("log", 1)),
        ("camera's clock", "By how much the seen tool is ahead of its stamp.", "s", slope("finger", 2)),
        *((f"tool, {name}", f"{tool} {name}.", "m", row("finger", axis)) for axis, name in enumerate("xyz")),
        ("table's height", "Of the bare table as seen, above z = 0.", "m", row("table", 0)),
        *(
            (f"table's slope, {name}", f"How much the bare table seems to rise along {name}.", "deg", risen)
            for name, risen in (("x", row("table", 1, _ARM_M * _DEGREE)), ("y", row("table", 2, _ARM_M * _DEGREE)))
        ),
        ("object's girth", girth, "m", row("girth", 0)),
    ]
    return tuple(_check(name, told, unit, taken) for name, told, unit, taken in checks if len(taken.values))


def _check(name: str, about: str, unit: str, taken: Taken) -> Estimate:
    """The mean over episodes, with an interval that holds the least error; of one alone no error is known."""
    values, count = taken.values, len(taken.values)
    middle = float(values.mean())
    half = float(student.ppf(0.95, count - 1) * values.std(ddof=1) / np.sqrt(count)) if count > 1 else abs(middle)
    half = float(np.hypot(half, taken.least))
    return Estimate(name=name, about=about, value=middle, low=middle - half, high=middle + half, null=0.0, unit=unit)
