"""Jobs of a task apply a model's errors of cameras and arm; with a small planner."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest

from app.calibration.fit import FitSettings
from app.core.messages import Extension, Model, Parameter, Transition, fresh_id
from app.jobs import jit_cache
from app.jobs.worker_api import calibrate, nominal_model, plan, shown_goal, update
from app.planner.search.request import PlanRequest
from tests.planner.table import PHI, planner, rope
from tests.tasks.test_apparatus_compensation import transition

SHIFT = np.float32([0.0, 0.006, 0.0])
MODEL = replace(
    nominal_model("rope_push"),
    apparatus=(Parameter(name="hand_eye_y", value=0.006, unit="m", low=0.005, high=0.007),),
    extension=Extension(camera_m=(0.55, -0.25, 0.95)),
)


@pytest.fixture
def small(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(jit_cache, "planner", lambda *_: planner())


@pytest.mark.usefixtures("small")
def test_a_plan_is_made_for_the_object_where_it_is() -> None:
    found = plan("rope_push", "cpu", rope() + SHIFT, rope(0.05), MODEL, 0)
    true = planner()(PlanRequest(observed=rope(), goal=rope(0.05), phi=PHI))
    # The simulator is told of places that differ by a rounding error.
    np.testing.assert_allclose(found.motion.positions, true.motion.positions, atol=1e-3)
    assert found.chamfer_m2 == pytest.approx(true.chamfer_m2, rel=1e-4)


@pytest.mark.usefixtures("small")
def test_a_model_that_says_nothing_of_cameras_and_arm_plans_as_ever() -> None:
    found = plan("rope_push", "cpu", rope(), rope(0.05), nominal_model("rope_push"), 0)
    assert found.motion.digest() == planner()(PlanRequest(observed=rope(), goal=rope(0.05), phi=PHI)).motion.digest()


@pytest.mark.parametrize("job", [calibrate, update])
def test_a_model_learns_from_what_really_happened(job: object, monkeypatch: pytest.MonkeyPatch) -> None:
    learnt = list[Transition]()

    def calibrated(
        task: str, preset: str, transitions: Sequence[Transition], model: Model, settings: FitSettings
    ) -> jit_cache.Calibrated:
        learnt.extend(transitions)
        return jit_cache.Calibrated(replace(model, id=fresh_id("model")), (), (), ())

    monkeypatch.setattr(jit_cache, "calibrate_model", calibrated)
    seen = transition(measured=True)
    assert callable(job)
    new = job("rope_push", "cpu", [seen], MODEL)
    np.testing.assert_allclose(learnt[0].before, seen.before - SHIFT, atol=1e-6)
    assert new.apparatus == MODEL.apparatus


def test_the_goal_is_shown_where_the_cameras_would_see_it() -> None:
    np.testing.assert_allclose(shown_goal(rope(), MODEL), rope() + SHIFT, atol=1e-6)
    np.testing.assert_array_equal(shown_goal(rope(), nominal_model("rope_push")), rope())
