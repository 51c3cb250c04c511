"""Real rope pushes by a rod, each predicted from the seven others: `python -m bench.real_pushes`.

What a fold knows of the rod is the mean of all models, each weighed by how well it predicts the seven pushes of that
fold: with as many unknowns as half the pushes, the best one alone follows their peculiarities. docs/real-data.md says
what was recorded and what is assumed; the rope's size and weight are of the clouds.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Final, NamedTuple, final

import jax
import jax.numpy as jnp
import numpy as np
import tyro
from jaxtyping import Bool, Float32, Float64
from rich.console import Console
from rich.table import Table
from scipy.stats import qmc, t

from app.core.geometry.chamfer import chamfer_m2
from app.core.types import Cloud, Points
from app.sim.rods.rollout import RodPhysics, make_rod_rollout
from app.sim.rods.scene import RodScene
from app.sim.rods.state import RodState
from bench.leave_one_out import folds
from bench.real_centrelines import length_m, places_along, principal_curve, rods_along
from bench.real_rope import chamfer_mm, read_pushes
from bench.rope_pushes import FOLDER, RADIUS_M, SPEED_M_S, Recorded, recorded_pushes, volume_m3

DENSITY_KG_M3: Final = 796.0
"""Density of the task's rope: this one was not weighed. Only the ratio of stiffness to weight and friction shows."""
FINGER_M: Final = 0.010
"""Radius of the round finger that `reach` is an addition to; its sides are upright, so that it does not press down."""
NODES: Final = 41
MODELS: Final = 1024
"""Sobol points in the box of the free numbers, for each distribution of weight."""
TASSELS: Final = (0.0, 0.5, 1.0)
"""Weight of tassels: as by the rope's length, halfway, as by their volume in the clouds."""
_STIFFEST_N_M2: Final = 5e-3
_REST_S, _LIFTED_M = 0.2, 1.0
_AT_ONCE: Final = 20
_MM, _MM2 = 1e3, 1e6
_LOST: Final = 1e6
_Z90: Final = 1.645


class Axis(NamedTuple):
    """A number that is free: its range as a prior, even in the logarithm where `ratio`, and its value where it is not.

    `bend` is the length (E I / (mu w))^(1/3) of which a rope bends under friction mu on a table, w its weight a metre;
    `reach` from the finger's core to the centreline at contact, `half_width` of that core, `yaw` of it from the x axis,
    `offset_x`, `offset_y` of the finger from the point that was recorded.
    """

    low: float
    high: float
    ratio: bool
    fixed: float
    unit: str

    def value(self, u: Float64[np.ndarray, "*batch"]) -> Float64[np.ndarray, "*batch"]:
        """Value at a share 0..1 of the range."""
        u = np.clip(u, 0.0, 1.0)
        return self.low * (self.high / self.low) ** u if self.ratio else self.low + (self.high - self.low) * u


AXES: Final = {
    "bend": Axis(0.04, 0.20, True, 0.10, "m"),
    "finger_friction": Axis(0.1, 1.5, True, 0.4, "1"),
    "reach": Axis(0.010, 0.030, False, 0.016, "m"),
    "offset_x": Axis(-0.015, 0.030, False, 0.0, "m"),
    "offset_y": Axis(-0.010, 0.010, False, 0.0, "m"),
    "table_friction": Axis(0.1, 1.0, True, 0.5, "1"),
    "yield_curvature": Axis(3.0, 100.0, True, 300.0, "1/m"),
    "climb": Axis(0.0, 1.5, False, 0.0, "1"),
    "half_width": Axis(0.0, 0.020, False, 0.0, "m"),
    "yaw": Axis(-1.571, 1.571, False, 0.0, "rad"),
}
FREE: Final = ("bend", "finger_friction", "reach", "offset_x")
FLAT: Final = (*FREE, "half_width")


@final
@dataclass(frozen=True, kw_only=True, eq=False)
class RealPushes:
    """K pushes: particles (N each) and recorded clouds before and after [m], the finger's path (K, T, 3)."""

    before: Points
    after: Points
    clouds: tuple[tuple[Cloud, Cloud], ...]
    tool: Float32[np.ndarray, "K T 3"]
    mass_kg: float

    def __len__(self) -> int:
        return len(self.clouds)


class Scores(NamedTuple):
    """Chamfer distances seen from above [mm] and sums of squares in space [mm^2], of pushes."""

    mm: Float64[np.ndarray, "*batch K"]
    mm2: Float64[np.ndarray, "*batch K"]


class Posterior(NamedTuple):
    """A model of the rope: weight of tassels, values of the free numbers, and their 90 % intervals (2, V)."""

    tassels: float
    values: Float64[np.ndarray, " V"]
    interval: Float64[np.ndarray, "2 V"]


class Row(NamedTuple):
    """A line of the table: errors on pushes left out, and what was found with all."""

    name: str
    particles: Scores
    clouds: Scores
    free: tuple[str, ...] = ()
    found: Posterior | None = None


@final
class Rope:
    """A rod with tassels of some weight, and how well it predicts the pushes."""

    def __init__(self, pushes: RealPushes, tassels: float, *, by_rank: bool = False) -> None:
        """`by_rank`: the start as `RodState.at_rest` has it."""
        lines = [principal_curve(x, NODES) for x in pushes.before]
        ends = [principal_curve(x, NODES) for x in pushes.after]
        length = float(np.median([length_m(line) for line in lines + ends]))
        shares = mass_shares([*pushes.before, *pushes.after], lines + ends, tassels)
        self.pushes = pushes
        self.scene = RodScene(
            length_m=length,
            radius_m=RADIUS_M,
            mass_kg=pushes.mass_kg,
            finger_radius_m=FINGER_M,
            finger_half_width_m=AXES["half_width"].high,
            spacing_m=length / (NODES - 1),
            mass_shares=tuple(shares.tolist()),
            stiffest_n_m2=_STIFFEST_N_M2,
        )
        rods = rods_along(lines, list(pushes.before), self.scene.rest_m)
        self.start = jax.tree.map(lambda *each: jnp.concatenate(each), *rods)
        if by_rank:
            self.start = RodState.at_rest(jnp.asarray(pushes.before), NODES, self.scene.rest_m)
        begin = [np.asarray(line, np.float64).T for line in self.start.nodes[:, :2]]
        self._clouds = rods_along(begin, [before for before, _ in pushes.clouds], self.scene.rest_m)
        self._simulate = make_rod_rollout(self.scene)
        self._run = jax.jit(self._predict)

    def scores(self, values: Float64[np.ndarray, "C V"], free: Sequence[str]) -> Scores:
        """Scores of models (C) on each push, by particles carried with the nodes; a lost rod gets the worst."""
        found = list[tuple[np.ndarray, np.ndarray]]()
        for first in range(0, len(values), _AT_ONCE):
            part = values[first : first + _AT_ONCE]
            _, mm, mm2 = self._run(self._physical(part, free))
            found.append((np.asarray(mm, np.float64)[: len(part)], np.asarray(mm2, np.float64)[: len(part)]))
        mm, mm2 = (np.nan_to_num(np.concatenate(each), nan=_LOST) for each in zip(*found, strict=True))
        return Scores(mm, mm2)

    def cloud_scores(self, values: Float64[np.ndarray, " V"], free: Sequence[str]) -> Scores:
        """Scores of one model, by the recorded cloud carried with the centreline."""
        nodes = self._run(self._physical(values[None], free))[0][0]
        return self._carried([nodes[k : k + 1] for k in range(len(self.pushes))])[1]

    def known_ends(self) -> Row:
        """Errors where the centreline after each push is known, either end first: no rod comes below."""
        lines = [principal_curve(x, NODES) for x in self.pushes.after]
        ends = rods_along(lines, list(self.pushes.after), self.scene.rest_m)
        both = [ends, [end._replace(nodes=end.nodes[..., ::-1]) for end in ends]]
        found = [self._carried([rod.nodes for rod in rods]) for rods in both]
        (a, of_a), (b, of_b) = found
        return Row(
            "centreline after it known",
            Scores(np.minimum(a.mm, b.mm), np.minimum(a.mm2, b.mm2)),
            Scores(np.minimum(of_a.mm, of_b.mm), np.minimum(of_a.mm2, of_b.mm2)),
        )

    def _carried(self, nodes: Sequence[jax.Array]) -> tuple[Scores, Scores]:
        """Scores of particles and of recorded clouds, with each push's nodes (1, 8, n)."""
        x = [
            np.asarray(self.start._replace(nodes=jnp.tile(each, (len(self.pushes), 1, 1))).x[k])
            for k, each in enumerate(nodes)
        ]
        carried = [np.asarray(rod._replace(nodes=each).x[0]) for rod, each in zip(self._clouds, nodes, strict=True)]
        return compared(x, list(self.pushes.after)), compared(carried, [after for _, after in self.pushes.clouds])

    def _physical(self, values: np.ndarray, free: Sequence[str]) -> dict[str, jax.Array]:
        """All axes of as many models as are compiled, of which the last is repeated."""
        padded = values[np.minimum(np.arange(_AT_ONCE), len(values) - 1)]
        given = {name: np.full(_AT_ONCE, axis.fixed) for name, axis in AXES.items()}
        given |= {name: padded[:, column] for column, name in enumerate(free)}
        return {name: jnp.asarray(value, jnp.float32) for name, value in given.items()}

    def _predict(self, given: dict[str, jax.Array]) -> tuple[jax.Array, jax.Array, jax.Array]:
        """Nodes (C, K, 8, n) after the pushes, and the scores of particles."""
        count, models = len(self.pushes), _AT_ONCE
        each = {name: jnp.repeat(value, count) for name, value in given.items()}
        weight_n_m = self.scene.mass_kg * self.scene.gravity_m_s2 / self.scene.length_m
        physics = RodPhysics.nominal(self.scene, models * count)._replace(
            rigidity=each["bend"] ** 3 * each["table_friction"] * weight_n_m,
            table_friction=each["table_friction"],
            finger_friction=each["finger_friction"],
            margin=each["reach"] - FINGER_M - RADIUS_M,
            yield_curvature=each["yield_curvature"],
            climb=each["climb"],
            press=jnp.zeros(models * count),
            finger_half_width=each["half_width"],
            finger_yaw=each["yaw"],
        )
        state = jax.tree.map(partial(_repeated, count=models), self.start)
        shift = jnp.stack([each["offset_x"], each["offset_y"], jnp.zeros(models * count)], axis=-1)
        end = self._simulate(physics, state, jnp.tile(self.pushes.tool, (models, 1, 1)) + shift[:, None])
        seen = jnp.tile(self.pushes.after, (models, 1, 1))
        mm, mm2 = jax.lax.map(_distances, (end.x, seen))
        return end.nodes.reshape(models, count, *end.nodes.shape[1:]), mm.reshape(-1, count), mm2.reshape(-1, count)


def _repeated(each: jax.Array, count: int) -> jax.Array:
    return jnp.tile(each, (count,) + (1,) * (each.ndim - 1))


def _distances(clouds: tuple[jax.Array, jax.Array]) -> tuple[jax.Array, jax.Array]:
    """Distances as `chamfer_mm` and `chamfer_m2`."""
    x, y = clouds
    flat = jnp.sqrt(((x[:, None, :2] - y[None, :, :2]) ** 2).sum(-1))
    return _MM * (flat.min(0).mean() + flat.min(1).mean()) / 2, _MM2 * chamfer_m2(x, y)


def compared(x: Sequence[Cloud], y: Sequence[Cloud]) -> Scores:
    """Clouds with clouds."""
    pairs = list(zip(x, y, strict=True))
    mm2 = [_MM2 * float(chamfer_m2(np.asarray(a, np.float64), np.asarray(b, np.float64))) for a, b in pairs]
    return Scores(np.array([chamfer_mm(a, b) for a, b in pairs]), np.array(mm2))


def real_pushes(recorded: list[Recorded]) -> RealPushes:
    """Pushes read through the plain import format and a recording, as a user would.

    The path is that of `write_plain`, with the finger upright beside the rope, and out of the way at the end.
    """
    study = read_pushes(recorded)
    return RealPushes(
        before=np.stack([push.before.points for push in study.pushes]),
        after=np.stack([push.after.points for push in study.pushes]),
        clouds=tuple((push.before, push.after) for push in recorded),
        tool=np.stack([_path(push, 1e-3) for push in recorded]),
        mass_kg=volume_m3(recorded) * DENSITY_KG_M3,
    )


def _path(push: Recorded, dt_s: float) -> Float32[np.ndarray, "T 3"]:
    steps = round(float(np.linalg.norm(push.end - push.start)) / (SPEED_M_S * dt_s))
    way = push.start + np.linspace(0, 1, steps + 1)[:, None] * (push.end - push.start)
    way[:, 2] = RADIUS_M - FINGER_M
    rest = np.tile([*way[-1, :2], _LIFTED_M], (round(_REST_S / dt_s), 1))
    return np.concatenate([way, rest]).astype(np.float32)


def mass_shares(clouds: Sequence[Points], lines: Sequence[np.ndarray], tassels: float) -> Float64[np.ndarray, " n"]:
    """Mass shares of the nodes, symmetric, as the ends are not told apart: particles stand for equal volumes.

    Between equal shares and those, `tassels` from 0 to 1; an end node has at least half of an inner one's.
    """
    counted = np.zeros(NODES)
    for cloud, line in zip(clouds, lines, strict=True):
        near = np.round(places_along(cloud[:, :2].astype(np.float64), line)).astype(int)
        counted += np.bincount(near, minlength=NODES)
    counted = (counted + counted[::-1]) / np.median(counted) / 2
    shares = 1 + tassels * (counted - 1)
    shares[[0, -1]] = np.maximum(shares[[0, -1]], 0.5)
    return shares / shares.sum()


def posterior(
    pool: Float64[np.ndarray, "M V"],
    mm2: Float64[np.ndarray, "L M K"],
    train: Bool[np.ndarray, " K"],
    free: Sequence[str],
) -> Posterior:
    """Posterior mean by the pushes `train`, from the sums of squares of a pool (0..1) for each weight of tassels.

    Errors of the model are taken to be normal, as large as those of the best one, and independent from push to push;
    the axes' ranges are the prior. The weight of tassels is that of those tried which is nearest to its mean.
    """
    sums = mm2[..., train].sum(-1)
    weights = np.exp(-0.5 * (sums - sums.min()) * train.sum() / sums.min())
    mean_tassels = float(weights.sum(1) @ np.array(TASSELS) / weights.sum())
    level = int(np.abs(np.array(TASSELS) - mean_tassels).argmin())
    weights = weights[level] / weights[level].sum()
    mean = weights @ pool
    spread = _Z90 * np.sqrt(weights @ (pool - mean) ** 2)
    low, here, high = (
        [float(AXES[n].value(u)) for n, u in zip(free, at, strict=True)] for at in (mean - spread, mean, mean + spread)
    )
    return Posterior(TASSELS[level], np.array(here), np.array([low, high]))


def left_out(ropes: Sequence[Rope], name: str, free: Sequence[str], models: int) -> Row:
    """Predictions of each push by the posterior of the free numbers from the others."""
    pool = qmc.Sobol(len(free), rng=np.random.default_rng(0)).random(models)
    values = np.stack([AXES[each].value(pool[:, column]) for column, each in enumerate(free)], axis=1)
    mm2 = np.stack([rope.scores(values, free).mm2 for rope in ropes])
    found = [posterior(pool, mm2, train, free) for train in folds(mm2.shape[-1])]
    of_fold = [ropes[TASSELS.index(each.tassels)] for each in found[:-1]]
    scores = [rope.scores(each.values[None], free) for rope, each in zip(of_fold, found, strict=False)]
    clouds = [rope.cloud_scores(each.values, free) for rope, each in zip(of_fold, found, strict=False)]
    particles = Scores(
        np.array([score.mm[0, k] for k, score in enumerate(scores)]),
        np.array([score.mm2[0, k] for k, score in enumerate(scores)]),
    )
    carried = Scores(
        np.array([score.mm[k] for k, score in enumerate(clouds)]),
        np.array([score.mm2[k] for k, score in enumerate(clouds)]),
    )
    return Row(name, particles, carried, tuple(free), found[-1])


def main(folder: Path = FOLDER, models: int = MODELS, variants: bool = False) -> None:
    """Print errors on the push left out, and the numbers that all eight say, in some minutes of one core.

    `models`: a power of two; `variants`: also other free numbers, and starts by rank along the rope.
    """
    if not folder.is_dir():
        print(f"Nothing to measure: the pushes are not in {folder}.")
        return
    pushes = real_pushes(recorded_pushes(folder))
    still = Row(
        "no motion",
        compared(list(pushes.before), list(pushes.after)),
        compared(*map(list, zip(*pushes.clouds, strict=True))),
    )
    ropes = [Rope(pushes, tassels) for tassels in TASSELS]
    rows = [still, ropes[0].known_ends()]
    rows += [left_out(ropes, "rod, round finger", FREE, models), left_out(ropes, "rod, flat finger", FLAT, models)]
    if variants:
        rows.append(left_out(ropes, "round, without the finger's offset", FREE[:-1], models))
        rows += [left_out(ropes, f"flat, and {name}", (*FLAT, name), models) for name in AXES if name not in FLAT]
        ranked = [Rope(pushes, tassels, by_rank=True) for tassels in TASSELS]
        rows.append(left_out(ranked, "flat, places by rank, as RodState.at_rest", FLAT, models))
    _print(rows)


def _print(rows: Sequence[Row]) -> None:
    table = Table("", "particles: mm", "mm^2", "recorded clouds: mm", "mm^2", "particles, mm of each push")
    for row in rows:
        clouds = [_mean(row.clouds.mm), _mean(row.clouds.mm2)]
        each = " ".join(f"{error:.1f}" for error in row.particles.mm)
        table.add_row(row.name, _mean(row.particles.mm), _mean(row.particles.mm2), *clouds, each)
    console = Console(width=170)
    console.print("Errors on the push left out: mean (90 % interval of it by Student's t, 8 pushes)")
    console.print(table)
    for row in rows:
        if row.found is not None:
            numbers = zip(row.free, row.found.values, *row.found.interval, strict=True)
            told = ", ".join(
                f"{name} {v:.3g} ({low:.3g} to {high:.3g}) {AXES[name].unit}" for name, v, low, high in numbers
            )
            console.print(f"{row.name}, all eight pushes: {told}; tassels {row.found.tassels:g}", highlight=False)


def _mean(errors: Float64[np.ndarray, " K"]) -> str:
    mean, reach = float(errors.mean()), float(t.ppf(0.95, len(errors) - 1) * errors.std(ddof=1) / np.sqrt(len(errors)))
    return f"{mean:.3g} ({mean - reach:.3g} to {mean + reach:.3g})"


if __name__ == "__main__":
    tyro.cli(main)
