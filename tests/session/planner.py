"""Planner for the tests of the session: its process draws strokes over the free part of the table, at once.

The jobs of `app.jobs.worker_api` are those of the program; only what a task compiles is replaced in this process.
Nothing here loads JAX or the simulator, so that a run starts in a second.
"""

import os
import signal
import sys
import time
from collections.abc import Callable, Generator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from types import ModuleType, SimpleNamespace
from typing import TYPE_CHECKING, Literal, cast, final

import anyio
import numpy as np

import app.jobs
from app.config import KeepOut, Site
from app.core.errors import PlanningError
from app.core.geometry.chamfer import chamfer_m2
from app.core.geometry.orientation import Orientation
from app.core.messages import Branch, Model
from app.core.motion import Motion
from app.core.system.worker import Worker
from app.core.types import Centreline, Points
from app.jobs.worker_api import plan, warm_up_stage
from app.planner.method import Method
from app.planner.search.request import PlanRequest
from tests.session.virtual import InsideWorker, is_virtual

if TYPE_CHECKING:
    from app.planner.search.plan import Plan

_LOADED = "jit_cache", "rope_orientation", "stages"
"""Modules of `app.jobs` that load the simulator."""
_PUSH_HEIGHT_M, _TRAVEL_HEIGHT_M, _SPEED_M_S = 0.006, 0.05, 0.4
_FREE_LOW_M, _FREE_HIGH_M = (0.32, -0.15), (0.40, 0.15)
"""Range of the strokes: 10 cm nearer to the arm than the rope, which they therefore never move."""


@final
@dataclass(frozen=True, kw_only=True)
class Habits:
    """Behaviour of the planner.

    It takes `compiling_s` before its first plan where that is not 0, and `thinking_s` for each plan; its first
    `failures` plans fail as `trouble` says. A plan costs `cost`, and 1 more for each that was rejected, and promises
    the object nearer to the goal by a `share` of the way; its branches have these `terms`.
    """

    compiling_s: float = 0.0
    thinking_s: float = 0.0
    failures: int = 0
    trouble: Literal["no finite branch", "dies"] = "no finite branch"
    cost: float = -10.0
    share: float = 0.0
    terms: Mapping[str, float] = field(default_factory=dict[str, float])


def unspoilt(motion: Motion, _: Site) -> Motion:
    """The motion as it was drawn."""
    return motion


def take_up(habits: Habits, spoil: Callable[[Motion, Site], Motion] = unspoilt) -> None:
    """Plan with strokes of these habits from now on, each changed by `spoil`. To be run in the planner's process."""
    strokes = Strokes(habits, spoil)

    def planner(task: str, preset: str, phi: np.ndarray, method: Method, kept_out: tuple[KeepOut, ...]) -> Strokes:
        return strokes

    def stages(
        task: str, preset: str, model: Model, method: Method, kept_out: tuple[KeepOut, ...], *, learning: bool
    ) -> list[object]:
        compiling = SimpleNamespace(name="strokes", run=lambda: None)
        return [compiling] if habits.compiling_s else []

    def advance(task: str, particle_count: int) -> Callable[..., Points]:
        return lambda phi, x, path: x

    compiled = SimpleNamespace(planner=planner, phi_of=_phi_of, advance=advance, needs=lambda task, phi: ())
    rope_orientation = SimpleNamespace(oriented_phi=_phi_of, track_orientation=_unchanged)
    warming_up = SimpleNamespace(stages=stages)
    for name, module in zip(_LOADED, (compiled, rope_orientation, warming_up), strict=True):
        _put(name, cast(ModuleType, cast(object, module)))


@contextmanager
def restored() -> Generator[None]:
    """Restore the planning of this process at the end of the block."""
    before = {name: sys.modules.get(f"{app.jobs.__name__}.{name}") for name in _LOADED}
    try:
        yield
    finally:
        for name, module in before.items():
            _put(name, module)


def _put(name: str, module: ModuleType | None) -> None:
    """Replace `module` in what a task compiles; None removes it, so that it is loaded again."""
    whole = f"{app.jobs.__name__}.{name}"
    if module is not None:
        sys.modules[whole] = module
        setattr(app.jobs, name, module)
    elif sys.modules.pop(whole, None) is not None:
        delattr(app.jobs, name)


def planner_here() -> Worker:
    """A planner's process, or in virtual time a thread that takes as long as its habits say."""
    return StrokesWorker("planner") if is_virtual() else Worker("planner")


class StrokesWorker(InsideWorker):
    """Worker that takes the time [s] of its habits for planning and compiling, in the loop's time."""

    _takes_s: Mapping[Callable[..., object], float] = {}

    async def _answer(self, function: Callable[..., object], arguments: tuple[object, ...]) -> tuple[bool, object]:
        if function is take_up and isinstance(habits := arguments[0], Habits):
            self._takes_s = {plan: habits.thinking_s, warm_up_stage: habits.compiling_s}
            arguments = (replace(habits, thinking_s=0.0), *arguments[1:])
        await anyio.sleep(self._takes_s.get(function, 0.0))
        return await super()._answer(function, arguments)


@final
class Strokes:
    """A planner that expects nothing of its pushes: the object stays where it was observed."""

    def __init__(self, habits: Habits, spoil: Callable[[Motion, Site], Motion]) -> None:
        self._habits, self._spoil = habits, spoil
        self._failed = 0

    def __call__(self, request: PlanRequest) -> "_Sent":
        """Two strokes, drawn from the seed; the second is the motion. What was rejected is counted in its cost.

        It predicts the rope along its motion, and would make it once more. Its terms say where the rope was predicted
        that it was told of, and where it was to go on. What was planned ahead it takes, whatever that is.
        """
        if self._habits.thinking_s:
            time.sleep(self._habits.thinking_s)
        if self._failed < self._habits.failures:
            self._failed += 1
            if self._habits.trouble == "dies":
                os.kill(os.getpid(), signal.SIGKILL)
            raise PlanningError("No branch stayed finite.")
        rng, observed, goal, near = np.random.default_rng(request.seed), request.observed, request.goal, request.near
        rest = request.remainder
        ends = rng.uniform(_FREE_LOW_M, _FREE_HIGH_M, size=(2, 2, 2))
        paths = np.concatenate([ends, np.full((2, 2, 1), _PUSH_HEIGHT_M)], axis=2)
        above = paths[1, [0, 1]] + [0.0, 0.0, _TRAVEL_HEIGHT_M]
        positions = np.stack([above[0], *paths[1], above[1]])
        distance_m2 = float(chamfer_m2(observed, goal))
        cost = self._habits.cost + len(request.rejected)
        told = dict(self._habits.terms) | ({} if near is None else {"near": float(near[0, 0])})
        told |= {} if rest is None else {"remainder": float(rest[0, 0])}
        final = (observed + self._habits.share * (goal.mean(0) - observed.mean(0))).astype(np.float32)
        branches = (
            _branch("policy", paths[0], observed, final, cost, told),
            _branch("random", paths[1], observed, final, cost, told),
        )
        centreline = paths[1, :, :2].T.astype(np.float32)
        motion = Motion(positions=positions, speeds=np.full(len(positions), _SPEED_M_S))
        moved, ahead = self._spoil(motion, request.site), bool(request.ahead)
        return _Sent((branches, 1, moved, observed, centreline, distance_m2, distance_m2, ahead))


def _branch(
    origin: Literal["policy", "random"],
    path: np.ndarray,
    observed: Points,
    final: Points,
    cost: float,
    terms: dict[str, float],
) -> Branch:
    return Branch(
        origin=origin,
        actions=np.tile(path[:, :2].reshape(1, -1), (2, 1)).astype(np.float32),
        tool_path=path.astype(np.float32),
        predicted=observed,
        final=final,
        cost_before=cost,
        cost_after=cost,
        terms=terms,
        finite=True,
    )


def _phi_of(model: Model, *_: object) -> np.ndarray:
    return np.array([parameter.value for parameter in model.parameters], np.float32)


def _unchanged(_: str, orientation: Orientation, *__: object) -> Orientation:
    return orientation


_Fields = tuple[tuple[Branch, ...], int, Motion, Points, Centreline, float, float, bool]


@final
@dataclass(frozen=True)
class _Sent:
    """A plan on its way to the session, where it arrives as a `Plan`: the class is loaded there, not here."""

    fields: _Fields

    def __reduce__(self) -> "tuple[Callable[..., Plan], _Fields]":
        return _arrived, self.fields


def _arrived(
    branches: tuple[Branch, ...],
    best: int,
    motion: Motion,
    predicted: Points,
    centreline: Centreline,
    distance_m2: float,
    predicted_m2: float,
    ahead: bool,
) -> "Plan":
    from app.planner.search.plan import Plan

    return Plan(
        branches=branches,
        best=best,
        motion=motion,
        predicted=predicted,
        centreline=centreline,
        chamfer_m2=distance_m2,
        predicted_chamfer_m2=predicted_m2,
        ahead=ahead,
    )
