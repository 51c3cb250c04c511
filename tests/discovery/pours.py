"""Studies of pours that are made up: so much of the water in either bowl."""

import numpy as np

from app.core.geometry.track import Track
from app.core.types import Points
from app.discovery.dataset.study import ProjectionView, Push, Study
from app.jobs.discovery_subject import subject_of
from app.policy.random_pours import beside, random_pour
from app.tasks import load
from app.tasks.elements.pouring import pool_points

TASK = load("pour_water")
SUBJECT = subject_of(TASK)
SOUP = subject_of(load("pour_soup"))
assert SUBJECT.bowls is not None
BOWLS, COUNT = SUBJECT.bowls, SUBJECT.particle_count
SLOT_S = 10.0


def water(share: float, held_m: np.ndarray) -> Points:
    """So much of the water at rest in the fixed bowl, the rest in one held at `held_m`."""
    whole = pool_points(BOWLS.held_radius_m, BOWLS.volume_m3, 4 * COUNT)[:COUNT] * 0.5
    poured = round(share * COUNT)
    drop = np.array([0.0, 0.0, -0.02])
    return np.concatenate([whole[:poured] + drop + BOWLS.place_m, whole[poured:] + drop + held_m]).astype(np.float32)


def study_of(*shares: tuple[float, float], pours: int = 1) -> Study:
    """A pour for each share before and after it, so many an episode."""

    def push(k: int, before: float, after: float) -> Push:
        start = np.array([*beside((0.55, 0.0), 1.0 + k), 0.144])
        rng = np.random.default_rng(k)
        motion = random_pour(rng, start, (0.55, 0.0), volume_m3=100e-6, radius_m=BOWLS.held_radius_m)
        track = motion.track(start_s=SLOT_S * k + 1.0)
        views = [
            ProjectionView(time_s=at, points=water(share, place))
            for at, share, place in (
                (SLOT_S * k, before, track.positions[0]),
                (track.times_s[0] + motion.midway_s, before, track.positions[0]),
                (track.end_s + 1.0, after, track.positions[-1]),
            )
        ]
        return Push(
            episode=k // pours,
            before=views[0],
            during=(views[1],),
            after=views[2],
            command=track,
            measured=Track(**vars(track)),
        )

    return Study(task=TASK.name, pushes=tuple(push(k, *pair) for k, pair in enumerate(shares)))
