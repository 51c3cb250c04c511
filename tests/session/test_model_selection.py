"""Models that an operator asks for: what is used of them, and what is refused."""

from dataclasses import replace

import numpy as np
import pytest

from app.core.announcer import MessageBus
from app.core.dialogue.requests import ModelRequest
from app.core.dialogue.summary import Summary
from app.core.messages import Extension, Model, Parameter, Particles, fresh_id
from app.jobs.jit_cache import nominal_model
from app.policy.base import PARKED_POSE
from app.session.model_updates import Modelling
from app.session.planning import is_reached
from app.session.state import ChosenModel
from app.tasks.elements.success import Beyond
from tests.session.cell import MemoryLog, Watcher, small_wish
from tests.session.virtual import InsideWorker, VirtualClock

pytestmark = [pytest.mark.anyio, pytest.mark.usefixtures("virtual_time")]

TASK = "rope_push"
NOMINAL = nominal_model(TASK)
GOAL = np.array([[0.5, 0.1, 0.01], [0.6, 0.0, 0.01]], np.float32)


def changed(**values: float) -> Model:
    parameters = tuple(
        replace(each, value=values[each.name], low=values[each.name], high=values[each.name])
        if each.name in values
        else each
        for each in NOMINAL.parameters
    )
    return replace(NOMINAL, id=fresh_id("model"), version=1, parameters=parameters, loss_m2=3e-5, transition_count=4)


async def asked(model: Model) -> tuple[ChosenModel | None, list[str]]:
    """Choice of a model, and the notices given meanwhile."""
    shown, clock = Watcher(), VirtualClock()
    async with InsideWorker("planner") as planner:
        announcer = MessageBus(operator=shown, recorder=MemoryLog(), clock=clock, summary=Summary())
        request = ModelRequest(
            id=fresh_id("model-request"), time_s=1.0, operator="client 2", model=model, source="version 1"
        )
        modelling = Modelling(TASK, planner, announcer, clock)
        return await modelling.chosen_model(request, NOMINAL, GOAL), shown.notices()


async def test_an_earlier_version_comes_back_as_a_new_model_with_its_parameters() -> None:
    old = changed(stiffness=3e4)
    chosen, notices = await asked(old)
    assert chosen is not None
    assert chosen.model.parameters == old.parameters
    assert (chosen.model.loss_m2, chosen.model.transition_count) == (3e-5, 4)
    assert chosen.model.id != old.id
    assert {old.id, chosen.request.id} == set(chosen.model.cause)
    assert (chosen.shown_goal, chosen.compiling, notices) == (None, "", [])


async def test_a_model_that_cannot_be_is_refused_in_words() -> None:
    chosen, (notice,) = await asked(changed(stiffness=9e9))
    assert chosen is None
    assert "The model of version 1 is not used: " in notice
    assert "outside its range" in notice


async def test_a_model_of_another_task_is_refused() -> None:
    chosen, (notice,) = await asked(replace(NOMINAL, task="bean_sweep"))
    assert chosen is None
    assert "of task 'bean_sweep', not of 'rope_push'" in notice


async def test_other_effects_are_announced_since_the_planner_has_to_compile_them() -> None:
    chosen, notices = await asked(changed(film_drag=0.1))
    assert chosen is not None, notices
    assert "compiles anew" in chosen.compiling


async def test_where_cameras_err_the_goal_is_as_they_will_show_it() -> None:
    tilted = replace(
        changed(),
        apparatus=(Parameter(name="hand_eye_x", value=0.004, unit="m", low=0.003, high=0.005),),
        extension=Extension(camera_m=(0.5, 0.0, 0.6)),
    )
    chosen, notices = await asked(tilted)
    assert chosen is not None, notices
    assert chosen.shown_goal is not None
    assert 0 < np.abs(chosen.shown_goal - GOAL).max() < 0.01


@pytest.mark.parametrize(("shown_m", "reached"), [(0.0, True), (0.02, False)])
async def test_the_goal_is_reached_where_the_object_truly_is_there(shown_m: float, reached: bool) -> None:
    """A model of cameras that show it 2 cm farther on knows that it is not there yet."""
    errs = Parameter(name="hand_eye_x", value=shown_m, unit="m", low=shown_m, high=shown_m)
    model = replace(NOMINAL, apparatus=(errs,) if shown_m else (), extension=Extension(camera_m=(0.5, 0.0, 0.6)))
    config = small_wish()
    config = replace(config, task=replace(config.task, stop_when=Beyond(x_m=0.5, enough=0.5)))
    seen = np.random.default_rng(0).uniform(0.505, 0.515, (60, 3)).astype(np.float32)
    observed = Particles(id=fresh_id("particles"), time_s=1.0, positions=seen, surface=seen[:0], reconstruction_s=0.0)
    async with InsideWorker("planner") as planner:
        assert await is_reached(planner, config, observed, model, PARKED_POSE) is reached
