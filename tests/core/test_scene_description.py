"""A rope stands in the world that is asked for; what is no rope has only its own."""

from dataclasses import replace
from typing import get_args

import pytest

from app.core.errors import UsageError
from app.core.geometry.scene_description import Rope, RopeModel, Stage
from app.tasks import load, names

STAGES = {name: load(name).stage for name in names()}
OF_ROPES = [name for name, stage in STAGES.items() if isinstance(stage.body, Rope)]


@pytest.mark.parametrize("world", get_args(RopeModel))
@pytest.mark.parametrize("name", OF_ROPES)
def test_a_stage_with_a_rope_has_it_in_either_world_and_is_else_the_same(name: str, world: RopeModel) -> None:
    stage = STAGES[name]
    there = stage.in_world(world)
    assert isinstance(stage.body, Rope)
    assert isinstance(there.body, Rope)
    assert there.body.model == world
    assert there == replace(stage, body=replace(stage.body, model=world))


@pytest.mark.parametrize("name", sorted(STAGES.keys() - set(OF_ROPES)))
def test_a_stage_without_a_rope_is_in_no_world_of_cables(name: str) -> None:
    assert STAGES[name].in_world("chain") == STAGES[name]
    with pytest.raises(UsageError, match="--world cable is of tasks with a rope"):
        STAGES[name].in_world("cable")


def test_a_rod_that_does_not_bend_is_a_chain_in_either_world() -> None:
    rope = STAGES["rope_push"]
    assert isinstance(rope.body, Rope)
    rod: Stage = replace(rope, body=replace(rope.body, rigid=True))
    assert rod.in_world("cable") == rod
