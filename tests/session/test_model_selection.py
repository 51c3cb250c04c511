"""Models that an operator asks for: what is used of them, how they are numbered, and what is refused."""

from dataclasses import replace

import numpy as np
import pytest

from app.core.announcer import MessageBus
from app.core.dialogue.requests import ModelRequest
from app.core.dialogue.summary import Summary
from app.core.messages import Extension, Model, Notice, Parameter, fresh_id
from app.jobs.jit_cache import nominal_model
from app.session.model_updates import Modelling, Taken
from tests.session.cell import MemoryLog, Watcher
from tests.session.virtual import InsideWorker, VirtualClock

pytestmark = [pytest.mark.anyio, pytest.mark.usefixtures("virtual_time")]

TASK = "rope_push"
NOMINAL = nominal_model(TASK)
GOAL = np.array([[0.5, 0.1, 0.01], [0.6, 0.0, 0.01]], np.float32)


class Shown(Watcher):
    """One of whom there is one notice in the end."""

    @property
    def said(self) -> str:
        (notice,) = self.seen
        assert isinstance(notice, Notice)
        return notice.text


def changed(**values: float) -> Model:
    parameters = tuple(
        replace(each, value=values[each.name], low=values[each.name], high=values[each.name])
        if each.name in values
        else each
        for each in NOMINAL.parameters
    )
    return replace(NOMINAL, id=fresh_id("model"), version=1, parameters=parameters, loss_m2=3e-5, transition_count=4)


async def asked(model: Model, *, newest: int = 6) -> tuple[Taken | None, Shown]:
    shown = Shown()
    async with InsideWorker("planner") as planner:
        announcer = MessageBus(operator=shown, recorder=MemoryLog(), clock=VirtualClock(), summary=Summary())
        modelling = Modelling(TASK, announcer, planner)
        current = modelling.numbered(replace(NOMINAL, version=newest))
        request = ModelRequest(
            id=fresh_id("model-request"), time_s=1.0, operator="client 2", model=model, source="version 1"
        )
        return await modelling.taken(request, current, GOAL, now_s=9.0), shown


async def test_an_earlier_version_comes_back_as_a_new_one_with_its_parameters() -> None:
    old = changed(stiffness=3e4)
    taken, shown = await asked(old)
    assert taken is not None
    assert taken.model.version == 7
    assert taken.model.parameters == old.parameters
    assert (taken.model.loss_m2, taken.model.transition_count) == (3e-5, 4)
    assert taken.model.id != old.id
    assert old.id in taken.model.cause
    assert taken.shown_goal is None
    assert shown.said == "client 2 chose the model of version 1; it is version 7 now."


async def test_a_model_that_cannot_be_is_refused_in_words() -> None:
    taken, shown = await asked(changed(stiffness=9e9))
    assert taken is None
    assert "The model of version 1 is not used: " in shown.said
    assert "outside its range" in shown.said


async def test_a_model_of_another_task_is_refused() -> None:
    taken, shown = await asked(replace(NOMINAL, task="bean_sweep"))
    assert taken is None
    assert "of task 'bean_sweep', not of 'rope_push'" in shown.said


async def test_other_effects_are_announced_since_the_planner_has_to_compile_them() -> None:

    taken, shown = await asked(changed(film_drag=0.1))
    assert taken is not None, shown.said
    assert "compiles anew" in shown.said


async def test_where_cameras_err_the_goal_is_as_they_will_show_it() -> None:
    tilted = replace(
        changed(),
        apparatus=(Parameter(name="hand_eye_x", value=0.004, unit="m", low=0.003, high=0.005),),
        extension=Extension(camera_m=(0.5, 0.0, 0.6)),
    )
    taken, shown = await asked(tilted)
    assert taken is not None, shown.said
    assert taken.shown_goal is not None
    assert 0 < np.abs(taken.shown_goal - GOAL).max() < 0.01


async def test_numbers_only_grow_and_the_first_model_keeps_its_own() -> None:
    modelling = Modelling(
        TASK,
        MessageBus(operator=Shown(), recorder=MemoryLog(), clock=VirtualClock(), summary=Summary()),
        InsideWorker("planner"),
    )
    assert modelling.numbered(replace(NOMINAL, version=4)).version == 4
    assert modelling.numbered(replace(NOMINAL, version=5)).version == 5
    assert modelling.numbered(replace(NOMINAL, version=2)).version == 6
    assert modelling.numbered(replace(NOMINAL, version=5)).version == 7
