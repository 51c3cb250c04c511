"""The simulated cell measured: world, cameras, and the arm while others keep the machine busy.

`python -m bench.world` prints one table. CPU times are of the process that does the work, so a busy machine changes
them little; arm periods and stops are wall time, because that is what they are about.
"""

import dataclasses
import multiprocessing
import time
from collections.abc import Generator, Iterator
from contextlib import contextmanager

import anyio
import numpy as np

from app.config import Site
from app.core.approval import ApprovalGate, Approved
from app.core.messages import Branch, Decision, Executed, Motion, Particles, Proposal, fresh_id
from app.rig.simulated.cameras import table_cameras
from app.rig.simulated.render import render
from app.rig.simulated.rig import SimulatedRig, simulated_rig
from app.rig.simulated.world import RopeWorld
from app.tasks.base import Finger, Rope

ROPE = Rope(length_m=0.40, radius_m=0.008, mass_kg=0.08, colour=(0.9, 0.25, 0.08))
FINGER = Finger(radius_m=0.009, push_height_m=0.006)
_TICK_S, _STILL_M_S, _AT_REST_M_S = 0.01, 2e-3, 2e-3
_STOPS = 20
# The arm is measured here, not this process: on an overloaded machine its event loop may be late to feed the watchdog.
_SITE = dataclasses.replace(Site(), timing=dataclasses.replace(Site().timing, watchdog_s=3.0))


def main() -> None:
    """Print the table."""
    rows = [*_world_rows(), *_camera_rows(), *anyio.run(_arm_rows)]
    width = max(len(name) for name, _ in rows)
    for name, value in rows:
        print(f"{name:<{width}}  {value}")


def _straight() -> np.ndarray:
    y = np.linspace(-ROPE.length_m / 2, ROPE.length_m / 2, 81)
    return np.stack([np.full_like(y, 0.5), y, np.full_like(y, ROPE.radius_m)], axis=1)


def _world_rows() -> Iterator[tuple[str, str]]:
    for speed in (0.1, 0.2, 0.3):
        real_time, settle_s = _pushed(speed)
        yield f"world, push at {speed} m/s", f"{real_time:.1f} x real time while pushed, settles in {settle_s:.2f} s"


def _pushed(speed_m_s: float) -> tuple[float, float]:
    """Simulated per CPU second while the finger pushes, and seconds until every node is slower than 2 mm/s."""
    world = RopeWorld(ROPE, FINGER, _straight())
    begin, end = np.array([0.46, 0.02, FINGER.push_height_m]), np.array([0.64, 0.05, FINGER.push_height_m])
    world.place(begin)
    ticks = round(float(np.linalg.norm(end - begin)) / speed_m_s / _TICK_S)
    started = time.process_time()
    for tick in range(1, ticks + 1):
        world.step(begin + (end - begin) * tick / ticks, _TICK_S)
    spent_s = time.process_time() - started
    settle_s, last = 0.0, world.centreline()
    for tick in range(1, 151):
        world.step(end, _TICK_S)
        now = world.centreline()
        if np.linalg.norm(now - last, axis=1).max() / _TICK_S > _STILL_M_S:
            settle_s = tick * _TICK_S
        last = now
    return ticks * _TICK_S / spent_s, settle_s


def _camera_rows() -> Iterator[tuple[str, str]]:
    rng, camera = np.random.default_rng(0), table_cameras()[0]
    for name, tool in (("arm at home", (0.3, 0.0, 0.3)), ("arm over the rope", (0.5, 0.05, 0.12))):
        snapshot = RopeWorld(ROPE, FINGER, _straight(), tool=tool).snapshot()
        spent_ms: list[float] = []
        for _ in range(12):
            started = time.process_time()
            render(snapshot, camera, rng, rope=ROPE, finger=FINGER)
            spent_ms.append((time.process_time() - started) * 1e3)
        yield f"render a 640x480 view, {name}", f"{np.median(spent_ms[2:]):.0f} ms CPU"


async def _arm_rows() -> list[tuple[str, str]]:
    async with simulated_rig(rope=ROPE, finger=FINGER, centreline=_straight(), site=_SITE, seed=0) as rig:
        rows = [("arm period, nobody else", await _periods(rig))]
        with _busy(2):
            rows.append(("arm period, two busy processes", await _periods(rig)))
            rows.append((f"STOP to rest, two busy processes, n={_STOPS}", await _stops(rig)))
    return rows


async def _periods(rig: SimulatedRig) -> str:
    """Control periods during a motion: the times between the states that the arm logged."""
    motion = Motion(positions=np.array([[0.4, -0.25, 0.02], [0.4, 0.25, 0.02]]), speeds=np.array([0.1, 0.1]))
    await rig.arm.reset(asked_s=time.monotonic())
    executed = await rig.arm.execute(_approved(motion))
    periods = np.diff(executed.times_s) * 1e3
    return (
        f"p50 {np.median(periods):.1f} ms, p99 {np.percentile(periods, 99):.1f} ms, max {periods.max():.1f} ms "
        f"(n={len(periods)}, {executed.outcome})"
    )


async def _stops(rig: SimulatedRig) -> str:
    """Time from the call of `stop` to the first logged state at rest, at the full speed of a motion."""
    motion = Motion(positions=np.array([[0.4, -0.25, 0.02], [0.4, 0.25, 0.02]]), speeds=np.array([0.3, 0.3]))
    taken_ms: list[float] = []
    for _ in range(_STOPS):
        pressed_s, executed = await _stopped(rig, motion)
        speed = np.linalg.norm(np.diff(executed.measured[:, :3], axis=0), axis=1) / np.diff(executed.times_s)
        at_rest = executed.times_s[1:][(speed < _AT_REST_M_S) & (executed.times_s[1:] > pressed_s)]
        taken_ms.append((at_rest[0] - pressed_s) * 1e3)
        await rig.arm.reset(asked_s=time.monotonic())
    return f"median {np.median(taken_ms):.0f} ms, max {max(taken_ms):.0f} ms"


async def _stopped(rig: SimulatedRig, motion: Motion) -> tuple[float, Executed]:
    """Execute `motion` and call `stop` once it runs at its full speed: when that was, and what was done."""
    pressed_s = 0.0

    async def press() -> None:
        nonlocal pressed_s
        while pressed_s == 0:
            await anyio.sleep(_TICK_S)
            if np.linalg.norm((await rig.arm.state()).velocity[:2]) > motion.speeds[0] * 0.95:
                pressed_s = time.monotonic()
                rig.arm.stop()

    async with anyio.create_task_group() as tasks:
        tasks.start_soon(press)
        executed = await rig.arm.execute(_approved(motion))
        return pressed_s, executed
    raise AssertionError("the task group ends with its body")


@contextmanager
def _busy(count: int) -> Generator[None]:
    """As many processes that do nothing but compute."""
    spawn = multiprocessing.get_context("spawn")
    processes = [spawn.Process(target=_burn, daemon=True) for _ in range(count)]
    for process in processes:
        process.start()
    try:
        time.sleep(1.0)
        yield
    finally:
        for process in processes:
            process.kill()
            process.join()


def _burn() -> None:
    matrix = np.random.default_rng(0).standard_normal((64, 64))
    while True:
        matrix = matrix @ matrix
        matrix /= np.abs(matrix).max()


def _approved(motion: Motion) -> Approved:
    """An operator's leave for `motion`."""
    points = _straight().astype(np.float32)
    branch = Branch(
        origin="policy",
        actions=np.zeros((1, 2), np.float32),
        tool_path=motion.positions.astype(np.float32),
        predicted=points,
        final=points,
        cost_before=0.0,
        cost_after=0.0,
        terms={},
        finite=True,
    )
    proposal = Proposal(
        id=fresh_id("proposal"),
        time_s=0.0,
        task="rope_push",
        particles_id=fresh_id("particles"),
        goal_id=fresh_id("goal"),
        model_id=fresh_id("model"),
        model_version=0,
        observed=points,
        branches=(branch,),
        best=0,
        motion=motion,
        chamfer_m2=0.0,
        predicted_chamfer_m2=0.0,
        plan_s=0.0,
    )
    decision = Decision(
        id=fresh_id("decision"),
        time_s=0.0,
        proposal_id=proposal.id,
        digest=motion.digest(),
        approve=True,
        operator="bench",
    )
    latest = Particles(id=fresh_id("particles"), time_s=0.0, positions=points, surface=points, reconstruction_s=0.0)
    gate = ApprovalGate(max_age_s=1.0, max_unseen_s=1.0, max_drift_m=0.001)
    gate.show(proposal)
    return gate.approve(decision, latest=latest, now_s=0.0)


if __name__ == "__main__":
    main()
