"""Direct checks: what finger, table and log say before anything is simulated, each with an interval over episodes."""

from collections.abc import Callable

import numpy as np
from jaxtyping import Float64
from scipy.stats import t as student

from app.discovery.dataset.model_under_test import Theta
from app.discovery.residuals.direct_measurements import direct_rows, row_of
from app.discovery.residuals.predict import Predictor
from app.discovery.residuals.sensitivity import change_of, switch_of
from app.discovery.residuals.simulation_batch import SimulationBatch
from app.discovery.results.case import Estimate

_ARM_M = 0.3
"""Lever arm of the table's slopes, as in `direct`."""
_DEGREE = np.pi / 180


def direct_checks(predictor: Predictor, trials: SimulationBatch, about: Theta) -> tuple[Estimate, ...]:
    """Direct checks that these recordings allow; the arm's log and the finger against the model's arm and cameras."""
    catalogue = predictor.catalogue
    asked = ("command_delay", "under_reach", "camera_time_offset")
    steps = [switch_of(catalogue, catalogue.cause(name), catalogue.cause(name).columns[0]) for name in asked]
    rows = direct_rows(predictor, trials, about, [change_of(catalogue, about, step) for step in steps])
    episode = np.array([push.episode for push in trials.study.pushes])
    finger, table, log, girth = (row_of(kind) for kind in ("finger", "table", "log", "girth"))

    def of(values: Float64[np.ndarray, " K"], seen: Float64[np.ndarray, " K"]) -> Float64[np.ndarray, " E"]:
        chosen = seen > 0
        numbers = np.unique(episode[chosen])
        return np.array([np.median(values[chosen & (episode == number)]) for number in numbers])

    def slope(block: slice, column: int) -> Float64[np.ndarray, " K"]:
        J, r = rows.J[:, block, column], rows.r[:, block]
        return (J * r).sum(1) / np.maximum((J**2).sum(1), 1e-12) * steps[column].size

    kinds = {"f": finger, "t": table, "l": log, "g": girth}
    seen = {name: rows.known[:, block].any(1).astype(float) for name, block in kinds.items()}
    makers: list[tuple[str, str, str, str, Callable[[], Float64[np.ndarray, " K"]]]] = [
        ("arm's delay", "By how much the arm's own log is behind its command.", "s", "l", lambda: slope(log, 0)),
        (
            "arm's under-reach",
            "The share of its way that the arm's log says is missing.",
            "1",
            "l",
            lambda: slope(log, 1),
        ),
        ("camera's clock", "By how much the seen tool is ahead of its stamp.", "s", "f", lambda: slope(finger, 2)),
    ]
    for axis, name in enumerate("xyz"):
        about_it = f"Where the cameras see the tool against where the arm says it is, along {name}."
        # Seen from above, points of a tool's surface say nothing of how low it is.
        seen[f"f{name}"] = rows.known[:, finger][:, axis].astype(float)
        makers.append((f"tool, {name}", about_it, "m", f"f{name}", lambda axis=axis: rows.r[:, finger][:, axis]))
    makers.append(
        ("table's height", "Of the bare table as seen, above z = 0.", "m", "t", lambda: rows.r[:, table][:, 0])
    )
    for axis, name in ((1, "x"), (2, "y")):
        about_it = f"How much the bare table seems to rise along {name}."
        makers.append(
            (
                f"table's slope, {name}",
                about_it,
                "deg",
                "t",
                lambda axis=axis: rows.r[:, table][:, axis] / _ARM_M / _DEGREE,
            )
        )
    makers.append(
        (
            "object's girth",
            "Of half of its points about its middle line, more than that of its radius.",
            "m",
            "g",
            lambda: rows.r[:, girth][:, 0],
        )
    )
    checks = list[Estimate]()
    for name, about_it, unit, kind, values in makers:
        found = of(values(), seen[kind])
        if len(found):
            checks.append(_check(name, about_it, unit, found))
    return tuple(checks)


def _check(name: str, about: str, unit: str, values: Float64[np.ndarray, " E"]) -> Estimate:
    """The mean over episodes; with one alone nothing is known of its error."""
    middle = float(values.mean())
    count = len(values)
    half = float(student.ppf(0.95, count - 1) * values.std(ddof=1) / np.sqrt(count)) if count > 1 else abs(middle)
    return Estimate(name=name, about=about, value=middle, low=middle - half, high=middle + half, null=0.0, unit=unit)
