"""Suspicions name the pattern that is there, and nothing where there is none."""

import dataclasses

import numpy as np
import pytest
from jaxtyping import Float64

from app.core.messages import Executed, fresh_id
from app.discovery.monitor.push_residual import Glance, glance
from app.discovery.monitor.quick_diagnosis import suspect

PUSHES = 10


def pushes(seed: int = 0) -> list[Glance]:
    """Pushes in all directions all over the table, with residuals of half a millimetre of noise."""
    rng = np.random.default_rng(seed)
    angles = rng.uniform(0, 2 * np.pi, PUSHES)
    return [
        Glance(
            error_m=0.006,
            moved_m=0.02,
            noise_m=0.001,
            promised_m=float("nan"),
            residual_m=5e-4 * rng.normal(size=2),
            place_m=np.array([0.55, 0.0]) + rng.uniform(-0.15, 0.15, 2),
            ahead=np.array([np.cos(angle), np.sin(angle)]),
            strayed_m=np.zeros(2),
            late_s=0.05,
        )
        for angle in angles
    ]


def moved(glances: list[Glance], by_m: Float64[np.ndarray, "K 2"]) -> list[Glance]:
    return [
        dataclasses.replace(it, residual_m=it.residual_m + vector) for it, vector in zip(glances, by_m, strict=True)
    ]


def test_a_shift_on_the_table_is_suspected_of_cameras_or_tool() -> None:
    found = suspect(moved(pushes(), np.tile([0.004, -0.003], (PUSHES, 1))))[0]
    assert found.kin == "sensing"
    assert "(+3.9, -3.0)" in found.text or "(+4" in found.text


@pytest.mark.parametrize(("along_m", "says"), [(-0.005, "less far"), (0.005, "farther")])
def test_an_object_that_moves_less_or_farther_than_predicted_is_suspected_of_contact(along_m: float, says: str) -> None:
    glances = pushes()
    found = suspect(moved(glances, along_m * np.stack([it.ahead for it in glances])))[0]
    assert found.kin == "contact or table"
    assert says in found.text


def test_an_object_that_ends_beside_the_push_is_suspected_of_the_tool() -> None:
    glances = pushes()
    left = np.stack([[-it.ahead[1], it.ahead[0]] for it in glances])
    found = suspect(moved(glances, 0.005 * left))[0]
    assert found.kin == "actuation"
    assert "to the left of the push" in found.text


def test_an_arm_whose_own_log_is_off_its_command_is_suspected_first() -> None:
    rng = np.random.default_rng(1)
    strayed = 0.006 * rng.normal(size=(PUSHES, 2))
    glances = [dataclasses.replace(it, strayed_m=off) for it, off in zip(pushes(), strayed, strict=True)]
    found = suspect(moved(glances, 0.7 * strayed))[0]
    assert found.kin == "actuation"
    assert "own log" in found.text


def test_residuals_that_grow_from_push_to_push_are_suspected_of_time() -> None:
    growing = np.linspace(-0.001, 0.008, PUSHES)[:, None] * np.array([1.0, 0.5])
    assert "time" in [it.kin for it in suspect(moved(pushes(), growing))]


def test_residuals_that_change_with_the_place_are_suspected_of_the_table() -> None:
    glances = pushes()
    sideways = np.stack([[0.0, 0.06 * (it.place_m[0] - 0.55)] for it in glances])
    found = suspect(moved(glances, sideways))[0]
    assert found.kin == "contact or table"
    assert "some places" in found.text


def test_an_object_of_another_shape_in_the_right_place_is_suspected_of_its_material() -> None:
    assert [it.kin for it in suspect(pushes())] == ["material"]


def test_nothing_is_suspected_of_residuals_without_a_pattern_or_of_two_pushes() -> None:
    rng = np.random.default_rng(5)
    assert not [it for it in suspect(moved(pushes(), 0.006 * rng.normal(size=(PUSHES, 2)))) if it.explained > 0.8]
    assert suspect(pushes()[:2]) == ()


def test_a_glance_sees_how_far_the_object_is_off_and_how_the_arm_followed() -> None:
    rng, period_s, late = np.random.default_rng(0), 0.01, 8
    planned = rng.uniform([0.5, -0.2, 0.0], [0.52, 0.2, 0.016], (400, 3)).astype(np.float32)
    predicted = planned + np.float32([0.03, 0, 0])
    observed = planned + np.float32([0.024, 0.002, 0])
    way = np.concatenate([np.zeros(60), np.cumsum(np.sin(np.linspace(0, np.pi, 100)))])
    way = 0.1 * np.concatenate([way / way[-1], np.ones(60)])
    height = np.full(len(way), 0.006)
    height[:20] = height[-20:] = 0.1
    commanded = np.stack([0.45 + way, 0 * way, height, 0 * way, 1 + 0 * way, 0 * way, 0 * way], axis=1)
    measured = commanded.copy()
    measured[late:, :2] = commanded[:-late, :2] + [0.0, 0.002]
    executed = Executed(
        id=fresh_id("executed"),
        time_s=1.0,
        approved_id=fresh_id("approved"),
        outcome="completed",
        reason="",
        times_s=period_s * np.arange(len(way)),
        commanded=commanded,
        measured=measured,
    )
    seen = glance(planned, predicted, planned, observed, executed, share=0.1)
    assert seen.moved_m == pytest.approx(0.03, rel=1e-3)
    assert seen.promised_m == pytest.approx(0.003, rel=1e-2)
    np.testing.assert_allclose(seen.residual_m, [-0.006, 0.002], atol=1e-4)
    np.testing.assert_allclose(seen.ahead, [1.0, 0.0], atol=1e-9)
    np.testing.assert_allclose(seen.strayed_m, [0.0, 0.002], atol=1e-4)
    assert seen.late_s == pytest.approx(late * period_s, rel=0.05)
    unmeasured = dataclasses.replace(executed, measured=np.zeros((0, 7)))
    assert glance(planned, predicted, planned, observed, unmeasured).late_s == 0.0
