"""Intervals of calibration on rods, against rods of known numbers: `python -m bench.calibration_coverage`.

Each data set is ten random pushes of one rope with its own stiffness, frictions and offset of the tool, each seen as
particles with the cameras' noise. The table says how often a 90 % interval holds the truth, and how wide it is.
"""

from typing import Final, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
import tyro
from jaxtyping import Float32, Float64
from rich.console import Console
from rich.table import Table
from scipy.stats import binomtest

from app.calibration.calibrate import Calibrator, phi_of
from app.calibration.evidence import Evidence
from app.calibration.fit import Fit, FitSettings
from app.jobs import jit_cache
from app.jobs.worker_api import nominal_model
from app.policy.base import PARKED_POSE
from app.sim.model.params import index
from app.sim.rods.rollout import RodPhysics, make_rod_rollout
from app.sim.rods.state import RodState, inextensible
from app.tasks import load
from app.tasks.elements.base import Task

TASK: Final = load("rope_push@rods")
PUSHES: Final = 10
POINT_NOISE_M, CLOUD_NOISE_M = 1.0e-3, 0.3e-3
"""Standard deviations of each particle along x, y and z, and of a whole cloud along x and y."""
STIFFNESS_PA, TABLE, FINGER = (1e4, 4e4), (0.3, 0.7), (0.15, 0.5)
OFFSET_M: Final = 0.004
"""Ranges of the truth, even in the logarithm, and of the tool's offset along x and y."""


class Truth(NamedTuple):
    """Numbers behind a data set, in the order in which they are fitted: a rope's, then the tool's offset [m]."""

    stiffness: float
    table_friction: float
    finger_friction: float
    tcp_x: float
    tcp_y: float


class DataSet(NamedTuple):
    """Pushes, and their true parameters."""

    evidence: Evidence
    truth: Truth


def data_set(
    seed: int, *, pushes: int = PUSHES, particles: int = 300, noise: float = 1.0, truth: Truth | None = None
) -> DataSet:
    """Pushes of a rope that is drawn at random, or of `truth`; `noise` scales that of the cameras."""
    rng = np.random.default_rng(seed)
    logs = [np.exp(rng.uniform(*np.log(each))) for each in (STIFFNESS_PA, TABLE, FINGER)]
    drawn = Truth(*map(float, logs), *rng.uniform(-OFFSET_M, OFFSET_M, 2).tolist())
    truth = truth or drawn
    nodes = np.stack([TASK.start(1000 * seed + k) for k in range(pushes)])
    before = np.stack([TASK.particles(each, particles) for each in nodes])
    actions = jnp.concatenate([jnp.asarray(TASK.actions.sample(rng, x, PARKED_POSE, 1)) for x in before])
    tool = np.asarray(TASK.actions.tool_path(actions, jnp.tile(jnp.asarray(PARKED_POSE, jnp.float32), (pushes, 1))))
    offset = _offset_m(truth)
    ends = np.asarray(_simulated(TASK, truth, nodes, tool + offset))
    heights = np.full((*ends.shape[:2], 1), TASK.rope.radius_m)
    after = [TASK.particles(each, particles) for each in np.concatenate([ends, heights], axis=2).astype(np.float64)]
    clouds = [np.stack([_seen(x, noise, rng) for x in each]) for each in (before, after)]
    return DataSet(Evidence(before=clouds[0], tool=tool.astype(np.float32), after=clouds[1]), truth)


def fitted(evidence: Evidence, settings: FitSettings | None = None) -> Fit:
    """Fit by the task's calibrator from the nominal model, with the tool's offset."""
    return _calibrator(evidence.before.shape[1], settings or FitSettings(probes=96)).fit_with_offset(
        evidence, phi_of(nominal_model(TASK.name))
    )


def _calibrator(particles: int, settings: FitSettings) -> Calibrator:
    if particles == TASK.preset("cpu").particle_count:
        return jit_cache.calibrator(TASK.name, "cpu", settings, phi_of(nominal_model(TASK.name)))
    raise ValueError(f"{particles} particles are not those of the preset cpu.")


def _offset_m(truth: Truth) -> Float32[np.ndarray, "3"]:
    offset = jit_cache.calibrator(TASK.name, "cpu", FitSettings(), phi_of(nominal_model(TASK.name))).offset
    assert offset is not None
    return np.array([*(offset.matrix @ [truth.tcp_x, truth.tcp_y]), 0.0], np.float32)


def _simulated(task: Task, truth: Truth, nodes: np.ndarray, tool: np.ndarray) -> Float32[np.ndarray, "K n 2"]:
    """Nodes after pushes of rods that begin on known lines."""
    assert task.rods is not None
    stiff = truth.stiffness > task.parameters(stiff=False)[index("stiffness")].high
    scene, count = task.rods.scene_for(stiff=stiff), len(nodes)
    given = {name: jnp.full(count, value, jnp.float32) for name, value in task.rods.physics.items()}
    physics = RodPhysics.nominal(scene, count)._replace(
        rigidity=jnp.full(count, truth.stiffness * scene.second_moment_m4, jnp.float32),
        table_friction=jnp.full(count, truth.table_friction, jnp.float32),
        finger_friction=jnp.full(count, truth.finger_friction, jnp.float32),
        **given,
    )
    places = np.linspace(0, nodes.shape[1] - 1, scene.nodes).round().astype(int)
    line = jnp.asarray(nodes[:, places, :2].transpose(0, 2, 1), jnp.float32)
    start = RodState.along(inextensible(line, scene.rest_m))
    end = jax.jit(make_rod_rollout(scene))(physics, start, jnp.asarray(tool, jnp.float32))
    return np.asarray(end.nodes[:, :2].transpose(0, 2, 1))


def _seen(x: np.ndarray, noise: float, rng: np.random.Generator) -> Float32[np.ndarray, "N 3"]:
    error = POINT_NOISE_M * rng.standard_normal(x.shape)
    error[:, :2] += CLOUD_NOISE_M * rng.standard_normal(2)
    return (x + noise * error).astype(np.float32)


def main(sets: int = 20, first: int = 0) -> None:
    """Fit so many data sets, and print a line for each and the table."""
    console = Console(width=150)
    truths, found = list[Truth](), list[Fit]()
    for seed in range(first, first + sets):
        evidence, truth = data_set(seed)
        truths.append(truth)
        found.append(fitted(evidence))
        pairs = zip(Truth._fields, truth, found[-1].values, found[-1].low, found[-1].high, strict=True)
        told = ", ".join(f"{name} {true:.3g}: {v:.3g} ({low:.3g} to {high:.3g})" for name, true, v, low, high in pairs)
        console.print(
            f"{seed}: {1e6 * found[-1].loss_m2:.2f} mm^2 after {len(found[-1].trials)} trials; {told}", highlight=False
        )
    table = Table("", "truth in the 90 % interval", "error / half-width, rms", "half-width, median")
    for column, name in enumerate(Truth._fields):
        table.add_row(name, *_row(name, column, truths, found))
    console.print(table)


def _row(name: str, column: int, truths: list[Truth], found: list[Fit]) -> tuple[str, str, str]:
    def scale(values: list[float]) -> Float64[np.ndarray, " S"]:
        return np.array(values) * 1e3 if name.startswith("tcp") else np.log(np.array(values))

    true = scale([truth[column] for truth in truths])
    here, low, high = (scale([float(getattr(fit, end)[column]) for fit in found]) for end in ("values", "low", "high"))
    held = int(((low <= true) & (true <= high)).sum())
    share = binomtest(held, len(found)).proportion_ci(0.9, method="wilson")
    half = (high - low) / 2
    width = f"{np.median(half):.2g} mm" if name.startswith("tcp") else f"a factor of {np.exp(np.median(half)):.2f}"
    off = float(np.sqrt(np.mean(((here - true) / half) ** 2)))
    return f"{held} of {len(found)} ({share.low:.0%} to {share.high:.0%})", f"{off:.2f}", width


if __name__ == "__main__":
    tyro.cli(main)
