"""Full names of tasks: written, read, and refused."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from app.core.errors import UsageError
from app.core.task_name import Split, TaskName, recorded_name, same_model

names = st.from_regex(r"[a-z][a-z_]{0,10}", fullmatch=True)
sizes = st.dictionaries(names, st.floats(1e-3, 10).map(lambda value: float(f"{value:.6g}")), max_size=4)


@given(names, sizes, st.sampled_from(["mpm", "rods"]), st.sampled_from(["easy", "hard"]))
def test_what_is_written_is_read_again(problem: str, given_sizes: dict[str, float], dynamics: str, split: Split):
    name = TaskName.of(problem, given_sizes, dynamics, split)
    assert TaskName.parse(str(name)) == name


def test_a_split_is_named_where_it_is_hard():
    assert str(TaskName.of("rope_push", {"length_m": 0.3}, "rods", "hard")) == "rope_push-hard(length_m=0.3)@rods"
    assert TaskName.parse("rope_push").split == "easy"
    assert TaskName.parse("rope_push-harder").problem == "rope_push-harder"


def test_recordings_are_of_a_problem_and_its_sizes_and_not_of_dynamics():
    assert recorded_name("rope_push(radius_m=0.006)@rods") == "rope_push(radius_m=0.006)"
    assert recorded_name("rope_push@mpm") == recorded_name("rope_push@rods") == "rope_push"
    assert recorded_name("rope_push-hard@rods") == "rope_push-hard"


def test_models_are_of_sizes_and_dynamics_and_not_of_a_split():
    assert same_model("rope_push(radius_m=0.006)@rods", "rope_push-hard(radius_m=0.006)@rods")
    assert not same_model("rope_push@rods", "rope_push-hard(radius_m=0.006)@rods")
    assert not same_model("rope_push@rods", "rope_push-hard")
    assert same_model("rope_push@rods", "rope_push-hard", whole=False)
    assert not same_model("rope_push", "rod_to_rope-hard", whole=False)


def test_sizes_in_any_order_are_the_same_name():
    assert str(TaskName.parse("a(y=2,x=1)")) == "a(x=1,y=2)"


@pytest.mark.parametrize(
    "text", ["", "rope_push(", "rope_push(radius_m)", "rope_push(radius_m=thin)", "a@b@c", "a()b", "a(x=1,x=2)"]
)
def test_what_is_no_name_is_refused(text: str):
    with pytest.raises(UsageError, match="no name of a task"):
        TaskName.parse(text)
