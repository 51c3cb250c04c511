"""Failure diagnosis of one candidate: the substep that broke it, the particle, and the cause.

Kernels do not stop at what goes wrong: they turn the candidate into NaN and go on, for the others' sake. Afterwards it
is simulated once more, alone, with every state kept.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Literal, TypeAlias, final

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Bool, Float32, Float64, Int64

from app.core.errors import ParameterError
from app.sim.diagnosis.faults import KEPT, FailureDiagnosis, SimulationFault
from app.sim.model.registry import kind_name
from app.sim.mpm.simd_layout import unpack
from app.sim.runtime.checks import Arrays, Setup, first, inside, require_inputs, require_shapes, room, words
from app.sim.runtime.launch import make_operations
from app.sim.runtime.schedule import schedule_for
from app.sim.state import Setting, State

PIECE = 256
"""Substeps at a time: of 10 000 particles, 290 MB."""

Kind: TypeAlias = Literal["too fast", "turned inside out", "outside", "not finite"]

ADVICE: Mapping[str, str] = MappingProxyType(
    {
        "too fast": "slow the tool or the start down, or shorten dt_s, until nothing crosses a cell in a substep",
        "turned inside out": "shorten dt_s, or move the tool in smaller steps, so that less is squeezed in a substep",
        "outside": "keep the tool from pushing there, or widen the scene's low and high",
        "not finite": "shorten dt_s, and look at the start for what is far from rest",
    }
)


@final
@dataclass(frozen=True, kw_only=True, eq=False)
class MpmCase:
    """One candidate's simulation: arrays as a simulator takes them, with one candidate."""

    setup: Setup
    phi: Float32[np.ndarray, "1 P"]
    state: State
    tool: Float32[np.ndarray, "1 T A"]
    setting: Setting

    @property
    def substeps(self) -> int:
        """Number of substeps of the tool path."""
        return self.tool.shape[1] - 1

    @property
    def summary(self) -> str:
        """The simulated objects and their numbers, in words."""
        scene = self.setup.scene
        materials = ", ".join(kind_name(type(body.material)).lower() for body in scene.bodies)
        tools = ", ".join(kind_name(type(tool)).lower() for tool in scene.tools) or "none"
        return (
            f"{sum(self.setup.counts)} particles ({materials}), {self.substeps} substeps of {scene.dt_s:g} s, "
            f"tools: {tools}, {len(self.setup.effects)} effects"
        )

    def dissect(self) -> "FailureDiagnosis[SimulationTrace, State]":
        """See `dissect`."""
        return dissect(self)


@final
@dataclass(frozen=True, kw_only=True, eq=False)
class SimulationTrace:
    """Numbers of the states after 0, 1, 2, ... substeps: greatest speed, range of det F, particles off the grid.

    `cells`: how many cells the fastest particle crosses in a substep.
    """

    speed_m_s: Float64[np.ndarray, " K"]
    cells: Float64[np.ndarray, " K"]
    least_volume: Float64[np.ndarray, " K"]
    greatest_volume: Float64[np.ndarray, " K"]
    outside: Int64[np.ndarray, " K"]

    def __len__(self) -> int:
        return len(self.speed_m_s)

    def columns(self) -> dict[str, list[str]]:
        """The numbers for people, by name."""
        volumes = zip(self.least_volume, self.greatest_volume, strict=True)
        return {
            "max speed [m/s]": [f"{speed:.4g}" for speed in self.speed_m_s],
            "cells a substep": [f"{cells:.3g}" for cells in self.cells],
            "det F": [f"{least:.3g} to {greatest:.3g}" for least, greatest in volumes],
            "particles outside": [str(count) for count in self.outside],
        }


def single(
    setup: Setup, phi: Arrays, state: State, tool: Arrays, setting: Setting | None = None, *, candidate: int = 0
) -> MpmCase:
    """One of many candidates as a case, on the host."""
    known = setting or Setting.unknown(len(phi), sum(setup.counts))

    def row(leaf: Arrays) -> np.ndarray:
        return np.asarray(leaf, np.float32)[candidate : candidate + 1]

    return MpmCase(
        setup=setup,
        phi=row(phi),
        state=jax.tree.map(row, state),
        tool=row(tool),
        setting=jax.tree.map(row, known),
    )


def dissect(case: MpmCase) -> FailureDiagnosis[SimulationTrace, State]:
    """Simulate the case, and find where it broke. Raises ParameterError where its arrays do not fit its setup."""
    require_shapes(case.phi, case.state, case.tool, case.setting, case.setup.sizes())
    objection = _objection(case)
    faults: dict[str, SimulationFault] = {}
    rows: list[SimulationTrace] = []
    last = _rows(case.state, slice(0))
    failed = None if _usable(case) else 0
    at = 0
    for states in _pieces(case) if failed is None else ():
        broken = first(_broken(states))
        count = len(states.x) if broken is None else broken[0]
        for fault in _faults(case, states, at, count):
            faults.setdefault(fault.kind, fault)
        whole = _rows(states, slice(count))
        rows.append(_trace(case, whole))
        last = _rows(State(*map(jnp.concatenate, zip(last, whole, strict=True))), slice(-KEPT, None))
        at += count
        if broken is not None:
            failed = at
            break
    return FailureDiagnosis(
        steps=case.substeps,
        unit="substep",
        failed=failed,
        objection=objection,
        faults=tuple(sorted(faults.values(), key=lambda fault: fault.step)),
        advice=ADVICE,
        trace=_join_traces(rows),
        last=last,
    )


def _objection(case: MpmCase) -> str | None:
    try:
        require_inputs(case.setup, case.phi, case.state, case.tool, case.setting)
    except ParameterError as error:
        return str(error)
    return None


def _usable(case: MpmCase) -> bool:
    """True if there is anything to simulate: non-finite phi or tool make their candidate NaN by themselves."""
    return bool(np.isfinite(case.phi).all() and np.isfinite(case.tool).all())


def _pieces(case: MpmCase) -> Iterator[State]:
    """The states after 0, 1, 2, ... substeps, some at a time, as the kernels leave them, shape (K, N, ...)."""
    setup = case.setup
    schedule = schedule_for(jax.default_backend(), setup.scene, setup.effects)
    forward = make_operations(setup.scene, setup.counts, schedule).forward
    phi, state, setting = jax.tree.map(jnp.asarray, (case.phi, case.state, case.setting))
    for begin in range(0, case.substeps, PIECE):
        path = jnp.asarray(case.tool[:, begin : begin + PIECE + 1])
        history = forward(phi, state, path, setting, path.shape[1])
        state = unpack(history[:, -1])
        skipped = 0 if begin == 0 else 1
        yield jax.tree.map(np.asarray, unpack(history[0, skipped:]))


def _rows(states: State, chosen: slice) -> State:
    return State(*(np.asarray(leaf)[chosen] for leaf in states))  # pyright: ignore[reportArgumentType] - on the host


def _broken(states: State) -> Bool[np.ndarray, "K N"]:
    """Mask of the particles that are not finite."""
    flat = [np.isfinite(leaf).reshape(*leaf.shape[:2], -1).all(axis=-1) for leaf in states]
    return ~np.logical_and.reduce(flat)


def _faults(case: MpmCase, states: State, at: int, count: int) -> Iterator[SimulationFault]:
    """The first fault of each kind among the first `count` states, and what broke the one after them."""
    scene = case.setup.scene
    x = np.asarray(states.x)[:count]
    speed, volume = _speeds_and_volumes(_rows(states, slice(count)))
    cells = speed * scene.dt_s / scene.cell_m
    if found := first(cells >= 1):
        text = f"moves at {speed[found]:.4g} m/s, {cells[found]:.3g} cells a substep"
        yield _fault("too fast", at, found, text)
    if found := first(volume <= 0):
        yield _fault("turned inside out", at, found, f"has the relative volume det F = {volume[found]:.4g}")
    if found := first(~inside(scene, x)):
        yield _fault("outside", at, found, f"is at {words(x[found])} m, and the grid holds {room(scene)}")
    if count < len(states.x):
        particle = int(np.argmax(_broken(states)[count]))
        names = [
            name for name, leaf in zip("xvCF", states, strict=True) if not np.isfinite(leaf[count, particle]).all()
        ]
        yield _fault("not finite", at, (count, particle), f"has no finite {', '.join(names)}")


def _fault(kind: Kind, at: int, found: tuple[int, ...], text: str) -> SimulationFault:
    substep, particle = at + found[0], found[1]
    return SimulationFault.after(kind, substep, particle, f"particle {particle} {text}")


def _speeds_and_volumes(states: State) -> tuple[Float64[np.ndarray, "K N"], Float64[np.ndarray, "K N"]]:
    """Speeds and relative volumes of finite states; in double precision, where large ones do not overflow."""
    v, F = np.asarray(states.v, np.float64), np.asarray(states.F, np.float64)
    return np.linalg.norm(v, axis=-1), np.linalg.det(F)


def _trace(case: MpmCase, states: State) -> SimulationTrace:
    speed, volume = _speeds_and_volumes(states)
    scene, fastest = case.setup.scene, speed.max(axis=1, initial=0)
    return SimulationTrace(
        speed_m_s=fastest,
        cells=fastest * scene.dt_s / scene.cell_m,
        least_volume=volume.min(axis=1, initial=np.inf),
        greatest_volume=volume.max(axis=1, initial=-np.inf),
        outside=(~inside(scene, np.asarray(states.x))).sum(axis=1),
    )


def _join_traces(rows: list[SimulationTrace]) -> SimulationTrace:
    def column(name: str, kind: type) -> np.ndarray:
        return np.concatenate([np.zeros(0, kind), *(getattr(row, name) for row in rows)])

    return SimulationTrace(
        speed_m_s=column("speed_m_s", np.float64),
        cells=column("cells", np.float64),
        least_volume=column("least_volume", np.float64),
        greatest_volume=column("greatest_volume", np.float64),
        outside=column("outside", np.int64),
    )
