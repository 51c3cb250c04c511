"""Messages as a running program would send them, from a seed: a rope on the table, its goal, a tree of plans."""

import time

import numpy as np

from app.core.colours import ColourRange, colour_mask
from app.core.dialogue.control import Mode, ModeName
from app.core.dialogue.segmentation_message import Seen
from app.core.geometry.camera import CameraModel
from app.core.messages import (
    ArmMode,
    ArmState,
    Branch,
    Episode,
    Executed,
    Frame,
    Goal,
    Health,
    Message,
    Model,
    Notice,
    Outcome,
    Parameter,
    Particles,
    Proposal,
    Transition,
    fresh_id,
)
from app.core.motion import Motion

N = 300
MOMENTS = 9
"""Number of moments of a branch, from now to its end."""
COLOUR = ColourRange.around((232 / 255, 120 / 255, 40 / 255))
"""Colours of the dots that are the object in the frames."""


def rope(bend: float, seed: int = 0, *, centre: tuple[float, float] = (0.55, 0.0)) -> np.ndarray:
    """A rope of N particles lying on the table, bent by `bend`; shape (N, 3)."""
    rng = np.random.default_rng(seed)
    s = np.repeat(np.linspace(-0.5, 0.5, N // 6), 6)
    x, y = centre[0] + bend * (s**2 - 0.08), centre[1] + 0.36 * s
    ring = np.tile(np.linspace(0, 2 * np.pi, 6, endpoint=False), N // 6)
    points = np.column_stack([x + 0.008 * np.cos(ring), y, 0.010 + 0.008 * np.sin(ring)])
    return (points + rng.normal(0, 0.0006, points.shape)).astype(np.float32)


def camera(name: str, azimuth: float) -> CameraModel:
    eye = np.array([0.55 + 0.6 * np.cos(azimuth), 0.6 * np.sin(azimuth), 0.6])
    forward = np.array([0.55, 0, 0]) - eye
    forward /= np.linalg.norm(forward)
    right = np.cross(forward, [0, 0, 1])
    right /= np.linalg.norm(right)
    T = np.eye(4)
    T[:3, :3] = np.column_stack([right, np.cross(forward, right), forward])
    T[:3, 3] = eye
    K = np.array([[610.0, 0, 320], [0, 610, 240], [0, 0, 1]])
    return CameraModel(name=name, width=640, height=480, K=K, T_world_camera=T, depth_unit_m=0.001)


def frame(model: CameraModel, points: np.ndarray) -> Frame:
    """Frame that the camera takes of the points: dots on a grey table."""
    rng = np.random.default_rng(1)
    image = np.full((model.height, model.width, 3), (96, 104, 112), np.uint8)
    image += rng.integers(0, 9, image.shape, dtype=np.uint8)
    inside = np.linalg.inv(model.T_world_camera) @ np.column_stack([points, np.ones(len(points))]).T
    u, v, w = model.K @ inside[:3]
    for column, row in zip((u / w).astype(int), (v / w).astype(int), strict=True):
        if 4 < column < model.width - 4 and 4 < row < model.height - 4:
            image[row - 4 : row + 4, column - 4 : column + 4] = (232, 120, 40)
    depth = np.full((model.height, model.width), 700, np.uint16)
    return Frame(id=fresh_id("frame"), time_s=time.monotonic(), camera=model, color=image, depth=depth)


def seen(*frames: Frame, colour: ColourRange = COLOUR, apart_m: float = 0.0016) -> Seen:
    """Segmentation of the object in these frames."""
    masks = {each.camera.name: colour_mask(each.color, colour) for each in frames}
    pixels = {name: int(mask.sum()) for name, mask in masks.items()}
    return Seen(
        id=fresh_id("seen"),
        cause=tuple(each.id for each in frames),
        time_s=time.monotonic(),
        masks={name: mask[::2, ::2] for name, mask in masks.items()},
        pixels=pixels,
        points={name: count - 5 for name, count in pixels.items()},
        hue_deg=colour.hue_deg,
        saturation=colour.saturation,
        value=colour.value,
        apart_m=dict.fromkeys(masks, apart_m),
    )


def particles(points: np.ndarray) -> Particles:
    return Particles(
        id=fresh_id("particles"),
        time_s=time.monotonic(),
        positions=points,
        surface=points,
        reconstruction_s=0.08,
    )


def branch(rng: np.random.Generator, index: int, observed: np.ndarray) -> Branch:
    start = observed[rng.integers(N), :2] + rng.normal(0, 0.05, 2)
    angle = rng.uniform(-np.pi, np.pi) if index else 0.0
    s = np.linspace(0, 1, 12)[:, None]
    path = start + 0.16 * s * [np.cos(angle), np.sin(angle)] + 0.02 * np.sin(3 * s) * [1, 0]
    before = float(rng.uniform(0.4, 0.9))
    bends = np.linspace(0.5, 0.22 - 0.02 * index, MOMENTS)
    tools = np.concatenate([path[np.linspace(0, 11, MOMENTS - 4).astype(int)], np.repeat(path[-1:], 4, axis=0)])
    return Branch(
        origin="random" if index else "policy",
        actions=np.zeros((2, 42), np.float32),
        tool_path=np.column_stack([path, np.full(12, 0.012)]).astype(np.float32),
        predicted=rope(0.3, 4),
        final=rope(0.22, 3),
        cost_before=before,
        cost_after=before * float(rng.uniform(0.5, 0.9)),
        terms={"chamfer": -0.0021, "contact": 0.31},
        finite=index != 5,
        frames=np.stack([observed, *(rope(float(bend)) for bend in bends[1:])]),
        tools=np.column_stack([tools, np.full(MOMENTS, 0.012)]).astype(np.float32),
    )


def proposal(observed: np.ndarray, seed: int = 0, *, branches: int = 16) -> Proposal:
    rng = np.random.default_rng(seed)
    tree = tuple(branch(rng, index, observed) for index in range(branches))
    best = int(np.argmin([b.cost_after if b.finite else np.inf for b in tree]))
    path = tree[best].tool_path.astype(float)
    return Proposal(
        id=fresh_id("proposal"),
        time_s=time.monotonic(),
        task="rope_push",
        particles_id=fresh_id("particles"),
        goal_id=fresh_id("goal"),
        model_id=fresh_id("model"),
        model_version=2,
        observed=observed,
        branches=tree,
        best=best,
        motion=Motion(positions=path, speeds=np.full(len(path), 0.1)),
        chamfer_m2=3.41e-3,
        predicted_chamfer_m2=1.27e-3,
        plan_s=7.4,
    )


def arm(mode: ArmMode = "idle", tip: tuple[float, float, float] = (0.42, -0.12, 0.12)) -> ArmState:
    return ArmState(
        id=fresh_id("arm"),
        time_s=time.monotonic(),
        pose=np.array([*tip, 1, 0, 0, 0], float),
        velocity=np.zeros(3),
        joints=np.zeros(7),
        gripper=1.0,
        mode=mode,
        period_s=0.011,
    )


def health(doing: str = "looking at the object (2 s)", arm_mode: ArmMode = "idle") -> Health:
    return Health(
        id=fresh_id("health"),
        time_s=time.monotonic(),
        doing=doing,
        frame_age_s={"left": 0.12, "right": 1.4},
        particles_age_s=0.31,
        plan_age_s=3.0,
        plan_s=7.4,
        arm_mode=arm_mode,
        arm_period_s=0.011,
        model_version=2,
        calibration_loss_m2=2.2e-5,
        drops={"frames left": 3, "frames right": 1},
        faults=0,
        disk_free_bytes=41_000_000_000,
    )


def model(version: int, loss_m2: float) -> Model:
    return Model(
        id=fresh_id("model"),
        time_s=time.monotonic(),
        version=version,
        task="rope_push",
        parameters=(
            Parameter(name="stiffness", value=4.1e4, unit="Pa", low=2.2e4, high=6.0e4),
            Parameter(name="friction", value=0.43, unit="", low=0.43, high=0.43),
        ),
        loss_m2=loss_m2,
        transition_count=version,
    )


def outcome(index: int) -> Outcome:
    return Outcome(
        id=fresh_id("outcome"),
        time_s=time.monotonic(),
        index=index,
        chamfer_before_m2=9e-3 * 0.7 ** (index - 1),
        predicted_chamfer_m2=9e-3 * 0.66**index,
        chamfer_after_m2=9e-3 * 0.7**index,
        cost_before=0.6,
        cost_after=0.4,
        plan_s=7.0,
        model_version=index,
    )


def executed(path: np.ndarray) -> Executed:
    poses = np.column_stack([path, np.tile([1.0, 0, 0, 0], (len(path), 1))])
    return Executed(
        id=fresh_id("executed"),
        cause=(fresh_id("approved"),),
        time_s=time.monotonic(),
        approved_id=fresh_id("approved"),
        outcome="completed",
        reason="",
        times_s=np.linspace(0, 2, len(path)),
        commanded=poses,
        measured=poses + np.array([0.002, 0.001, 0, 0, 0, 0, 0]),
    )


def mode(name: ModeName) -> Mode:
    return Mode(id=fresh_id("mode"), time_s=time.monotonic(), mode=name, why="asked for by client 0")


def transition(before: np.ndarray, after: np.ndarray) -> Transition:
    return Transition(
        id=fresh_id("transition"),
        time_s=time.monotonic(),
        before=before,
        executed=executed(np.linspace((0.4, 0.0, 0.1), (0.5, 0.0, 0.1), 5)),
        after=after,
    )


def notice(where: str, text: str) -> Notice:
    return Notice(id=fresh_id("notice"), time_s=time.monotonic(), where=where, text=text)


def episode() -> Episode:
    return Episode(
        id=fresh_id("episode"),
        time_s=time.monotonic(),
        task="rope_push",
        rig="simulated",
        seed=4,
        simulated=True,
        code_version="0.1.0+g30439bb",
        config="{}",
    )


def goal() -> Goal:
    return Goal(id=fresh_id("goal"), time_s=time.monotonic(), positions=rope(-0.45, 2))


def scene(*, pushes: int = 3) -> list[Message]:
    """All messages up to the third push's proposal for approval, which is the last."""
    observed = rope(0.5)
    return [
        episode(),
        goal(),
        *(frame(camera(name, azimuth), observed) for name, azimuth in (("left", -1.0), ("right", 1.0))),
        particles(observed),
        *(model(version, 6e-5 / (1 + version)) for version in range(1, pushes + 1)),
        *(outcome(index) for index in range(1, pushes + 1)),
        notice("planner", "compiled rollout and gradient in 11 s"),
        notice("plan", "proposal-77aa dropped: the object moved by 9 mm meanwhile."),
        arm(),
        health(),
        proposal(observed),
    ]
