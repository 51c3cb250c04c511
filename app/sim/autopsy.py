"""What became of one candidate: which substep broke it, which particle, and why.

Kernels do not stop at what goes wrong: they turn the candidate into NaN and go on, for the others' sake. Afterwards it
is simulated once more, alone, with every state kept.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Literal, TypeAlias, final

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Bool, Float32, Float64, Int64

from app.core.errors import ParameterError
from app.sim.checks import Arrays, Setup, first, inside, require_inputs, require_shapes, room, words
from app.sim.launch import make_operations
from app.sim.packed import unpack
from app.sim.schedule import schedule_for
from app.sim.state import Setting, State

PIECE = 256
"""Substeps at a time: of 10 000 particles, 290 MB."""

KEPT = 8
"""States before the end that are kept."""

Kind: TypeAlias = Literal["too fast", "turned inside out", "outside", "not finite"]

ADVICE: dict[Kind, str] = {
    "too fast": "slow the tool or the start down, or shorten dt_s, until nothing crosses a cell in a substep",
    "turned inside out": "shorten dt_s, or move the tool in smaller steps, so that less is squeezed in a substep",
    "outside": "keep the tool from pushing there, or widen the scene's low and high",
    "not finite": "shorten dt_s, and look at the start for what is far from rest",
}


@final
@dataclass(frozen=True, kw_only=True, eq=False)
class Case:
    """One candidate's simulation: arrays as a simulator takes them, with one candidate."""

    setup: Setup
    phi: Float32[np.ndarray, "1 P"]
    state: State
    tool: Float32[np.ndarray, "1 T A"]
    setting: Setting

    @property
    def substeps(self) -> int:
        """How many are asked for."""
        return self.tool.shape[1] - 1


@final
@dataclass(frozen=True, kw_only=True)
class Fault:
    """The first of its kind: `particle` after `substep` substeps, in words."""

    kind: Kind
    substep: int
    particle: int
    words: str


@final
@dataclass(frozen=True, kw_only=True, eq=False)
class Trace:
    """Of the states after 0, 1, 2, ... substeps: greatest speed, range of det F, particles that are not on the grid."""

    speed_m_s: Float64[np.ndarray, " K"]
    least_volume: Float64[np.ndarray, " K"]
    greatest_volume: Float64[np.ndarray, " K"]
    outside: Int64[np.ndarray, " K"]


@final
@dataclass(frozen=True, kw_only=True, eq=False)
class Autopsy:
    """What was found.

    `failed`: a rollout of so many substeps is the first that is not finite; None where all are. `objection`: what is
    wrong with the input, if anything. `last`: up to `KEPT` states before the failure or the end, shape (K, N, ...),
    of which the last is that after `until` substeps; `trace` ends there.
    """

    substeps: int
    failed: int | None
    objection: str | None
    faults: tuple[Fault, ...]
    trace: Trace
    last: State

    @property
    def until(self) -> int:
        """Substeps after which the last finite state is."""
        return len(self.trace.speed_m_s) - 1

    def verdict(self) -> str:
        """In a few sentences: what happened, in order, and what to change."""
        outcome = "Finite throughout" if self.failed is None else f"Not finite from substep {self.failed} on"
        story = [f"{outcome} ({self.substeps} substeps).", *(fault.words for fault in self.faults)]
        if self.objection:
            story.insert(1, f"The input is wrong: {self.objection}")
        elif self.faults:
            story.append(f"What to change: {ADVICE[self.faults[0].kind]}.")
        return " ".join(story)


def single(
    setup: Setup, phi: Arrays, state: State, tool: Arrays, setting: Setting | None = None, *, candidate: int = 0
) -> Case:
    """One of many candidates as a case, on the host."""
    known = setting or Setting.unknown(len(phi), sum(setup.counts))

    def row(leaf: Arrays) -> np.ndarray:
        return np.asarray(leaf, np.float32)[candidate : candidate + 1]

    return Case(
        setup=setup,
        phi=row(phi),
        state=jax.tree.map(row, state),
        tool=row(tool),
        setting=jax.tree.map(row, known),
    )


def dissect(case: Case) -> Autopsy:
    """Simulate the case, and find where it broke. Raises ParameterError where its arrays do not fit its setup."""
    require_shapes(case.phi, case.state, case.tool, case.setting, case.setup.sizes())
    objection = _objection(case)
    faults: dict[Kind, Fault] = {}
    rows: list[Trace] = []
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
    return Autopsy(
        substeps=case.substeps,
        failed=failed,
        objection=objection,
        faults=tuple(sorted(faults.values(), key=lambda fault: fault.substep)),
        trace=_joined(rows),
        last=last,
    )


def _objection(case: Case) -> str | None:
    try:
        require_inputs(case.setup, case.phi, case.state, case.tool, case.setting)
    except ParameterError as error:
        return str(error)
    return None


def _usable(case: Case) -> bool:
    """Whether there is anything to simulate: phi and tool make their candidate NaN by themselves."""
    return bool(np.isfinite(case.phi).all() and np.isfinite(case.tool).all())


def _pieces(case: Case) -> Iterator[State]:
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
    """Which particles are not finite."""
    flat = [np.isfinite(leaf).reshape(*leaf.shape[:2], -1).all(axis=-1) for leaf in states]
    return ~np.logical_and.reduce(flat)


def _faults(case: Case, states: State, at: int, count: int) -> Iterator[Fault]:
    """The first fault of each kind among the first `count` states, and what broke the one after them."""
    scene = case.setup.scene
    x = np.asarray(states.x)[:count]
    speed, volume = _measured(_rows(states, slice(count)))
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


def _fault(kind: Kind, at: int, found: tuple[int, ...], text: str) -> Fault:
    substep, particle = at + found[0], found[1]
    plural = "substep" if substep == 1 else "substeps"
    return Fault(
        kind=kind, substep=substep, particle=particle, words=f"After {substep} {plural} particle {particle} {text}."
    )


def _measured(states: State) -> tuple[Float64[np.ndarray, "K N"], Float64[np.ndarray, "K N"]]:
    """Speeds and relative volumes of finite states; in double precision, where large ones do not overflow."""
    v, F = np.asarray(states.v, np.float64), np.asarray(states.F, np.float64)
    return np.linalg.norm(v, axis=-1), np.linalg.det(F)


def _trace(case: Case, states: State) -> Trace:
    speed, volume = _measured(states)
    return Trace(
        speed_m_s=speed.max(axis=1, initial=0),
        least_volume=volume.min(axis=1, initial=np.inf),
        greatest_volume=volume.max(axis=1, initial=-np.inf),
        outside=(~inside(case.setup.scene, np.asarray(states.x))).sum(axis=1),
    )


def _joined(rows: list[Trace]) -> Trace:
    def column(name: str, kind: type) -> np.ndarray:
        return np.concatenate([np.zeros(0, kind), *(getattr(row, name) for row in rows)])

    return Trace(
        speed_m_s=column("speed_m_s", np.float64),
        least_volume=column("least_volume", np.float64),
        greatest_volume=column("greatest_volume", np.float64),
        outside=column("outside", np.int64),
    )
