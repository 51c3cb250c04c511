"""Liquids: what is compared of them, the causes they are asked about, and what a camera's error does to a level."""

import math

import numpy as np
import pytest

from app.core.geometry.bowls import cap_depth_m
from app.discovery.checks.soundness import model_limits
from app.discovery.dataset.model_under_test import Subject, catalogue
from app.discovery.dataset.object_kinds import CLOTH, GRAINS, ROPE
from app.discovery.residuals.poured_contents import CONTENTS, WHOLE_M
from app.discovery.residuals.poured_rows import assemble_contents
from app.discovery.residuals.predict import Predictor
from app.discovery.residuals.simulation_batch import PushParticles, prepare
from app.discovery.residuals.steppers import chunks
from app.perception.body.resample import resample
from app.perception.body.vessels import Pool
from tests.discovery.pours import BOWLS, COUNT, SOUP, SUBJECT, TASK, study_of, water


def test_causes_of_the_table_are_not_asked_about_and_those_of_liquids_are() -> None:
    causes = {cause.name for cause in SUBJECT.catalogue().causes}
    assert {"liquid_viscosity", "shear_thinning", "adhesion", "table_tilt", "tcp_offset", "command_delay"} <= causes
    assert not causes & {"friction_map", "stribeck", "cohesion", "mass_heterogeneity", "mask_erosion", "draught"}


def test_soup_is_asked_about_its_pieces_as_well_and_nothing_else_is() -> None:
    water, soup = ({cause.name for cause in each.catalogue().causes} for each in (SUBJECT, SOUP))
    assert soup - water == {"piece_stiffness"}
    assert "fill_level" in water < soup
    solids = {cause.name for kind in (ROPE, GRAINS, CLOTH) for cause in catalogue(kind=kind).causes}
    assert not solids & {"piece_stiffness", "fill_level"}


@pytest.mark.parametrize("share", [0.0, 0.25, 1.0])
def test_the_share_of_a_liquid_in_the_bowl_that_stands_is_counted_and_can_be_another(share: float) -> None:
    points = water(share, np.array([0.42, 0.05, 0.144]))
    assert BOWLS.share(points) == pytest.approx(share, abs=1e-6)
    assert BOWLS.share(BOWLS.with_share(points, 0.6)) == pytest.approx(0.6, abs=2 / COUNT)
    assert BOWLS.share(BOWLS.with_share(points, share)) == pytest.approx(share, abs=1e-6)


@pytest.mark.parametrize("more", [0.0, 0.1, 0.25])
def test_a_level_above_that_of_all_that_was_said_tells_how_much_there_is(more: float) -> None:
    vessel = TASK.perception.standing[0]
    level_m = vessel.place_m[2] - vessel.radius_m + cap_depth_m((1 + more) * BOWLS.volume_m3, vessel.radius_m)
    seen = resample(Pool(vessel=vessel, level_m=level_m).points(0.003), COUNT, seed=0)
    assert BOWLS.share(seen) == 1.0
    assert BOWLS.seen_share(seen) == pytest.approx(1 + more, abs=0.03)
    near_rim = seen.copy()
    near_rim[0] = np.add(BOWLS.place_m, (0.0585, 0.0, 0.0025))
    assert BOWLS.share(near_rim) == 1.0
    for points in (seen, near_rim, water(0.2, np.array([0.42, 0.05, 0.144]))):
        assert BOWLS.seen_share(BOWLS.with_share(points, 1 + more)) == pytest.approx(1 + more, abs=0.005)


def test_a_pour_in_which_nothing_is_held_says_nothing() -> None:
    trials = prepare(study_of((0.3, 1.0), (1.0, 1.0)), SUBJECT)
    clouds = PushParticles(trials.observed.during, trials.observed.after)
    found = assemble_contents(trials, BOWLS, clouds, [(clouds, clouds)], [1.0], [])
    assert found.known[:, CONTENTS:].ravel().tolist() == [True, False]
    assert not any("could be simulated" in limit.text for limit in model_limits(trials, found))


@pytest.mark.parametrize("x", [0.52, 0.55])
def test_water_in_a_bowl_that_is_held_over_the_other_is_not_poured(x: float) -> None:
    held_m = np.array([x, 0.0, 0.144])
    points = water(0.0, held_m)
    assert np.linalg.norm(points - BOWLS.place_m, axis=1).min() < BOWLS.radius_m
    assert BOWLS.share(points) == 0.0
    assert BOWLS.holds(points, held_m).all()
    assert BOWLS.share(water(0.25, held_m)) == pytest.approx(0.25, abs=1e-6)


def test_what_is_compared_is_how_much_more_was_poured_than_was_predicted() -> None:
    trials = prepare(study_of((0.0, 0.3), (0.3, 0.7)), SUBJECT)
    place = np.array([0.42, 0.05, 0.144])

    def both(first: float, second: float) -> PushParticles:
        clouds = np.stack([water(first, place), water(second, place)])
        return PushParticles(clouds, clouds)

    lost = both(0.2, 0.7)
    lost.after[1] = np.nan
    ends = [(both(0.4, 0.8), both(0.2, 0.7)), (lost, lost)]
    found = assemble_contents(trials, BOWLS, both(0.2, 0.6), ends, [2.0, 1.0], [both(0.3, 0.6)])
    after = slice(CONTENTS, 2 * CONTENTS)
    assert found.r[:, after].ravel() == pytest.approx([WHOLE_M * 0.05, WHOLE_M * 0.1], abs=1e-3)
    assert found.J[:, after, 0].ravel() == pytest.approx([WHOLE_M * 0.1, WHOLE_M * 0.05], abs=1e-3)
    assert not found.J[:, after, 1].any()
    assert found.known[:, after].all()
    assert not found.known[:, :CONTENTS].any()


def test_a_camera_that_sees_too_high_sees_more_poured_as_far_as_it_did_not_before() -> None:
    trials, known = prepare(study_of((0.0, 0.3), (0.3, 0.3)), SUBJECT), SUBJECT.catalogue()
    predictor, higher = Predictor(SUBJECT, known), known.nominal(SUBJECT)
    higher[known.column("hand_eye_z")] = 0.003
    share, same = (BOWLS.share(predictor.observe_level(trials, k, trials.observed.after[k], higher)) for k in range(2))
    # The level of 36 ml is 43 mm below the rim's plane: about 57 square centimetres, of which 3 mm are 17 ml.
    assert share == pytest.approx(0.3 + 0.14, abs=0.03)
    assert same == pytest.approx(0.3, abs=2 / COUNT)


@pytest.mark.parametrize("subject", [SUBJECT, SOUP], ids=["water", "soup"])
def test_as_many_pours_are_simulated_at_once_as_four_gigabytes_hold(subject: Subject) -> None:
    nodes = math.prod(subject.scene.shape)
    sizes = chunks(subject, "gpu")
    assert sizes == (256, 512)
    assert sizes[-1] * nodes * 4 * 13 < 4e9  # Thirteen numbers a node.


def test_models_that_differ_in_cameras_and_in_what_the_arm_measures_are_one_simulation() -> None:
    trials, known = prepare(study_of((0.0, 0.3)), SUBJECT), SUBJECT.catalogue()
    predictor, plain = Predictor(SUBJECT, known), known.nominal(SUBJECT)
    seen, late, moved = plain.copy(), plain.copy(), plain.copy()
    seen[known.column("depth_bias")] = 0.004
    late[known.column("command_delay")] = 0.1
    moved[known.column("tcp_x")] = 0.003
    fuller = plain.copy()
    fuller[known.column("fill_level")] = 0.1
    jobs = [(q, 0) for q in range(5)]
    alike = predictor.group_alike(trials, jobs, [plain, seen, late, moved, fuller])
    assert dict(alike) == {(0, 0): jobs[:3], (3, 0): jobs[3:4], (4, 0): jobs[4:]}


def test_what_fell_beside_the_bowl_is_not_poured_once_more() -> None:
    place = np.array([0.42, 0.05, 0.144])
    trials, known = prepare(study_of((0.0, 0.5), (0.8, 0.8)), SUBJECT), SUBJECT.catalogue()
    predictor, lossy = Predictor(SUBJECT, known), known.nominal(SUBJECT)
    lossy[known.column("spilt")] = 1.0  # A tenth of what stands: 0.08 of the 0.2 that seem to be held.
    seen = [
        BOWLS.share(predictor.observe_level(trials, k, water(after, place), lossy)) for k, after in ((0, 0.5), (1, 0.9))
    ]
    assert seen == [pytest.approx(0.5, abs=2 / COUNT), pytest.approx(0.8 + 0.1 * 0.6, abs=2 / COUNT)]


@pytest.mark.parametrize("more", [-0.2, 0.0, 0.2])
def test_a_fuller_bowl_begins_fuller_and_all_of_it_is_seen_in_the_end(more: float) -> None:
    place = np.array([0.42, 0.05, 0.144])
    before, after = water(0.3, place), water(1.0, place)
    filled = BOWLS.fill(before, place, more)
    held = ~BOWLS.inside(before)
    assert np.array_equal(filled[~held], before[~held])
    assert BOWLS.holds(filled[held], place).all()
    assert np.sign((filled[held] - before[held])[:, 2].mean()) == np.sign(more)
    trials, known = prepare(study_of((0.3, 1.0)), SUBJECT), SUBJECT.catalogue()
    theta = known.nominal(SUBJECT)
    theta[known.column("fill_level")] = more
    shown = BOWLS.seen_share(Predictor(SUBJECT, known).observe_level(trials, 0, after, theta))
    # The level in the bowl is that of all there is, also where that is more than was said.
    assert shown == pytest.approx(1.0 + more, abs=2 / COUNT)
