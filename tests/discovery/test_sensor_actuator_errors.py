"""Conformance of the effects of cameras and arm, found by itself: nulls that vanish, names, units, sources."""

import inspect
from pathlib import Path

import numpy as np
import pytest

from app.core.geometry.track import Track
from app.discovery import sensor_actuator_errors
from app.discovery.sensor_actuator_errors.base import Apparatus, Eye, Load
from app.sim.files import files_of
from app.sim.model.params import PARAMETERS

CATALOGUE = {name: module.EFFECT for name, module in files_of(sensor_actuator_errors)}
MODULES = dict(files_of(sensor_actuator_errors))
every_effect = pytest.mark.parametrize("name", CATALOGUE)
EYE = Eye(position=np.array([0.5, -0.2, 0.9]), nearest=None)


def track() -> Track:
    """A track that goes down, forth, back and up, with the tool turned by a quarter."""
    times = np.linspace(0.0, 3.0, 151)
    x = 0.5 + 0.1 * np.interp(times, [0.5, 1.5, 2.5], [0.0, 1.0, 0.4])
    z = np.interp(times, [0.0, 0.4, 2.6, 3.0], [0.1, 0.006, 0.006, 0.1])
    turn = np.tile([np.sqrt(0.5), 0.0, 0.0, np.sqrt(0.5)], (len(times), 1))
    return Track(times_s=times, poses=np.column_stack([x, np.zeros_like(x), z, turn]))


def load() -> Load:
    """A load of one newton against x."""
    return Load(np.tile([-1.0, 0.0, 0.0], (151, 1)))


def cloud() -> np.ndarray:
    return np.random.default_rng(0).uniform([0.3, -0.3, 0.0], [0.8, 0.3, 0.02], (50, 3))


def values(effect: Apparatus, share: float) -> np.ndarray:
    return np.array([share * (spec.typical or 0.0) for spec in effect.parameters])


@every_effect
def test_an_effect_vanishes_at_its_null(name: str) -> None:
    effect, nothing = CATALOGUE[name], values(CATALOGUE[name], 0.0)
    if effect.drive is not None:
        moved = effect.drive(track(), load(), nothing)
        np.testing.assert_allclose(moved.at(track().times_s), track().positions, atol=1e-9)
    if effect.see is not None:
        eye = Eye(EYE.position, cloud() * [1, 1, 0] + [0, 0, 0.01])
        np.testing.assert_allclose(effect.see(cloud(), eye, nothing), cloud(), atol=1e-12)
    if effect.late_s is not None:
        assert effect.late_s(nothing) == 0.0
    if effect.more is not None:
        assert effect.more(nothing) == 0.0


@every_effect
def test_an_effect_does_something_at_its_typical_size_and_about_half_of_it_at_half(name: str) -> None:
    effect = CATALOGUE[name]

    def done(share: float) -> np.ndarray:
        at, parts = values(effect, share), list[np.ndarray]()
        if effect.drive is not None:
            parts.append(effect.drive(track(), load(), at).at(track().times_s) - track().positions)
        if effect.see is not None:
            eye = Eye(EYE.position, cloud() * [1, 1, 0] + [0.004, 0, 0.01])
            parts.append(effect.see(cloud(), eye, at) - cloud())
        if effect.late_s is not None:
            parts.append(np.array([[effect.late_s(at)]]))
        if effect.more is not None:
            parts.append(np.array([[effect.more(at)]]))
        return np.concatenate([part.ravel() for part in parts])

    whole, half = done(1.0), done(0.5)
    assert np.abs(whole).max() > 1e-4
    assert np.abs(half).sum() == pytest.approx(0.5 * np.abs(whole).sum(), rel=0.2)


@every_effect
def test_an_effect_says_what_it_is_in_the_fields_words_with_a_size_and_its_unit(name: str) -> None:
    effect, doc = CATALOGUE[name], inspect.getdoc(MODULES[name]) or ""
    assert len(doc.splitlines()) >= 3
    assert any(hook is not None for hook in (effect.drive, effect.see, effect.late_s, effect.more))
    for spec in effect.parameters:
        assert spec.nominal == 0.0
        assert spec.typical is not None
        assert spec.unit in {"m", "s", "deg", "1", "m/N"}
        assert spec.about.endswith(".")
    assert len(Path(MODULES[name].__file__ or "").read_text(encoding="utf-8").splitlines()) <= 60


def test_no_two_parameters_share_a_name() -> None:
    names = [spec.name for effect in CATALOGUE.values() for spec in effect.parameters]
    names += [spec.name for spec in PARAMETERS]
    assert len(set(names)) == len(names)


def test_lag_follows_a_steady_command_by_its_time_constant_times_speed() -> None:
    times = np.linspace(0.0, 2.0, 201)
    ramp = Track(
        times_s=times, poses=np.column_stack([0.2 * times, *np.zeros((2, 201)), np.ones(201), *np.zeros((3, 201))])
    )
    lagging = CATALOGUE["actuator_lag"].drive(ramp, Load(np.zeros((201, 3))), np.array([0.1]))
    assert ramp.poses[-1, 0] - lagging.poses[-1, 0] == pytest.approx(0.1 * 0.2, rel=1e-3)


def test_backlash_shows_only_after_a_reversal() -> None:
    moved = CATALOGUE["backlash"].drive(track(), load(), np.array([0.002]))
    behind = track().poses[:, 0] - moved.poses[:, 0]
    assert behind[track().times_s < 1.5].max() == pytest.approx(0.001)
    assert behind[-1] == pytest.approx(-0.001)


def test_a_tcp_offset_turns_with_the_tool() -> None:
    moved = CATALOGUE["tcp_offset"].drive(track(), load(), np.array([0.003, 0.0, 0.0]))
    np.testing.assert_allclose(moved.positions - track().positions, np.tile([0.0, 0.003, 0.0], (151, 1)), atol=1e-12)
