"""Pushes are chosen for what they say about the causes that are left, are safe, and end when there is a reason."""

from collections.abc import Mapping
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from jaxtyping import Float64

from app.arm.gate import refusal
from app.config import KeepOut, Limits, Site
from app.core.errors import PlanningError
from app.core.geometry.track import Track
from app.discovery.dataset.model_under_test import catalogue
from app.discovery.dataset.study import ProjectionView
from app.discovery.experiments.probe import (
    NOTHING,
    Belief,
    belief_words,
    first_belief,
    gains_of,
    is_named,
    is_none_left,
    stop_of,
    weigh_gains,
)
from app.discovery.experiments.probe_pushes import (
    Candidate,
    PushSituation,
    best_of,
    candidates_of,
    choose,
    informations,
    moving,
)
from app.discovery.inference.weighing import Prior
from app.discovery.residuals.predict import Predictor
from app.discovery.residuals.sensitivity import Step
from app.jobs.discovery_subject import subject_of
from app.jobs.probed import probe_motion, scene
from app.policy.random_pushes import REGION, PushDesign, Stroke, stroke_through
from app.tasks import load
from app.tasks.elements.curves import fill_tube

TASK = load("rope_push@rods")
SUBJECT = subject_of(TASK)
FRICTION, FILM, TILT = range(3)


def belief(probabilities: Mapping[str, float], *, nothing: float, pushes: int = 16, episodes: int = 4) -> Belief:
    """Belief about three columns: Coulomb's friction, which is fitted whatever the cause, a film and a tilt."""
    steps = [Step(cause=cause, column=0, size=1.0, sides=2) for cause in ("table_friction", "viscous_film", "tilt")]
    return Belief(
        about=np.zeros(3),
        steps=tuple(steps),
        prior=Prior(mean=np.zeros(3), variance=np.array([100.0, 0.04, 0.04]), nuisance=(FRICTION,)),
        information=np.zeros((3, 3)),
        pull=np.zeros(3),
        pending=np.zeros((3, 3)),
        noise=(),
        causes={"viscous_film": (FILM,), "tilt": (TILT,)},
        probabilities=probabilities,
        nothing=nothing,
        pushes=pushes,
        episodes=episodes,
    )


def said_by(*slopes: float) -> Float64[np.ndarray, "3 3"]:
    """Information of a push that observes one number with these slopes, in units of its noise."""
    return np.outer(slopes, slopes)


def flat(stroke: Stroke) -> Candidate:
    return Candidate(stroke=stroke, track=stroke.track(start_s=1.0, height_m=0.006))


def stroke(speed_m_s: float = 0.1) -> Stroke:
    """A stroke across the middle of the rope."""
    return stroke_through(rope()[150, :2].astype(float), np.array([1.0, 0.0]), length_m=0.1, speed_m_s=speed_m_s)


@cache
def rope() -> np.ndarray:
    return fill_tube(TASK.start(0), TASK.rope.radius_m, SUBJECT.particle_count).astype(np.float32)


def table(site: Site | None = None, plan: PushDesign | None = None) -> PushSituation:
    seen = ProjectionView(time_s=0.0, points=rope())
    return scene(TASK, seen, 0, (), plan or PushDesign(), site or Site())


def test_what_two_causes_share_tells_neither_from_the_other() -> None:
    held = belief({"viscous_film": 0.4, "tilt": 0.4}, nothing=0.2)
    names, none = list(held.rivals), np.zeros((3, 3))
    film, tilt, nothing = names.index("viscous_film"), names.index("tilt"), names.index(NOTHING)
    shared = gains_of(held, none, said_by(0.0, 1e3, 1e3))
    apart = gains_of(held, none, said_by(0.0, 1e3, 0.0))
    assert apart[film, tilt] == pytest.approx(apart[film, nothing])
    # However exactly their sum is known, half of the variance of each is left.
    assert shared[film, tilt] == pytest.approx(np.log(2) / 2, rel=1e-3)
    assert shared[film, nothing] > 4 * shared[film, tilt]
    assert not shared[nothing].any()


def test_a_push_that_shows_nothing_gains_nothing_and_one_that_is_made_again_less_each_time() -> None:
    held = belief({"viscous_film": 0.5, "tilt": 0.1}, nothing=0.4)
    none, push = np.zeros((3, 3)), said_by(0.0, 3.0, 0.0)
    assert weigh_gains(held, gains_of(held, none, none)).sum() == pytest.approx(0.0)
    first = weigh_gains(held, gains_of(held, none, push)).sum()
    again = weigh_gains(held, gains_of(held, push, 2 * push)).sum()
    assert first > 2 * again > 0


def test_of_a_film_and_coulomb_friction_the_other_speed_is_chosen_after_a_slow_push() -> None:
    """At one speed, a film cannot be told from a larger friction, which is fitted whatever the cause."""
    slow, fast = said_by(4.0, 1.0, 0.0), said_by(4.0, 4.0, 0.0)
    held = belief({"viscous_film": 0.5, "tilt": 0.0}, nothing=0.5).expecting(slow)
    again, other = flat(stroke(0.05)), flat(stroke(0.3))
    ends = np.stack([rope(), rope()])
    found = best_of(held, [again, other], np.stack([slow, fast]), ends, 0.006)
    assert found.track is other.track
    assert found.between == ("viscous_film", NOTHING)
    assert "viscous film from nothing missing" in found.text
    once = weigh_gains(held, gains_of(held, np.zeros((3, 3)), fast)).sum()
    assert found.nats > 5 * once


def test_what_is_pending_counts_until_the_pushes_are_weighed() -> None:
    film, tilt = said_by(0.0, 3.0, 0.0), said_by(0.0, 0.0, 3.0)
    held = belief({"viscous_film": 0.45, "tilt": 0.4}, nothing=0.15)
    pushes, ends = [flat(stroke()), flat(stroke())], np.stack([rope(), rope()])
    first = best_of(held, pushes, np.stack([film, tilt]), ends, 0.006)
    second = best_of(held.expecting(first.information), pushes, np.stack([film, tilt]), ends, 0.006)
    assert first.track is pushes[0].track
    assert second.track is pushes[1].track


def test_a_push_beside_the_rope_is_not_weighed_and_one_that_moves_it_is() -> None:
    away = Stroke(start=np.array([0.30, -0.30]), ahead=np.array([1.0, 0.0]), length_m=0.1, speed_m_s=0.2)
    through = flat(stroke(0.2))
    held, known = first_belief(SUBJECT), catalogue(SUBJECT.rods)
    assert moving(Predictor(SUBJECT, known), held, table(), [flat(away), through]) == [through]


@cache
def _film() -> Belief:
    """Belief of a film or nothing, with the columns that are fitted whatever the cause, taken from the rod's own."""
    held = first_belief(SUBJECT)
    kept = sorted({*held.prior.nuisance, *held.causes["viscous_film"]})
    at = {column: number for number, column in enumerate(kept)}
    return replace(
        held,
        steps=tuple(held.steps[column] for column in kept),
        prior=Prior(
            mean=held.prior.mean[kept],
            variance=held.prior.variance[kept],
            nuisance=tuple(at[column] for column in held.prior.nuisance),
        ),
        information=np.zeros((len(kept), len(kept))),
        pull=np.zeros(len(kept)),
        pending=np.zeros((len(kept), len(kept))),
        causes={"viscous_film": tuple(at[column] for column in held.causes["viscous_film"])},
        probabilities={"viscous_film": 0.5},
        nothing=0.5,
    )


def test_the_rod_says_so_too_that_a_slow_and_a_fast_push_tell_a_film() -> None:
    predictor = Predictor(SUBJECT, catalogue(SUBJECT.rods))
    pushes = [flat(stroke(0.05)), flat(stroke(0.3))]
    (slow, fast), ends = informations(predictor, _film(), table(), pushes)
    held = _film().expecting(slow)
    assert best_of(held, pushes, np.stack([slow, fast]), ends, 0.006).track is pushes[1].track
    pair = gains_of(held, np.zeros_like(slow), slow + fast).sum()
    assert pair > 1.2 * gains_of(held, np.zeros_like(slow), 2 * slow).sum()


def test_no_candidate_enters_what_is_kept_free_leaves_the_region_or_is_refused_by_the_gate() -> None:
    middle_m = float(rope()[:, 1].mean())
    half = KeepOut(name="a stand", low=(0.0, -0.5, 0.0), high=(1.0, middle_m, 0.3))
    site = Site(limits=Limits(keep_out=(half,)))
    free, kept_out = table(), table(site)
    found = candidates_of(first_belief(SUBJECT), kept_out, np.random.default_rng(0))
    assert len(found) >= 3
    assert len(candidates_of(first_belief(SUBJECT), free, np.random.default_rng(0))) > len(found)
    for each in found:
        assert not half.is_entered_by(each.track.positions)
        assert refusal(probe_motion(TASK, each.track, site), site) == ""
        ends = np.stack([each.stroke.start, each.stroke.end])
        assert ((ends > REGION[:2]) & (ends < REGION[2:])).all()


def test_where_the_gate_allows_nothing_nothing_is_proposed() -> None:
    def refused(_: Track) -> bool:
        return False

    with pytest.raises(PlanningError, match="No push that was drawn may be made"):
        choose(SUBJECT, first_belief(SUBJECT), replace(table(), allowed=refused), seed=0)


def test_a_name_ends_it_but_not_in_two_episodes() -> None:
    sure = {"viscous_film": 0.85, "tilt": 0.05}
    assert stop_of(belief(sure, nothing=0.1), 48) == "named"
    assert not is_named(belief(sure, nothing=0.1, episodes=2))
    assert stop_of(belief(sure, nothing=0.1, episodes=2), 48) is None


def test_no_cause_left_ends_it_but_not_where_one_is_still_worth_a_refit() -> None:
    assert stop_of(belief({"viscous_film": 0.04, "tilt": 0.03}, nothing=0.93), 48) == "none left"
    assert not is_none_left(belief({"viscous_film": 0.10, "tilt": 0.0}, nothing=0.9))
    # Many causes of which each is improbable are no reason to think that nothing is missing.
    assert not is_none_left(belief({"viscous_film": 0.04, "tilt": 0.04}, nothing=0.3))


def test_the_budget_ends_it() -> None:
    open_case = belief({"viscous_film": 0.4, "tilt": 0.3}, nothing=0.3, pushes=48)
    assert stop_of(open_case, 48) == "budget"
    assert stop_of(open_case, 52) is None


def test_what_is_believed_is_said_with_the_likeliest_first() -> None:
    held = belief({"viscous_film": 0.22, "tilt": 0.41}, nothing=0.2)
    assert belief_words(held) == "after 16 pushes: tilt 41 %, viscous film 22 %, nothing missing 20 %"
