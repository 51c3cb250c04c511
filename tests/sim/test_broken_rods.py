"""Bad input of rods is named by candidate, step and place; a rod that breaks is dissected, and its dump replays it."""

import json
import re
from dataclasses import replace
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from app.core.errors import ParameterError, RecordingError, SimulationError, UsageError
from app.sim.diagnosis.checked import checked_rods
from app.sim.diagnosis.dump import Dump, leave_dump, load_dump, save_dump
from app.sim.diagnosis.faults import KEPT
from app.sim.diagnosis.rod_failure_diagnosis import RodCase, dissect_rod
from app.sim.effects.base import Effect
from app.sim.model.catalogue import discover
from app.sim.rods.checks import RodSetup, require_rod_inputs
from app.sim.rods.domain import ROOM_M
from app.sim.rods.geometry.verdict import crossings
from app.sim.rods.rollout import make_rod_rollout, make_rod_trace
from app.sim.rods.scene import Wall
from tests.sim.broken_rods import (
    SCENE,
    SETUP,
    STEPS,
    Given,
    case_of,
    is_first_bad_step,
    path,
    problem,
    simulated,
    straight,
    too_stiff,
)


def refused(given: Given, setup: RodSetup = SETUP) -> str:
    with pytest.raises(ParameterError) as error:
        require_rod_inputs(setup, *given)
    return str(error.value)


def assert_nan(given: Given, candidate: int) -> None:
    """Check that the simulator's result is not finite for this candidate, and finite for the other."""
    whole = np.isfinite(np.asarray(simulated(given).nodes)).all((1, 2))
    assert whole.tolist() == [index != candidate for index in range(2)]


# Bad input.


def test_sound_input_is_accepted_and_stays_finite():
    given = problem()
    require_rod_inputs(SETUP, *given)
    assert_nan(given, -1)


@pytest.mark.parametrize(
    ("index", "said"),
    [
        ((1, 0, 17), "state.nodes is nan for candidate 1, node 17, component x"),
        ((0, 3, 5), "state.nodes is nan for candidate 0, node 5, component y velocity"),
        ((1, 7, 40), "state.nodes is nan for candidate 1, node 40, component lasting bend"),
    ],
)
def test_a_state_that_is_not_finite_is_named_by_candidate_node_and_row(index: tuple[int, ...], said: str):
    given = problem()
    given[2].nodes[index] = np.nan
    assert refused(given).startswith(said)
    assert_nan(given, index[0])


def test_a_path_a_parameter_and_a_particle_that_are_not_finite_are_named():
    given = problem()
    given[3][1, 7, 1] = np.inf
    assert "tool is inf for candidate 1, path point 7, component y" in refused(given)
    assert_nan(given, 1)
    given = problem()
    given[0].climb[0] = np.nan
    assert "physics is nan for candidate 0, component climb" in refused(given)
    given = problem()
    given[2].offset[1, 3, 2] = np.nan
    assert "state.offset is nan for candidate 1, particle 3, component up" in refused(given)


def test_a_finger_and_a_rope_beyond_the_room_are_named_with_their_place():
    given = problem()
    given[3][1, 50:, 0] = 2 * ROOM_M
    given[3][1, :, 2] = 0.3  # Above the rope it may be as fast as it likes.
    assert refused(given).startswith("The finger of candidate 1, at path point 50, is at (20, -0.02")
    assert "farther than 10 m from the origin" in refused(given)
    assert_nan(given, 1)
    given = problem()
    given[2].nodes[0, 0] += 2 * ROOM_M
    assert refused(given).startswith("Node 0 of candidate 0 is at (19.8, 0) m, farther than 10 m")
    assert_nan(given, 0)


def test_a_finger_that_would_pass_through_the_rope_is_named_with_its_step_place_and_speed():
    given = problem()
    given[3][1, 101:, 1] += 0.06
    said = refused(given)
    assert "The finger of candidate 1 goes from (0.02, -0.01, 0.006) to (0.02, 0.0502, 0.006) m in step 100" in said
    assert "60.2 m/s" in said
    assert_nan(given, 1)


def test_a_finger_may_jump_above_the_rope():
    given = problem()
    given[3][1, :101, 2] = 0.1
    given[3][1, :100, 0] = -0.2
    require_rod_inputs(SETUP, *given)
    assert_nan(given, -1)


def test_a_finger_that_begins_inside_the_rope_is_named_with_place_depth_and_segment():
    given = problem()
    given[3][0] = path((0.033, 0.002))
    assert "The finger of candidate 0 begins at (0.033, 0.002, 0.006) m, inside the rope: 2 mm" in refused(given)
    assert "segment 23, whose radius is 8 mm" in refused(given)


def test_the_bounds_are_those_of_the_simulator():
    """Input that the checks accept stays finite, and input that they refuse does not."""
    for change, sound in ((0.0079, True), (0.0081, False)):
        given = problem()
        given[3][1, 101:, 1] += np.float32(change - 0.2e-3)
        assert_accepted(given, sound=sound)
    for share, sound in ((0.49, True), (0.51, False)):
        given = problem()
        given[3][1, :, 2] = 0.3
        given[2].nodes[1] = given[2].nodes[0]
        given[2].nodes[1, 0, -1] += share * SCENE.rest_m
        with_one_step = (*given[:3], given[3][:, :2], given[4])
        assert_accepted(with_one_step, sound=sound)


def assert_accepted(given: Given, *, sound: bool) -> None:
    assert_nan(given, -1 if sound else 1)
    if sound:
        require_rod_inputs(SETUP, *given)
    else:
        assert "candidate 1" in refused(given)


def test_segments_that_are_stretched_at_the_start_are_named():
    given = problem()
    given[2].nodes[0, 0, 9:] += 0.006
    assert "Segment 8 of candidate 0, at (-0.12, 0) m, is +60 % longer than the 0.01 m" in refused(given)


@pytest.mark.parametrize(
    ("name", "value", "said"),
    [
        ("mass", 0.0, "physics.mass of candidate 1 is 0; it must be above 0."),
        ("table_friction", -0.1, "physics.table_friction of candidate 1 is -0.1; it must be at least 0."),
        ("rigidity", 1.0, "N m^2 at most; raise the scene's stiffest_n_m2."),
        ("permanent_set", 1.2, "physics.permanent_set of candidate 1 is 1.2, and it is a share of bends, 1 at most."),
    ],
)
def test_physics_that_cannot_be_are_named(name: str, value: float, said: str):
    given = problem()
    getattr(given[0], name)[1] = value
    assert said in refused(given)


def test_a_state_of_another_number_of_nodes_is_refused_by_checks_and_simulator():
    scene = replace(SCENE, spacing_m=0.02)
    assert scene.nodes != SCENE.nodes
    given = problem()
    said = refused(given, RodSetup(scene=scene, effects=()))
    assert f"state.nodes has shape (2, 8, {SCENE.nodes}); this simulator takes (2, 8, {scene.nodes})" in said
    physics, _, state, tool, _ = jax.tree.map(jnp.asarray, given)
    for make in (make_rod_rollout, make_rod_trace):
        with pytest.raises(ParameterError, match=rf"The rod has {SCENE.nodes} nodes and its scene {scene.nodes}; make"):
            make(scene)(physics, state, tool)


def test_phi_outside_its_range_is_named():
    setup = RodSetup(scene=SCENE, effects=(discover()["table_tilt"],))
    physics, _, state, tool, setting = problem()
    phi = np.zeros((2, len(setup.specs())), np.float32)
    require_rod_inputs(setup, physics, phi, state, tool, setting)
    phi[1, 0] = 1e3
    assert "Candidate 1: tilt_x = 1000 is outside its range" in refused((physics, phi, state, tool, setting), setup)


# Autopsies.


def test_the_states_on_the_way_are_those_of_the_simulator():
    given = problem()
    physics, phi, state, tool, setting = jax.tree.map(jnp.asarray, given)
    history = make_rod_trace(SCENE)(physics, state, tool, phi, setting)
    assert history.nodes.shape == (2, STEPS + 1, 8, SCENE.nodes)
    assert np.array_equal(history.nodes[:, 0], state.nodes)
    for steps in (1, 77, STEPS):
        end = simulated((*given[:3], given[3][:, : steps + 1], given[4]))
        assert np.array_equal(history.nodes[:, steps], end.nodes)


def test_a_sound_push_is_said_to_be_finite_throughout():
    for candidate in range(2):
        found = dissect_rod(case_of(problem(), candidate))
        assert found.verdict() == f"Finite throughout ({STEPS} steps)."
        assert (found.failed, found.faults, found.until) == (None, (), STEPS)
    assert found.trace.gap_m.min() > 0.012
    assert found.trace.energy_j[0] == 0.0


def test_a_rope_that_is_too_stiff_for_its_steps_is_dissected_to_the_step_and_its_segment():
    case = too_stiff()
    found = dissect_rod(case)
    assert found.failed is None
    assert is_first_bad_step(case, None)
    kinds = {fault.kind: fault for fault in found.faults}
    assert kinds["energy"].step < kinds["stretched"].step == 5
    assert re.search(r"After 5 steps segment 0 at \(.*\) m is \+166 % longer than at rest\.", found.verdict())
    assert found.objection is not None
    assert "raise the scene's stiffest_n_m2" in found.objection


def test_a_rope_that_overflows_is_dissected_to_the_step_and_its_node():
    given = problem()
    given[2].nodes[0, 3, 20] = 3e38
    found = dissect_rod(case_of(given))
    assert is_first_bad_step(case_of(given), 1)
    assert found.failed == found.until + 1 == 1
    assert "After 1 step node " in found.verdict()
    assert (found.faults[0].kind, found.faults[0].index) == ("too fast", 20)


def test_energy_is_the_one_that_the_rope_was_given():
    given = problem(path(speed_m_s=0.0, start=(0.0, -0.1)))
    given[2].nodes[0, 3] = 0.5
    found = dissect_rod(case_of(given))
    assert found.trace.energy_j[0] == pytest.approx(0.064 * 0.5**2 / 2)
    slid = found.last.nodes[-1, 1].mean() - given[2].nodes[0, 1].mean()
    lost = found.trace.energy_j[0] - found.trace.energy_j[-1]
    assert lost == pytest.approx(0.5 * 0.064 * 9.81 * slid, rel=0.03)
    assert "energy" not in {fault.kind for fault in found.faults}


def test_a_finger_that_jumps_over_the_rope_is_told_with_the_segment_and_where_it_went():
    given = problem()
    given[3][0, 101:, 1] += 0.06
    found = dissect_rod(case_of(given))
    assert found.failed == 101
    assert is_first_bad_step(case_of(given), 101)
    (fault,) = [each for each in found.faults if each.kind == "passed through"]
    assert (fault.step, fault.index) == (101, 22)
    assert "segment 22 is on the other side of the finger, which went to (0.02, 0.0502, 0.006) m" in fault.words
    assert found.verdict().count("The input is wrong: The finger of candidate 0 goes from") == 1


def test_a_flat_finger_that_jumps_over_the_rope_with_an_end_alone_is_told():
    """Its middle is beyond the end of the rope."""
    end = SCENE.rest_m * (SCENE.nodes // 2)
    given = problem(path((end + 0.02, -0.03)))
    given[0].finger_half_width[0] = 0.03
    given[3][0, 101:, 1] += 0.06
    (fault,) = [each for each in dissect_rod(case_of(given)).faults if each.kind == "passed through"]
    assert (fault.step, fault.index) == (101, SCENE.nodes - 2)


def test_a_finger_that_begins_inside_is_told_first():
    given = problem()
    given[3][0] = path((0.033, 0.002))
    found = dissect_rod(case_of(given))
    assert "The input is wrong: The finger of candidate 0 begins at" in found.verdict()
    first, second = found.faults[:2]
    assert (first.kind, first.step, first.index) == ("starts pressed", 0, 23)
    assert (second.kind, second.step, second.index) == ("finger inside", 0, 23)


def test_a_finger_that_begins_pressed_into_the_rope_is_told_by_how_much_and_the_rope_springs_aside():
    """Contact begins 15.5 mm from the centreline; less than that by 2.5 mm is accepted, and moves the rope by 13."""
    given = problem(path((0.02, -0.013), 0.0, 1000))
    require_rod_inputs(SETUP, *given)
    found = dissect_rod(case_of(given))
    assert found.failed is None
    (fault,) = found.faults
    assert (fault.kind, fault.step, fault.index) == ("starts pressed", 0, 21)
    assert "(0.02, -0.013, 0.006) m is 2.49 mm in what it should touch" in fault.words
    moved = np.linalg.norm(found.last.nodes[-1, :2] - given[2].nodes[0, :2], axis=0).max()
    assert moved > 0.005


def test_a_rope_that_crosses_itself_is_told_with_the_segments():
    turn = np.pi / 8 * np.clip(np.arange(SCENE.nodes - 1) - 11, 0, 12)  # Three quarters of a circle.
    steps = np.stack([np.cos(turn), np.sin(turn)]) * SCENE.rest_m
    line = np.concatenate([np.zeros((2, 1)), np.cumsum(steps, axis=1)], axis=1)
    pairs = crossings(line.T)
    assert len(pairs)
    given = problem(path(start=(0.5, 0.5)), (line, straight()))
    found = dissect_rod(case_of(given))
    (fault,) = [each for each in found.faults if each.kind == "crossing"]
    assert (fault.step, fault.index) == (0, pairs[0, 0])
    assert f"crosses segment {pairs[0, 1]}" in fault.words
    assert dissect_rod(case_of(given, 1)).faults == ()


def test_input_that_is_not_finite_fails_before_the_first_step():
    given = problem()
    given[2].nodes[0, 2, 5] = np.nan
    found = dissect_rod(case_of(given))
    assert found.failed == 0
    assert "node 5 has no finite x velocity" in found.verdict()
    given = problem()
    given[3][1, 9] = np.nan
    found = dissect_rod(case_of(given, 1))
    assert (found.failed, len(found.trace)) == (0, 0)
    assert "tool is nan for candidate 0, path point 9" in found.verdict()
    given = problem()
    given[2].offset[1, 3, 2] = np.nan
    found = dissect_rod(case_of(given, 1))
    assert (found.failed, len(found.trace)) == (0, 0)
    assert "state.offset is nan for candidate 0, particle 3, component up" in found.verdict()


def test_the_last_states_are_those_of_the_simulator():
    case = case_of(problem())
    found = dissect_rod(case)
    assert len(found.last.nodes) == KEPT
    for back in (1, 3):
        steps = found.until + 1 - back
        end = simulated((case.physics, case.phi, case.state, case.tool[:, : steps + 1], case.setting))
        assert np.array_equal(found.last.nodes[-back], end.nodes[0])


def test_a_checked_simulator_names_the_node_and_leaves_a_dump(tmp_path: Path):
    simulate = checked_rods(SETUP, tmp_path)
    physics, phi, state, tool, setting = problem()
    end = simulate(*jax.tree.map(jnp.asarray, (physics, state, tool, phi, setting)))
    assert np.array_equal(end.nodes, simulated((physics, phi, state, tool, setting)).nodes)
    state.nodes[1, 3, 20] = 3e38
    with pytest.raises(SimulationError, match=r"^Candidate 1 of 2: Not finite from step 1 on") as error:
        simulate(*jax.tree.map(jnp.asarray, (physics, state, tool)))
    (file,) = tmp_path.iterdir()
    assert f"`dipac replay {file}` shows it." in str(error.value)
    state.nodes[1, 3, 20] = 200.0
    with pytest.raises(SimulationError, match=r"^Candidate 1 of 2: Finite .* segment \d+ at .* % longer than at rest"):
        simulate(*jax.tree.map(jnp.asarray, (physics, state, tool[:, :5])))
    tool[1, 5] = np.nan
    with pytest.raises(ParameterError, match="tool is nan for candidate 1, path point 5"):
        simulate(*jax.tree.map(jnp.asarray, (physics, state, tool)))


# Dumps.


def test_a_dump_comes_back_bit_by_bit(tmp_path: Path):
    case = too_stiff()
    save_dump(tmp_path / "case.npz", Dump(case=case, about="a test"))
    loaded = load_dump(tmp_path / "case.npz")
    assert isinstance(loaded.case, RodCase)
    assert loaded.about == "a test"
    assert loaded.case.setup == case.setup
    for name in ("physics", "phi", "state", "tool", "setting"):
        jax.tree.map(np.testing.assert_array_equal, getattr(loaded.case, name), getattr(case, name))
    assert loaded.case.dissect().verdict() == case.dissect().verdict()


def test_scenes_with_walls_shares_and_effects_come_back(tmp_path: Path):
    shares = tuple((SCENE.masses() / SCENE.mass_kg).tolist())
    scene = replace(
        SCENE,
        walls=Wall.with_gap(x_m=0.6, gap_m=0.07, half_length_m=0.3, thickness_m=0.02),
        mass_shares=shares,
        stiffest_n_m2=0.1,
        tightest_m=0.011,
    )
    known = discover()
    setup = RodSetup(scene=scene, effects=tuple(effect for effect in known.values() if effect.rod is not None))
    physics, _, state, tool, setting = problem()
    case = case_of((physics, np.zeros((2, len(setup.specs())), np.float32), state, tool, setting), setup=setup)
    left = leave_dump(tmp_path / "new", Dump(case=case, about="many"))
    assert load_dump(left).case.setup == setup
    assert leave_dump(tmp_path / "new", Dump(case=case, about="many")) == left


def test_what_is_not_of_the_package_is_not_dumped(tmp_path: Path):
    own = replace(discover()["table_tilt"], reach_m=1.0)
    setup = RodSetup(scene=SCENE, effects=(own,))
    physics, _, state, tool, setting = problem()
    case = case_of((physics, np.zeros((2, len(setup.specs())), np.float32), state, tool, setting), setup=setup)
    assert isinstance(own, Effect)
    with pytest.raises(UsageError, match=r"The effect of tilt_x, tilt_y.* is not a file"):
        save_dump(tmp_path / "a.npz", Dump(case=case, about=""))
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda header: header.update(engine="springs"), "Unknown engine 'springs'.*mpm, rods"),
        (lambda header: header.update(engine="mpm"), "cannot be replayed"),
        (lambda header: header["scene"].update(colour="red"), "unexpected keyword argument 'colour'"),
        (lambda header: header["scene"].update(mass_kg=-1.0), "mass_kg"),
        (lambda header: header["scene"].update(walls=[{"class": "Door", "fields": {}}]), "Unknown class 'Door'"),
        (lambda header: header["scene"].update(spacing_m=0.02), r"state\.nodes has shape"),
        (lambda header: header.update(effects=["magic"]), "Unknown effect 'magic'"),
        (lambda header: header.update(parameters=["tilt_x"]), "its parameters are"),
    ],
)
def test_a_dump_that_this_version_cannot_replay_is_refused(change, said: str, tmp_path: Path):
    file = tmp_path / "case.npz"
    save_dump(file, Dump(case=case_of(problem()), about="a test"))
    with np.load(file) as arrays:
        entries = dict(arrays)
    header = json.loads(str(entries["header"]))
    change(header)
    np.savez(file, **(entries | {"header": np.array(json.dumps(header))}))
    with pytest.raises(RecordingError) as error:
        load_dump(file)
    assert re.search(said, str(error.value))
