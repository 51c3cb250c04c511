"""Parts of the bench on the real rope: each fold reads its own pushes alone, and clouds become a rope."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest
from jaxtyping import Float64

from app.commands.import_ import import_
from app.discovery.checks.limits import limits_of
from app.services.study import read_study
from bench import rope_pushes
from bench.leave_one_out import Fitted, Place, descend, folds, loss, paired, placed

TRUTHS = np.array([2.0, 3.0, 2.0, 9.0])
"""Place along an axis at which each of four pushes has its least error."""


def distances(places: Sequence[Place]) -> Float64[np.ndarray, "Q K"]:
    return np.stack([np.abs(TRUTHS - dict(place).get("a", 0)) for place in places])


def straight(angle: float) -> np.ndarray:
    """A flat band 0.4 m long and 10 mm wide, as the cameras' points lie, with heights that are noise."""
    along, across = np.meshgrid(np.linspace(-0.2, 0.2, 160), np.linspace(-0.005, 0.005, 5), indexing="ij")
    flat = np.stack([along.ravel(), across.ravel()], axis=1)
    turn = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
    heights = np.random.default_rng(0).uniform(-0.017, 0.006, len(flat))
    return np.column_stack([flat @ turn + (0.5, 0.0), heights]).astype(np.float32)


def test_what_the_push_left_out_says_changes_nothing_of_its_fold():
    train = folds(4)
    begun = Fitted(places=((),) * len(train), train=train)

    def misled(places: Sequence[Place]) -> Float64[np.ndarray, "Q K"]:
        errors = distances(places)
        errors[:, 3] = [abs(dict(place).get("a", 0) + 50.0) for place in places]
        return errors

    honest, other = (descend(errors, begun, ("a",), 20) for errors in (distances, misled))
    assert honest.places[3] == other.places[3] == placed({"a": 2})
    assert honest.places[:3] != other.places[:3]


def test_every_fold_ends_where_no_step_is_better_on_its_own_pushes():
    train = folds(4)
    found = descend(distances, Fitted(places=((),) * len(train), train=train), ("a",), 20)
    for place, own in zip(found.places, train, strict=True):
        at = dict(place).get("a", 0)
        here, *others = (loss(distances([placed({"a": at + step})])[0], own) for step in (0, -1, 1))
        assert here <= min(others)


def test_the_same_errors_gain_nothing():
    errors = np.array([1.0, 2.0, 4.0])
    same = paired(errors, errors)
    assert (same.mean, same.low, same.high, same.better, same.p) == (0.0, 0.0, 0.0, 0, 1.0)


def test_an_interval_of_paired_gains_holds_the_true_gain_nine_times_in_ten():
    rng = np.random.default_rng(0)
    found = [paired(rng.normal(2.0, 3.0, 8), rng.normal(3.0, 3.0, 8)) for _ in range(1000)]
    share = np.mean([gain.low <= 1.0 <= gain.high for gain in found])
    assert 0.87 < share < 0.93


@pytest.mark.parametrize("angle", [0.0, 0.7])
def test_a_band_of_points_becomes_a_rope_on_the_table(angle: float):
    body = rope_pushes.body_of(straight(angle))
    radius = rope_pushes.RADIUS_M
    assert 0 <= body[:, 2].min() < 0.3 * radius
    assert 1.7 * radius < body[:, 2].max() <= 2 * radius + 1e-6
    assert body[:, 2].mean() == pytest.approx(radius, rel=0.05)
    assert np.linalg.norm(np.ptp(body[:, :2], axis=0)) == pytest.approx(0.4, rel=0.05)


def test_the_real_pushes_become_eight_episodes_that_lack_what_was_not_recorded(tmp_path: Path):
    if not rope_pushes.FOLDER.is_dir():
        pytest.skip(f"the recorded pushes are not in {rope_pushes.FOLDER}")
    pushes = rope_pushes.recorded_pushes()
    rope_pushes.write_plain(pushes, tmp_path / "plain.npz")
    import_(tmp_path / "plain.npz", output=tmp_path / "rope.mcap")
    study = read_study([tmp_path / "rope.mcap"])
    assert [push.episode for push in study.pushes] == list(range(8))
    lacks = " ".join(limit.text for limit in limits_of(study, rope_pushes.real_rope(pushes)))
    for what in ("8 pushes", "equally fast", "2 directions", "never during a push", "measured in 0", "bare table"):
        assert what in lacks
