"""The real rope: what the simulator gets wrong in eight pushes of it, each predicted by models fitted to the others.

`python -m bench.real_rope --help`. docs/real-data.md has what came out, and what eight pushes cannot say.
"""

import tempfile
from collections.abc import Collection, Iterable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Final, NamedTuple, final

import numpy as np
import tyro
from jaxtyping import Float64
from scipy.spatial import KDTree

from app.commands.import_ import import_
from app.core.errors import UsageError
from app.core.geometry.chamfer import chamfer_m2
from app.core.types import Points
from app.discovery.dataset.model_under_test import Catalogue, Cause, Theta, catalogue
from app.discovery.dataset.study import Study
from app.discovery.residuals.predict import Predictor
from app.discovery.residuals.sensitivity import Step, apply_step
from app.discovery.residuals.simulation_batch import SimulationBatch, prepare
from app.services.study import read_study
from app.sim.tools.finger import FingerCollider
from bench.leave_one_out import Fitted, Place, chosen, descend, folds, loss, paired, placed
from bench.rope_pictures import picture
from bench.rope_pushes import FOLDER, Recorded, real_rope, recorded_pushes, write_plain

IMAGES: Final = Path(__file__).parents[1] / "docs" / "images"
PHYSICS: Final = ("stiffness", "table_friction")
TOOL: Final = ("tool_radius", "tcp_x", "tcp_y")
CAUSES: Final = (
    "mask_erosion",
    "hand_eye_rotation",
    "stiffness_heterogeneity",
    "friction_anisotropy",
    "finger_friction",
)
"""Causes that might widen a rope, rotate its motion, or keep a free end straight."""
_FACTOR = 0.4
"""A step of stiffness and of friction, in a logarithm."""
_STEP_M = 0.003
"""Lattice step of the tool's radius and of its offset."""
_PLACE_M = 0.03
_WIDEST_M = 0.03
_MM = 1e3
_ROUNDS = 12
_REFITTED = 5
"""Causes that are refitted together with friction and stiffness: the best few after one step of each."""


class Row(NamedTuple):
    """A line of the table: errors of each push (K,), in mm and mm^2, and how they are got."""

    name: str
    chamfer_mm: Float64[np.ndarray, " K"]
    chamfer_mm2: Float64[np.ndarray, " K"]


class Predicted(NamedTuple):
    """Predictions of a model for each push: particles after it (K, N, 3) [m], and its errors [mm] and [mm^2] (K,)."""

    after: Points
    chamfer_mm: Float64[np.ndarray, " K"]
    chamfer_mm2: Float64[np.ndarray, " K"]


@final
class Rope:
    """The pushes, and every model of a lattice about the task's own. Keeps what was predicted."""

    def __init__(self, study: Study, pushes: Sequence[Recorded]) -> None:
        self.study, self.catalogue = study, catalogue()
        self.subject = real_rope(list(pushes))
        self.trials = prepare(study, self.subject)
        self._predictor = Predictor(self.subject, self.catalogue)
        self._nominal = self.catalogue.nominal(self.subject)
        self._known = dict[Place, Predicted]()

    def errors(self, places: Sequence[Place]) -> Float64[np.ndarray, "Q K"]:
        """The Chamfer distance [mm] of each model on each push."""
        self._predict(place for place in places if place not in self._known)
        return np.stack([self._known[place].chamfer_mm for place in places])

    def __getitem__(self, place: Place) -> Predicted:
        self._predict([] if place in self._known else [place])
        return self._known[place]

    def theta(self, place: Place) -> Theta:
        """The values of a place's parameters, as far as they are not the tool's radius."""
        theta = self._nominal.copy()
        for name, count in place:
            if name != "tool_radius":
                theta = apply_step(self.catalogue, theta, _step(self.catalogue, name), float(count))
        return theta

    def radius_m(self, place: Place) -> float:
        """The tool's radius there."""
        (finger,) = self.subject.scene.tools
        assert isinstance(finger, FingerCollider)
        return float(np.clip(finger.radius_m + _STEP_M * dict(place).get("tool_radius", 0), _STEP_M, _WIDEST_M))

    def still(self) -> Predicted:
        """Prediction of no motion."""
        return _compared(self.trials, np.stack([push.before.points for push in self.study.pushes]))

    def _predict(self, places: Iterable[Place]) -> None:
        by_radius = dict[float, list[Place]]()
        for place in dict.fromkeys(places):
            by_radius.setdefault(self.radius_m(place), []).append(place)
        for radius, group in by_radius.items():
            (finger,) = self.subject.scene.tools
            assert isinstance(finger, FingerCollider)
            scene = replace(self.subject.scene, tools=(replace(finger, radius_m=radius),))
            subject = replace(self.subject, scene=scene)
            found = self._predictor(self.trials, [self.theta(place) for place in group], subject=subject).after
            self._known |= {place: _compared(self.trials, after) for place, after in zip(group, found, strict=True)}


def read_pushes(pushes: Sequence[Recorded]) -> Study:
    """The pushes by way of the plain import format and a recording, as a user would bring them."""
    with tempfile.TemporaryDirectory() as folder:
        plain, recording = Path(folder) / "real_rope.npz", Path(folder) / "real_rope.mcap"
        write_plain(list(pushes), plain)
        import_(plain, output=recording)
        return read_study([recording])


def chamfer_mm(x: Points, y: Points) -> float:
    """Distance of clouds from above [mm]: the mean of both directions' mean distances to the nearest point."""
    a, b = x[:, :2], y[:, :2]
    return _MM * float(KDTree(b).query(a)[0].mean() + KDTree(a).query(b)[0].mean()) / 2


def fitted_tool(rope: Rope) -> tuple[Fitted, Fitted]:
    """The nominal model with friction and stiffness, and with the unknown tool, too."""
    train = folds(len(rope.trials))
    begun = Fitted(places=((),) * len(train), train=train)
    nominal = descend(rope.errors, begun, PHYSICS, _ROUNDS)
    return nominal, descend(rope.errors, nominal, (*PHYSICS, *TOOL), _ROUNDS)


def screened(rope: Rope, start: Fitted, only: Collection[str]) -> dict[str, Fitted]:
    """Best change of each cause and fold: none, or one typical size either way, wherever it may be."""
    changes = {
        cause.name: _changes(rope, cause)
        for cause in rope.catalogue.causes
        if cause.family != "numerics" and cause.name in only
    }
    tried = {
        name: {fold: [place, *(_joined(place, change) for change in own)] for fold, place in enumerate(start.places)}
        for name, own in changes.items()
    }
    # All in one batch; what follows finds them known.
    rope.errors([place for by_fold in tried.values() for places in by_fold.values() for place in places])
    return {
        name: Fitted(places=tuple(chosen(rope.errors, by_fold, start.train).values()), train=start.train)
        for name, by_fold in tried.items()
    }


def refitted(rope: Rope, found: dict[str, Fitted], rounds: int) -> dict[str, Fitted]:
    """The same, those that any fold finds best refined together with friction and stiffness."""
    better = dict(found)
    wanted = {name for fold in range(len(rope.trials) + 1) for name in _ranked(rope, found, fold)[:_REFITTED]}
    for name in sorted(wanted):
        axes = [rope.catalogue.specs[column].name for column in rope.catalogue.cause(name).columns]
        better[name] = descend(rope.errors, found[name], (*PHYSICS, *axes), rounds)
    return better


def best_on_the_others(rope: Rope, found: dict[str, Fitted]) -> tuple[Fitted, list[str]]:
    """Models of each fold with the cause that is best on its own pushes, not on the push that is left out."""
    train = next(iter(found.values())).train
    names = [_ranked(rope, found, fold)[0] for fold in range(len(train))]
    return Fitted(places=tuple(found[name].places[fold] for fold, name in enumerate(names)), train=train), names


def _ranked(rope: Rope, found: dict[str, Fitted], fold: int) -> list[str]:
    def own(name: str) -> float:
        fitted = found[name]
        return loss(rope.errors([fitted.places[fold]])[0], fitted.train[fold])

    return sorted(found, key=own)


def _changes(rope: Rope, cause: Cause) -> list[dict[str, int]]:
    """Two half steps of each switch either way, at each place where a cause that has one is asked about."""
    specs = rope.catalogue.specs
    switches = [specs[column].name for column in cause.columns[: cause.switches]]
    ways = [{name: side * 2} for name in switches for side in (-1, 1)]
    if not cause.placed:
        return ways
    seen = np.concatenate([push.before.points[:, :2] for push in rope.study.pushes])
    places = list[dict[str, int]]()
    for x in np.quantile(seen[:, 0], [0.25, 0.75]):
        steps = dict[str, int]()
        for column, value in zip(cause.columns[cause.switches :], (x, np.median(seen[:, 1])), strict=True):
            spec = specs[column]
            steps[spec.name] = round((float(value) - spec.nominal) / _PLACE_M)
        places.append(steps)
    return [way | at for way in ways for at in places]


def _joined(place: Place, change: dict[str, int]) -> Place:
    here = dict(place)
    return placed(here | {name: here.get(name, 0) + count for name, count in change.items()})


def _step(known: Catalogue, name: str) -> Step:
    """Lattice step of a parameter: half of its typical size."""
    column = known.column(name)
    spec = known.specs[column]
    if name in PHYSICS:
        size = _FACTOR
    elif name in TOOL:
        size = _STEP_M
    elif spec.typical is None:
        size = _PLACE_M if spec.unit == "m" else 0.1 * (spec.coordinate(spec.high) - spec.coordinate(spec.low))
    else:
        size = (spec.coordinate(spec.typical) - spec.coordinate(spec.nominal)) / 2
    return Step(cause=name, column=column, size=size, sides=2)


def _compared(trials: SimulationBatch, after: Points) -> Predicted:
    pairs = list(zip(after, trials.observed.after, strict=True))
    whole = [np.isfinite(cloud).all() for cloud, _ in pairs]
    flat = [chamfer_mm(*pair) if fine else np.nan for pair, fine in zip(pairs, whole, strict=True)]
    squared = [float(_MM**2 * chamfer_m2(*pair)) if fine else np.nan for pair, fine in zip(pairs, whole, strict=True)]
    return Predicted(after, np.array(flat), np.array(squared))


def main(folder: Path = FOLDER, images: Path = IMAGES, causes: tuple[str, ...] = CAUSES, refit: int = 0) -> None:
    """Fit, predict the push left out, print the tables, draw each push into `images`: half an hour on two cores.

    `causes`: those of the catalogue that are tried beside the tool, at one typical size either way; `refit`: in how
    many rounds the best of them are then refitted with friction and stiffness.
    """
    if not folder.is_dir():
        print(f"Nothing to measure: the pushes are not in {folder}.")
        return
    pushes = recorded_pushes(folder)
    rope = Rope(read_pushes(pushes), pushes)
    known = [cause.name for cause in rope.catalogue.causes]
    for name in causes:
        if name not in known:
            raise UsageError.unknown("cause", name, known)
    nominal, tool = fitted_tool(rope)
    rows = [
        Row("no motion", *rope.still()[1:]),
        Row("nominal, the task's numbers", *rope[()][1:]),
        row(rope, "nominal, friction and stiffness fitted", nominal),
        row(rope, "and the unknown tool", tool),
    ]
    best = tool
    if causes:
        found = refitted(rope, screened(rope, tool, causes), refit)
        every = [row(rope, name, fitted) for name, fitted in found.items()]
        rows += sorted(every, key=lambda each: float(each.chamfer_mm.mean()))
        best, names = best_on_the_others(rope, found)
        rows.append(row(rope, "and the cause that is best on the other seven", best))
        print(f"Chosen without the push: {', '.join(names[:-1])}; with all: {names[-1]}")
    _print(rows, pushes)
    _values(rope, {"nominal": nominal, "tool": tool, "best": best})
    _draw(rope, pushes, nominal, tool, images)


def row(rope: Rope, name: str, fitted: Fitted) -> Row:
    """Errors on each push of the model that was fitted to the others."""
    rope.errors(fitted.places)
    left_out = (fitted.left_out(lambda place, which=which: rope[place][which]) for which in (1, 2))
    return Row(name, *left_out)


def _print(rows: Sequence[Row], pushes: Sequence[Recorded]) -> None:
    fitted, tool = rows[2], rows[3]
    print("| model | mm | mm^2 | gain on fitted nominal | of 8 | p | gain on the tool |")
    print("|---|---|---|---|---|---|---|")
    for each in rows:
        on_fitted, on_tool = paired(each.chamfer_mm, fitted.chamfer_mm), paired(each.chamfer_mm, tool.chamfer_mm)
        gains = [f"{gain.mean:.2f} ({gain.low:.2f} to {gain.high:.2f})" for gain in (on_fitted, on_tool)]
        print(
            f"| {each.name} | {each.chamfer_mm.mean():.2f} | {each.chamfer_mm2.mean():.0f} | {gains[0]} | "
            f"{on_fitted.better} | {on_fitted.p:.3f} | {gains[1]}, {on_tool.better} |"
        )
    print("| model | " + " | ".join(push.name for push in pushes) + " |")
    for each in rows:
        print(f"| {each.name} | " + " | ".join(f"{error:.1f}" for error in each.chamfer_mm) + " |")


def _values(rope: Rope, models: dict[str, Fitted]) -> None:
    """Print the parameters of each fold, the last fold with all eight."""
    for name, fitted in models.items():
        for place in dict.fromkeys(fitted.places):
            theta, count = rope.theta(place), fitted.places.count(place)
            known = {axis: float(theta[rope.catalogue.column(axis)]) for axis, _ in place if axis != "tool_radius"}
            said = ", ".join(f"{axis} {value:.4g}" for axis, value in known.items())
            print(f"{name}, {count} of {len(fitted.places)}: radius {rope.radius_m(place):.3f} m, {said}")


def _draw(rope: Rope, pushes: Sequence[Recorded], nominal: Fitted, extended: Fitted, images: Path) -> None:
    images.mkdir(parents=True, exist_ok=True)
    ends = [fitted.left_out(lambda place: rope[place].after) for fitted in (nominal, extended)]
    for k, push in enumerate(pushes):
        clouds = [rope.study.pushes[k].before.points, ends[0][k], ends[1][k], rope.trials.observed.after[k]]
        way = np.stack([push.start, push.end])
        drawn = picture(f"Push {push.name}", clouds, way, "extended")
        (images / f"real_rope_{push.name}.svg").write_text(drawn, encoding="utf-8")


if __name__ == "__main__":
    tyro.cli(main)
