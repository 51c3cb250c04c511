"""In a world that has an effect, plans of the model that knows it come nearer to their goals, and as near as they say.

The world is our own simulator with few particles; its arm and cameras are written out here. A goal is where some push
of the very world would bring the rope, so that one push may come close to it.
"""

from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from functools import cache
from typing import Any, final

import jax.numpy as jnp
import numpy as np
import pytest

from app.config import Site
from app.core.geometry.chamfer import chamfer_m2
from app.core.messages import Extension, Model, Parameter
from app.core.motion import Motion
from app.core.types import Path3, Points
from app.jobs import jit_cache
from app.jobs.apparatus_compensation import correction
from app.jobs.worker_api import nominal_model
from app.planner.search.plan import Plan, TreePlanner
from app.planner.search.request import PlanRequest
from app.planner.search.tree import TreeConfig
from app.policy.base import PARKED_POSE
from app.sim.model.params import acting, index
from tests.planner.table import PARTICLES, SPACE, TASK, rope

Shift = tuple[float, float, float]
NOWHERE: Shift = (0.0, 0.0, 0.0)
FRICTION = 0.12
PROBLEMS = 5


@final
@dataclass(frozen=True, kw_only=True)
class World:
    """A table that leans by `tilt_deg` about x, a tip and a cloud that are elsewhere than told and shown [m]."""

    tilt_deg: float = 0.0
    tip: Shift = NOWHERE
    cloud: Shift = NOWHERE

    @property
    def phi(self) -> np.ndarray:
        phi = jit_cache.phi_of(nominal_model("rope_push"))
        phi[[index("table_friction"), index("tilt_x")]] = FRICTION, self.tilt_deg
        return phi

    def after(self, x: Points, told: Path3) -> Points:
        tool = SPACE.measured_path(told + np.array(self.tip))
        simulate = jit_cache.advance("rope_push", PARTICLES, acting(self.phi))
        return np.asarray(simulate(jnp.asarray(self.phi)[None], jnp.asarray(x)[None], jnp.asarray(tool)[None]))[0]

    def seen(self, x: Points) -> Points:
        return x + np.float32(self.cloud)


def erring(**apparatus: float) -> Model:
    return replace(
        nominal_model("rope_push"),
        apparatus=tuple(
            Parameter(name=name, value=value, unit="m", low=value, high=value) for name, value in apparatus.items()
        ),
        extension=Extension(camera_m=(0.55, -0.25, 0.95)),
    )


CASES: dict[str, tuple[World, Model | None]] = {
    # The tool points down: its y is against the world's.
    "tcp_offset": (World(tip=(0.0, -0.008, 0.0)), erring(tcp_y=0.008)),
    "hand_eye_translation": (World(cloud=(0.0, 0.008, 0.0)), erring(hand_eye_y=0.008)),
    "table_tilt, one way": (World(tilt_deg=5.0), None),
    "table_tilt, the other way": (World(tilt_deg=-5.0), None),
}


@cache
def planner(tilted: bool) -> TreePlanner:
    advance = jit_cache.action_simulator("rope_push", PARTICLES, acting(World(tilt_deg=float(tilted)).phi))
    search = TreeConfig(space=SPACE, policy=TASK.policy, weights=TASK.weights, advance=advance, branches=6, depth=1)
    return TreePlanner(search=search, descent=TASK.descent, gradient_steps=8)


def nominal_plan(world: World, model: Model | None, observed: Points, goal: Points, seed: int) -> Plan:
    return planner(tilted=False)(PlanRequest(observed=observed, goal=goal, phi=World().phi, seed=seed))


def extended_plan(world: World, model: Model | None, observed: Points, goal: Points, seed: int) -> Plan:
    tree = planner(tilted=world.tilt_deg != 0)
    request = PlanRequest(observed=observed, goal=goal, phi=world.phi, seed=seed)
    return tree(request) if model is None else correction(model).plan(tree, request)


@cache
def outcomes(name: str, plan: Callable[[World, Model | None, Points, Points, int], Plan]) -> np.ndarray:
    """The Chamfer distance to the goal after a push, and as it was predicted [m^2]: a row a problem."""
    (world, model), rows = CASES[name], list[tuple[float, float]]()
    for number in range(PROBLEMS):
        x = rope(0.0, 0.3 * number)
        action = SPACE.sample(np.random.default_rng(100 + number), x, PARKED_POSE, 1)[0]
        goal = replace(world, tip=NOWHERE).after(x, SPACE.motion(action, PARKED_POSE, Site()).positions)
        found = plan(world, model, world.seen(x), goal, number)
        reached = world.after(x, found.motion.positions)
        rows.append((float(chamfer_m2(reached, goal)), found.predicted_chamfer_m2))
    return np.array(rows)


QUICK = "hand_eye_translation"
"""The others need programs of their own: for them `make test-slow`."""


def each(names: Iterable[str]) -> list[Any]:
    return [pytest.param(name, marks=[] if name == QUICK else pytest.mark.slow) for name in names]


@pytest.mark.parametrize("name", each(CASES))
def test_the_model_that_knows_what_is_wrong_predicts_what_its_pushes_come_to(name: str) -> None:
    off = [np.abs(np.diff(outcomes(name, plan))).mean() for plan in (nominal_plan, extended_plan)]
    assert off[1] < 0.6 * off[0]


@pytest.mark.parametrize("kind", each(["tcp_offset", "hand_eye_translation", "table_tilt"]))
def test_and_its_pushes_end_nearer_to_their_goals(kind: str) -> None:
    names = [name for name in CASES if name.startswith(kind)]
    reached = [sum(outcomes(name, plan)[:, 0].sum() for name in names) for plan in (nominal_plan, extended_plan)]
    assert reached[1] < 0.9 * reached[0]


def test_what_drifts_in_a_session_is_planned_with_as_it_was_at_its_end() -> None:
    drifting, constant = World().phi, World().phi
    drifting[index("friction_drift")] = 0.4
    constant[index("table_friction")] *= 1.2
    tool = SPACE.tool_path(
        jnp.asarray(SPACE.sample(np.random.default_rng(0), rope(), PARKED_POSE, 1)),
        jnp.asarray(PARKED_POSE, jnp.float32)[None],
    )
    ends = [
        jit_cache.advance("rope_push", PARTICLES, acting(phi))(jnp.asarray(phi)[None], jnp.asarray(rope())[None], tool)
        for phi in (drifting, constant)
    ]
    np.testing.assert_allclose(ends[0], ends[1], atol=5e-4)


def test_what_is_predicted_is_where_the_cameras_will_see_it_and_distances_are_the_true_ones() -> None:
    world, model = CASES["hand_eye_translation"]
    shown = extended_plan(world, model, world.seen(rope()), rope(0.05), 0)
    x = correction(erring(hand_eye_y=0.008)).unproject(world.seen(rope()))
    true = planner(tilted=False)(PlanRequest(observed=x, goal=rope(0.05), phi=world.phi))
    np.testing.assert_allclose(shown.predicted, world.seen(true.predicted), atol=1e-6)
    np.testing.assert_allclose(shown.branches[1].final, world.seen(true.branches[1].final), atol=1e-6)
    assert shown.predicted_chamfer_m2 == true.predicted_chamfer_m2
    assert shown.chamfer_m2 == true.chamfer_m2


def test_a_motion_is_checked_as_the_arm_is_told_it() -> None:
    """The command that leaves the workspace is none of the plan's."""
    gone = Motion(positions=np.full((2, 3), 9.0), speeds=np.ones(2))
    told = list[Motion]()

    def command(motion: Motion, before: Points, after: Points) -> Motion:
        told.append(motion)
        return gone if len(told) == 1 else motion

    found = planner(tilted=False)(PlanRequest(observed=rope(), goal=rope(0.05), phi=World().phi, command=command))
    assert len(told) == 2  # The cheapest, whose command leaves the workspace, and the next one.
    assert found.branches[found.best].cost_after > min(branch.cost_after for branch in found.branches)
    assert found.motion is told[-1]
