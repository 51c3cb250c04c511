"""Frame test: the frame in which the mean residual is constant hints at the kind of cause before any is named."""

from collections.abc import Callable
from typing import TypeAlias

import numpy as np
from jaxtyping import Float64, Int

from app.discovery.residuals.simulation_batch import SimulationBatch
from app.discovery.results.case import FrameTest

_DRAWS = 250
_BINS = 8

Means: TypeAlias = Float64[np.ndarray, "K 2"]
"""The mean residual of each push [m]."""


def frame_tests(
    trials: SimulationBatch, places: Float64[np.ndarray, "K N 2"], arrows: Float64[np.ndarray, "K N 2"]
) -> tuple[FrameTest, ...]:
    """The share of the mean residuals' square that is constant in each frame, with a bootstrap over episodes."""
    means, episode = arrows.mean(1), np.array([push.episode for push in trials.study.pushes])
    camera = np.asarray(trials.study.camera)[:2]
    frames: list[tuple[str, str, Means]] = [
        ("world", "the same way on the table, whatever the motion: tilt, draught, cameras", means),
        ("push", "along or across the motion: friction, delay, lag, compliance", _turn(means, _headings(trials))),
        ("tool", "fixed to the turned tool: its tip is elsewhere", _turn(means, _yaws(trials))),
        ("camera", "towards or away from the cameras: depth", _turn(means, _angles(places.mean(1) - camera))),
    ]
    tests = [_test(name, about, episode, means, _constant(turned)) for name, about, turned in frames]
    if trials.kind.has_length:
        about = "the same at the same place along the object: stiffness, mass, rest shape"
        tests.append(_test("material", about, episode, means, _along(trials, arrows)))
    tests.append(
        _test(
            "time",
            "growing or changing during the session: wear, drift, a jump",
            episode,
            means,
            _trend(means, _headings(trials), trials.times),
        )
    )
    return tuple(sorted(tests, key=lambda test: -test.explained))


Share: TypeAlias = Callable[[Int[np.ndarray, " L"]], float]
"""Share of the variance explained among some of the pushes."""


def _test(name: str, about: str, episode: Int[np.ndarray, " K"], means: Means, share: Share) -> FrameTest:
    rng, numbers = np.random.default_rng(0), np.unique(episode)
    rows = [np.flatnonzero(episode == number) for number in numbers]
    drawn = [
        share(np.concatenate([rows[index] for index in rng.integers(len(rows), size=len(rows))])) for _ in range(_DRAWS)
    ]
    low, high = np.quantile(drawn, [0.05, 0.95])
    explained = share(np.arange(len(means)))
    return FrameTest(
        frame=name, about=about, explained=explained, low=min(float(low), explained), high=max(float(high), explained)
    )


def _constant(turned: Means) -> Share:
    """The square of the mean over the mean of squares, less what chance alone makes of so many pushes."""

    def share(rows: Int[np.ndarray, " L"]) -> float:
        own = turned[rows]
        whole = float((own**2).sum(1).mean())
        raw = float((own.mean(0) ** 2).sum()) / max(whole, 1e-12)
        return max(0.0, (len(own) * raw - 1) / max(len(own) - 1, 1))

    return share


def _along(trials: SimulationBatch, arrows: Float64[np.ndarray, "K N 2"]) -> Share:
    """Share for residuals across the object, by place along it."""
    labels = trials.labels
    normals = np.stack([-labels[:, :, 3], labels[:, :, 2]], axis=2)
    across = (arrows * normals).sum(2)
    bins = np.clip(((labels[:, :, 0] + 1) / 2 * _BINS).astype(int), 0, _BINS - 1)
    table = np.stack(
        [np.where(bins == n, across, 0).sum(1) / np.maximum((bins == n).sum(1), 1) for n in range(_BINS)], 1
    )

    def share(rows: Int[np.ndarray, " L"]) -> float:
        own = table[rows]
        whole = float((own**2).mean())
        raw = float((own.mean(0) ** 2).mean()) / max(whole, 1e-12)
        return max(0.0, (len(own) * raw - 1) / max(len(own) - 1, 1))

    return share


def _trend(means: Means, headings: Float64[np.ndarray, " K"], times: Float64[np.ndarray, " K"]) -> Share:
    """Share for the residual along the push, by a straight line over the session."""
    forth = _turn(means, headings)[:, 0]

    def share(rows: Int[np.ndarray, " L"]) -> float:
        if len(np.unique(times[rows])) < 3:  # A line goes through any two.
            return 0.0
        return max(0.0, float(np.corrcoef(times[rows], forth[rows])[0, 1]) ** 2 - 1 / len(rows))

    return share


def _turn(vectors: Means, angles: Float64[np.ndarray, " K"]) -> Means:
    """Seen in frames turned by angles [rad]."""
    c, s = np.cos(angles), np.sin(angles)
    return np.stack([c * vectors[:, 0] + s * vectors[:, 1], -s * vectors[:, 0] + c * vectors[:, 1]], axis=1)


def _angles(vectors: Float64[np.ndarray, "K 2"]) -> Float64[np.ndarray, " K"]:
    return np.arctan2(vectors[:, 1], vectors[:, 0])


def _headings(trials: SimulationBatch) -> Float64[np.ndarray, " K"]:
    """Direction of each push [rad]."""
    spans = zip(trials.study.pushes, trials.starts_s, trials.ends_s, strict=True)
    ways = [push.track.at(np.array([start, stop])) for push, start, stop in spans]
    return _angles(np.stack([way[1, :2] - way[0, :2] for way in ways]))


def _yaws(trials: SimulationBatch) -> Float64[np.ndarray, " K"]:
    """Yaw of the tool in each push [rad]."""
    q = np.stack([push.track.poses[len(push.track.poses) // 2, 3:7] for push in trials.study.pushes])
    w, x, y, z = q.T
    return np.arctan2(2 * (w * z + x * y), 1 - 2 * (y**2 + z**2))
