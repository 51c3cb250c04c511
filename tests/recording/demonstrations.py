"""Recordings as a demonstration leaves them: frames, object, motion, object, and what came of it."""

import json
from pathlib import Path

import numpy as np

from app.core.geometry.camera import CameraModel
from app.core.messages import Episode, Executed, Fault, Frame, Goal, Message, Notice, Outcome, Particles, Transition
from tests.recording.samples import Maker, record

PUSHES, PARTICLES, PERIOD_S = 3, 40, 0.01
TURN = (0.0, 1.0, 0.0, 0.0)
K = np.array([[600.0, 0.0, 319.5], [0.0, 600.0, 239.5], [0.0, 0.0, 1.0]])


def demonstration(
    folder: Path,
    *,
    seed: int = 0,
    particles: int = PARTICLES,
    cameras: int = 2,
    depth_unit_m: float = 0.001,
    **told: object,
) -> Path:
    """A whole recording of three pushes along x; `told` is what its episode says otherwise."""
    make = Maker(seed=seed)
    said = {"task": "rope_push", "rig": "simulated", "seed": seed, "config": json.dumps({"expert": True})} | told
    episode = make(Episode, cause=(), time_s=100.0, **said)
    return record(folder, episode, messages(make, particles, cameras, depth_unit_m))


def messages(make: Maker, count: int, cameras: int, depth_unit_m: float = 0.001) -> list[Message]:
    names = [f"camera{index}" for index in range(cameras)]
    models = [make(CameraModel, name=name, K=K, depth_unit_m=depth_unit_m) for name in names]
    goal = make(Goal, cause=(), time_s=100.0, positions=cloud(make, count, 0.6))
    told: list[Message] = [goal]
    now_s, before = 101.0, None
    for push in range(PUSHES + 1):
        frames = [make(Frame, cause=(), time_s=now_s, camera=model) for model in models]
        x = cloud(make, count, 0.4 + 0.05 * push)
        causes = tuple(frame.id for frame in frames)
        after = make(Particles, cause=causes, time_s=now_s, positions=x, surface=cloud(make, 60, 0.4 + 0.05 * push))
        if before is not None:
            made = executed(make, before, push)
            told += [made, *frames, after]
            transition = Transition.between(before, made, after)
            told.append(transition)
            told.append(make(Outcome, cause=(made.id, after.id), time_s=now_s, index=push))
        else:
            told += [*frames, after]
        now_s, before = now_s + 3.0, after
    told.append(make(Notice, cause=(), time_s=now_s, where="watch", text="All is [well]."))
    told.append(make(Fault, cause=(), time_s=now_s, where="camera", text="It was late.", fatal=False))
    return told


def executed(make: Maker, before: Particles, push: int) -> Executed:
    """One second along x at 0.1 m/s, from half a second after `before`; measured 1 mm beside what was told."""
    times = before.time_s + 0.5 + PERIOD_S * np.arange(101)
    x = 0.4 + 0.05 * push + 0.1 * PERIOD_S * np.arange(101)
    told = np.column_stack([x, np.zeros(101), np.full(101, 0.01), np.tile(TURN, (101, 1))])
    return make(
        Executed,
        cause=(before.id,),
        time_s=float(times[-1]),
        outcome="completed",
        times_s=times,
        commanded=told,
        measured=told + np.array([0, 0.001, 0, 0, 0, 0, 0]),
        openings=np.zeros(101),
    )


def cloud(make: Maker, count: int, x: float) -> np.ndarray:
    """A straight rope along y at `x` [m]."""
    y = np.linspace(-0.15, 0.15, count)
    return (
        np.column_stack([np.full(count, x), y, np.full(count, 0.008)]) + make.rng.normal(0, 1e-4, (count, 3))
    ).astype(np.float32)
