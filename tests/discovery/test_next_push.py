"""Motions that may be made next, and the choice of the one that tells models apart."""

from dataclasses import replace

import numpy as np
import pytest

from app.core.types import OPENING
from app.discovery.dataset.study import Study
from app.discovery.experiments.candidate_motions import CandidateMotions, candidate_motions, motion_words
from app.discovery.experiments.next_push import next_push
from app.discovery.residuals.predict import Predictor
from app.discovery.residuals.simulation_batch import prepare
from app.perception.body.resample import resample
from app.policy.random_carries import HIGH_M, LOW_M
from app.tasks.elements.pouring import pool_points
from tests.discovery import pours
from tests.discovery.test_carried_cloth import SUBJECT as CLOTH
from tests.discovery.test_carried_cloth import hanging, study_of

CARRIES = study_of(hanging(), 2)


def of_pours(study: Study, count: int = 12) -> CandidateMotions:
    known = pours.SUBJECT.catalogue()
    return candidate_motions(pours.SUBJECT, known, study, count=count, height_m=0.0, seed=3)


def of_carries(count: int = 12) -> CandidateMotions:
    return candidate_motions(CLOTH, CLOTH.catalogue(), CARRIES, count=count, height_m=0.0, seed=3)


def test_pours_go_on_from_where_the_bowl_is_while_enough_is_left_in_it() -> None:
    study = pours.study_of((0.0, 0.2), (0.2, 0.45), pours=2)
    asked, last = of_pours(study), study.pushes[-1]
    assert not asked.anew
    assert asked.before.points is last.after.points
    for track in asked.tracks:
        assert track.positions[0] == pytest.approx(last.command.positions[-1])
        assert track.times_s[0] > last.after.time_s
    assert len({track.poses.tobytes() for track in asked.tracks}) == len(asked.tracks)


def test_the_next_pour_begins_with_all_of_the_liquid_where_little_is_left() -> None:
    study = pours.study_of((0.0, 0.4), (0.4, 0.9), pours=2)
    asked, first = of_pours(study), study.pushes[0]
    assert asked.anew
    assert asked.before.points is first.before.points
    assert asked.tracks[0].positions[0] == pytest.approx(first.command.positions[0])
    words = motion_words(asked.tracks[0], pours.SUBJECT, height_m=0.0, origin_m=(0.0, 0.0), anew=asked.anew)
    assert words.startswith("Fill the held bowl again. Tilt the bowl by ")


def test_a_soup_is_tilted_further_than_water_as_its_pieces_dam_the_lip() -> None:
    study = pours.study_of((0.0, 0.2), (0.2, 0.45), pours=2)
    soup = candidate_motions(pours.SOUP, pours.SOUP.catalogue(), study, count=12, height_m=0.0, seed=3)
    water = of_pours(study)

    def upright(asked: CandidateMotions) -> list[float]:
        """Share of the bowl's axis that points up where it is tilted most."""
        return [float((2 * (track.poses[:, 4] ** 2 + track.poses[:, 5] ** 2) - 1).min()) for track in asked.tracks]

    assert np.median(upright(soup)) < np.median(upright(water)) - 0.05


def test_carries_go_on_with_what_the_gripper_holds_in_the_box_of_random_ones() -> None:
    asked, last = of_carries(), CARRIES.pushes[-1]
    for track in asked.tracks:
        assert track.poses[0] == pytest.approx(last.command.poses[-1])
        assert (track.poses[:, OPENING] == last.command.poses[-1, OPENING]).all()
        ends = track.positions[-1]
        assert ((ends >= LOW_M) & (ends <= HIGH_M)).all()


def test_a_carry_is_told_by_the_places_where_it_rests_in_the_frame_of_the_data() -> None:
    track = of_carries().tracks[0]
    words = motion_words(track, CLOTH, height_m=0.0, origin_m=(1.0, 0.0))
    start, end = track.positions[0] + [1.0, 0.0, 0.0], track.positions[-1] + [1.0, 0.0, 0.0]
    assert words.startswith("Carry it from ({:.2f}, {:.2f}, {:.2f}) m to (".format(*start))
    assert "({:.2f}, {:.2f}, {:.2f}) m in ".format(*end) in words
    assert 3 <= words.count(") m") <= 4  # Two or three moves.


def test_a_pour_is_told_by_its_tilt_and_its_times() -> None:
    study = pours.study_of((0.0, 0.2))
    track = study.pushes[0].command
    words = motion_words(track, pours.SUBJECT, height_m=0.0, origin_m=(0.0, 0.0))
    tilt = float(words.split(" by ")[1].split(" degrees")[0])
    upright = track.poses[0, 3:7]
    turned = 2 * np.arccos(np.clip(np.abs(track.poses[:, 3:7] @ upright), 0, 1)).max()
    assert tilt == pytest.approx(np.degrees(turned), abs=0.6)


def test_the_pour_that_is_asked_for_tells_two_models_apart_by_amounts() -> None:
    (push,) = pours.study_of((0.0, 0.0)).pushes
    pool = resample(pool_points(pours.BOWLS.held_radius_m, pours.BOWLS.volume_m3, 8 * pours.COUNT), pours.COUNT, seed=0)
    full = replace(push.after, points=(pool + push.command.positions[-1]).astype(np.float32))
    study = replace(pours.study_of((0.0, 0.0)), pushes=(replace(push, after=full),))
    predictor = Predictor(pours.SUBJECT, pours.SUBJECT.catalogue())
    nominal = predictor.catalogue.nominal(pours.SUBJECT)
    thick = nominal.copy()
    thick[predictor.catalogue.column("liquid_viscosity")] = 8.0
    rivals = {"nothing missing": (0.5, nominal), "liquid_viscosity": (0.5, thick)}
    found = next_push(predictor, prepare(study, pours.SUBJECT), rivals, count=8, height_m=0.0)
    assert found is not None
    shares = [pours.BOWLS.share(end) for end in found.ends]
    assert found.apart_mm == pytest.approx(100 * abs(shares[0] - shares[1]), abs=0.01)
    assert found.apart_mm > 2.0
    assert found.text.endswith(f"differ by {found.apart_mm:.1f} % of the liquid.")


def test_one_model_alone_asks_for_nothing() -> None:
    study = pours.study_of((0.0, 0.2))
    predictor = Predictor(pours.SUBJECT, pours.SUBJECT.catalogue())
    alone = {"nothing missing": (1.0, predictor.catalogue.nominal(pours.SUBJECT))}
    assert next_push(predictor, prepare(study, pours.SUBJECT), alone, count=3, height_m=0.0) is None
