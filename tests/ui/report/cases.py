"""Case files as discovery would conclude them, from a seed: a rope of 0.4 m that is pushed about a table."""

from dataclasses import replace

import numpy as np

from app.core.geometry.track import Track
from app.discovery.dataset.model_under_test import Family
from app.discovery.results.case import (
    Amount,
    Case,
    CauseResult,
    Estimate,
    Example,
    Formula,
    FrameTest,
    Gain,
    Limit,
    NextPush,
    Power,
    ResidualField,
    Term,
)

N = 240
PUSHES, EPISODES = 24, 6
_POWERS = (
    ("hand_eye_translation", "hand_eye_x", 0.0008, 0.003, "m"),
    ("hand_eye_translation", "hand_eye_y", 0.0009, 0.003, "m"),
    ("camera_time_offset", "camera_time_offset", 0.011, 0.03, "s"),
    ("table_tilt", "tilt_x", 0.82, 1.0, "deg"),
    ("friction_drift", "friction_drift", 0.21, 0.4, "1/session"),
    ("stribeck", "stribeck_excess", 0.62, 0.4, "1"),
    ("viscous_film", "film_drag", 4.4, 6.0, "1/s"),
    ("rest_curvature", "rest_curvature", 1.9, 4.0, "1/m"),
    ("tool_compliance", "tool_compliance", 0.09, 0.02, "m/N"),
    ("kelvin_voigt", "solid_viscosity", float("inf"), 10.0, "Pa s"),
    ("shear_thinning", "flow_index", float("inf"), 0.6, "1"),
)


def rope(bend: float, centre: tuple[float, float], turn: float = 0.0, seed: int = 0) -> np.ndarray:
    """A rope of 0.4 m lying on the table; shape (N, 3) [m]."""
    rng = np.random.default_rng(seed)
    s = np.linspace(-0.2, 0.2, N)
    heading = turn + bend * 4 * s
    x, y = np.cumsum(np.cos(heading)) * 0.4 / N, np.cumsum(np.sin(heading)) * 0.4 / N
    across = rng.uniform(-0.006, 0.006, N)
    spine = np.stack([x - x.mean() + centre[0], y - y.mean() + centre[1]], axis=1)
    normal = np.stack([-np.sin(heading), np.cos(heading)], axis=1)
    z = 0.006 + np.sqrt(0.006**2 - across**2) * rng.choice([-1.0, 1.0], N)
    return np.column_stack([spine + across[:, None] * normal, z]).astype(np.float32)


def pushed(points: np.ndarray, start: np.ndarray, way: np.ndarray) -> np.ndarray:
    """The rope after a finger went from `start` by `way` [m]: what was near it went along."""
    near = np.exp(-(((points[:, :2] - start - way / 2) ** 2).sum(1)) / (2 * 0.05**2))
    moved = points.astype(np.float64)
    moved[:, :2] += near[:, None] * way
    return moved.astype(np.float32)


def track(start: np.ndarray, way: np.ndarray) -> Track:
    """Down beside the rope, through it, and up."""
    times = np.linspace(0.0, 3.0, 61)
    share = np.interp(times, [0.6, 2.4], [0.0, 1.0])
    x, y = start[0] - 0.2 * way[0] + 1.2 * share * way[0], start[1] - 0.2 * way[1] + 1.2 * share * way[1]
    z = np.interp(times, [0.0, 0.5, 2.5, 3.0], [0.1, 0.006, 0.006, 0.1])
    turned = np.tile([1.0, 0.0, 0.0, 0.0], (len(times), 1))
    return Track(times_s=times, poses=np.column_stack([x, y, z, turned]))


def examples(shift: tuple[float, float] = (0.0036, -0.0021), left: float = 0.2, count: int = 4) -> tuple[Example, ...]:
    """Held-out pushes; the nominal model is off by `shift` and more where the finger was, the extended by a share."""
    rng = np.random.default_rng(3)
    made = list[Example]()
    for number in range(count):
        centre = (float(rng.uniform(0.48, 0.62)), float(rng.uniform(-0.1, 0.1)))
        before = rope(float(rng.uniform(-1.2, 1.2)), centre, turn=float(rng.uniform(-0.9, 0.9)), seed=number)
        start = before[N // 3 + 20 * number, :2].astype(np.float64)
        angle = rng.uniform(0, 2 * np.pi)
        way = 0.07 * np.array([np.cos(angle), np.sin(angle)])
        observed = pushed(before, start, way) + rng.normal(0, 0.0006, before.shape).astype(np.float32)
        near = np.exp(-(((observed[:, :2] - start - way) ** 2).sum(1)) / (2 * 0.07**2))[:, None]
        error = np.array([*shift, 0.0]) * (0.6 + 1.9 * near)
        nominal, extended = pushed(before, start, way) - error, pushed(before, start, way) - left * error
        made.append(
            Example(
                number=4 * number + 3,
                before=before,
                observed=observed,
                nominal=nominal.astype(np.float32),
                extended=extended.astype(np.float32),
                tool=track(start, way).positions,
            )
        )
    return tuple(made)


def arrows(shift: tuple[float, float] = (0.0036, -0.0021), noise: float = 0.0009) -> ResidualField:
    """Residuals along the rope in all pushes: a constant part, a bit of swirl, and noise that is smooth along it."""
    rng = np.random.default_rng(5)
    places, displacements, push, along = [], [], [], []
    for number in range(PUSHES):
        centre = (float(rng.uniform(0.45, 0.66)), float(rng.uniform(-0.15, 0.15)))
        points = rope(float(rng.uniform(-1.5, 1.5)), centre, turn=float(rng.uniform(-1.5, 1.5)), seed=number)[::10]
        s = np.linspace(-1, 1, len(points))
        smooth = sum(rng.normal(0, noise, 2) * np.cos(np.pi / 2 * k * (s[:, None] + 1)) for k in range(3))
        bump = 1 + 0.8 * np.exp(-((s[:, None] - rng.uniform(-0.6, 0.6)) ** 2) / 0.08)
        places.append(points[:, :2])
        displacements.append(np.array(shift) * bump + smooth)
        push.append(np.full(len(points), number))
        along.append(s)
    return ResidualField(
        places=np.concatenate(places).astype(np.float32),
        displacements=np.concatenate(displacements).astype(np.float32),
        push=np.concatenate(push).astype(np.float32),
        along=np.concatenate(along).astype(np.float32),
    )


def estimate(name: str, value: float, half: float, unit: str, null: float = 0.0, about: str = "") -> Estimate:
    return Estimate(name=name, about=about, value=value, unit=unit, low=value - half, high=value + half, null=null)


def blame(
    effect: str, family: Family, about: str, probability: float, log_bayes: float, *estimates: Estimate
) -> CauseResult:
    return CauseResult(
        effect=effect,
        family=family,
        about=about,
        estimates=estimates,
        probability=probability,
        log_bayes=log_bayes,
    )


def hand_eye(probability: float = 0.97) -> CauseResult:
    return blame(
        "hand_eye_translation",
        "sensing",
        "Hand-eye translation: the cameras are elsewhere than the calibration says, x_observed = x + t.",
        probability,
        91.3,
        estimate(
            "hand_eye_x", 0.00363, 0.00041, "m", about="Offset of what the cameras see from where it is, along x."
        ),
        estimate(
            "hand_eye_y", -0.00212, 0.0005, "m", about="Offset of what the cameras see from where it is, along y."
        ),
        estimate("hand_eye_z", 0.0002, 0.0006, "m", about="Offset of what the cameras see from where it is, along z."),
    )


def drift(probability: float) -> CauseResult:
    return blame(
        "friction_drift",
        "physics",
        "Friction drift: mu (1 + d t) over a session, t from -0.5 at its beginning to 0.5 at its end.",
        probability,
        2.4,
        estimate("friction_drift", 0.31, 0.19, "1/session", about="Change of the table's friction over the session."),
    )


def stribeck(probability: float) -> CauseResult:
    return blame(
        "stribeck",
        "physics",
        "Stribeck effect (static above kinetic friction): mu (1 + r exp(-(v / v_s)^2)) at the sliding speed v.",
        probability,
        14.1,
        estimate("stribeck_excess", 0.52, 0.17, "1", about="How much greater friction is at rest than when sliding."),
        estimate("stribeck_speed", 0.06, 0.03, "m/s", null=0.1, about="Speed beyond which the excess is gone."),
    )


def film(probability: float) -> CauseResult:
    return blame(
        "viscous_film",
        "physics",
        "A viscous film on the table: near it, matter is slowed in proportion to its velocity, a = -c v.",
        probability,
        13.2,
        estimate("film_drag", 7.4, 2.2, "1/s", about="Rate at which a viscous film slows what touches the table."),
    )


def others() -> tuple[CauseResult, ...]:
    return (
        blame(
            "camera_time_offset",
            "sensing",
            "Camera time offset: an image shows what was d later than its time stamp says.",
            0.006,
            -1.2,
            estimate("camera_time_offset", 0.004, 0.009, "s"),
        ),
        blame(
            "table_tilt",
            "physics",
            "Table tilt.",
            0.004,
            -2.0,
            estimate("tilt_x", 0.2, 0.5, "deg"),
            estimate("tilt_y", -0.1, 0.4, "deg"),
        ),
        blame(
            "actuator_lag",
            "actuation",
            "Actuator lag of first order.",
            0.002,
            -2.2,
            estimate("actuator_lag", 0.008, 0.02, "s"),
        ),
        blame(
            "resolution",
            "numerics",
            "Share of the way to a grid finer by a fifth.",
            0.001,
            -3.0,
            estimate("resolution", 0.2, 0.6, "1"),
        ),
        blame("rest_curvature", "physics", "Rest curvature.", 0.001, -3.1, estimate("rest_curvature", 0.4, 1.1, "1/m")),
    )


def checks() -> tuple[Estimate, ...]:
    rows = (
        ("command delay", "The measured pose against the command.", 0.004, -0.003, 0.011, 0.0, "s"),
        ("gain of the arm", "Stroke made over stroke commanded.", 0.997, 0.991, 1.003, 1.0, "1"),
        ("gripper seen, x", "The finger in the images against kinematics.", 0.0037, 0.0031, 0.0043, 0.0, "m"),
        ("gripper seen, y", "The finger in the images against kinematics.", -0.0020, -0.0027, -0.0013, 0.0, "m"),
        ("table plane, height", "The bare table against z = 0.", 0.0003, -0.0004, 0.0010, 0.0, "m"),
        ("table plane, tilt", "The bare table against level.", 0.05, -0.08, 0.18, 0.0, "deg"),
    )
    return tuple(
        Estimate(name=name, about=about, value=value, low=low, high=high, null=expected, unit=unit)
        for name, about, value, low, high, expected, unit in rows
    )


def frames(best: str) -> tuple[FrameTest, ...]:
    abouts = {
        "world": "Fixed on the table: places, slopes, the frame of the robot.",
        "camera": "Along the line of sight.",
        "tool": "Along and across the motion of the tool.",
        "material": "Fixed on the object, along its length.",
        "time": "Growing or fading over the session.",
    }
    explained = {"world": 0.22, "camera": 0.31, "tool": 0.12, "material": 0.08, "time": 0.05, best: 0.71}
    return tuple(
        FrameTest(
            frame=frame,
            about=about,
            explained=explained[frame],
            low=explained[frame] - 0.05,
            high=explained[frame] + 0.08,
        )
        for frame, about in abouts.items()
    )


CONFUSED = ("hand_eye_translation", "tcp_offset", "table_tilt", "friction_drift", "stribeck", "viscous_film", "none")
CONFUSIONS = np.array(
    [
        [0.94, 0.04, 0.0, 0.0, 0.0, 0.0, 0.02],
        [0.06, 0.92, 0.0, 0.0, 0.0, 0.0, 0.02],
        [0.0, 0.0, 0.81, 0.02, 0.0, 0.03, 0.14],
        [0.0, 0.0, 0.02, 0.88, 0.02, 0.0, 0.08],
        [0.0, 0.0, 0.0, 0.03, 0.55, 0.38, 0.04],
        [0.0, 0.0, 0.02, 0.0, 0.31, 0.63, 0.04],
        [0.01, 0.01, 0.02, 0.01, 0.0, 0.0, 0.95],
    ]
)


def errors(nominal: float, extended: float) -> tuple[np.ndarray, np.ndarray]:
    """Per episode (E, 2), and over 1, 2, ... pushes (S, 2) [mm]."""
    rng = np.random.default_rng(8)
    spread = rng.normal(1.0, 0.11, (EPISODES, 1)) * rng.normal(1.0, 0.05, (EPISODES, 2))
    growth = np.array([1.0, 1.6, 2.1, 2.5])[:, None] ** np.array([1.0, 0.8])
    return spread * [nominal, extended], growth * [nominal, extended]


def next_push() -> NextPush:
    before = rope(0.5, (0.56, 0.03), turn=1.2, seed=9)
    start, way = before[N // 2, :2].astype(np.float64), np.array([0.09, 0.02])
    ends = (pushed(before, start, way), pushed(before, start, 0.86 * way))
    return NextPush(
        track=track(start, way),
        between=("stribeck", "viscous_film"),
        apart_mm=6.2,
        before=before,
        ends=ends,
        text="Push the middle of the rope at 5 cm/s; Stribeck friction and a viscous film differ by 6 mm there.",
    )


def named() -> Case:
    """A hand-eye error that was found."""
    per_episode, steps = errors(5.6, 1.9)
    cause = hand_eye()
    theta = np.zeros(3)
    return Case(
        amount=Amount(task="rope_push", episodes=EPISODES, pushes=PUSHES, during=96, measured=PUSHES, particles=N),
        limits=(),
        checks=checks(),
        verdict="named",
        sentences=(
            "The cameras see everything 4.2 mm from where it is: 3.6 mm along x and 2.1 mm against y.",
            "Finger and rope agree on it, and the error is the same all over the table and in all episodes.",
            "With it, two thirds of the error on pushes that were not fitted are gone.",
        ),
        causes=(cause,),
        formula=None,
        ranking=(cause, drift(0.011), *others()),
        leftover=0.04,
        confused=CONFUSED,
        confusions=CONFUSIONS,
        arrows=arrows(),
        frames=frames("world"),
        gain=Gain(still_mm=14.2, nominal_mm=5.6, extended_mm=1.9, gain=0.66, low=0.58, high=0.73, episodes=EPISODES),
        per_episode=per_episode,
        steps=steps,
        examples=examples(),
        powers=tuple(
            Power(effect=effect, parameter=parameter, least=least, typical=typical, unit=unit)
            for effect, parameter, least, typical, unit in _POWERS
        ),
        next_push=None,
        nominal=(
            estimate("stiffness", 23100.0, 3200.0, "Pa", null=20000.0, about="Young's modulus of the object."),
            estimate("table_friction", 0.371, 0.018, "1", null=0.4, about="Friction between the object and the table."),
        ),
        about=theta,
        extended=theta,
        estimated=(),
        covariance=np.zeros((0, 0)),
        spent_s=(
            ("direct checks", 1.4),
            ("nominal fit", 38.2),
            ("slopes", 121.0),
            ("weighing", 9.6),
            ("refits", 210.4),
            ("confusions", 88.7),
            ("held-out pushes", 41.0),
        ),
    )


def a_set() -> Case:
    """Two causes that these data cannot tell apart, limits, and the push that would."""
    per_episode, steps = errors(6.4, 4.1)
    return replace(
        named(),
        amount=Amount(task="rope_push", episodes=EPISODES, pushes=PUSHES, during=0, measured=0, particles=N),
        verdict="set",
        sentences=(
            "The rope stops earlier than the model says where it moves slowly.",
            "Stribeck friction or a viscous film: these data cannot tell them apart; all pushes have one speed.",
        ),
        limits=(
            Limit(
                text="No clouds were taken while the tool moved.",
                consequence="Delays and speeds cannot be told from forces.",
            ),
            Limit(text="Nobody measured the arm's poses.", consequence="What the arm does not do looks like friction."),
        ),
        causes=(stribeck(0.54), film(0.39)),
        ranking=(stribeck(0.54), film(0.39), drift(0.03), *others()),
        arrows=arrows((0.0, 0.0), 0.0022),
        frames=frames("tool"),
        gain=Gain(still_mm=12.9, nominal_mm=6.4, extended_mm=4.1, gain=0.36, low=0.22, high=0.47, episodes=EPISODES),
        per_episode=per_episode,
        steps=steps,
        examples=examples((0.004, 0.002), 0.55),
        next_push=next_push(),
    )


def none() -> Case:
    """A model that lacks nothing; nothing to gain, and hardly anything measured."""
    nothing = ResidualField(
        places=np.zeros((0, 2), np.float32),
        displacements=np.zeros((0, 2), np.float32),
        push=np.zeros(0, np.float32),
        along=np.zeros(0, np.float32),
    )
    return replace(
        named(),
        amount=Amount(task="rope_push", episodes=1, pushes=4, during=0, measured=4, particles=N),
        verdict="none",
        sentences=("What is left is as large as the noise of these recordings, and it has no pattern.",),
        limits=(Limit(text="There is one episode only.", consequence="No cause may be named from it.", fatal=True),),
        checks=(),
        causes=(),
        ranking=others(),
        confused=(),
        confusions=np.zeros((0, 0)),
        arrows=nothing,
        frames=(),
        gain=Gain(still_mm=13.0, nominal_mm=2.0, extended_mm=2.0, gain=np.nan, low=-np.inf, high=np.inf, episodes=0),
        per_episode=np.zeros((0, 2)),
        steps=np.zeros((0, 2)),
        examples=(),
        leftover=float("nan"),
    )


def none_of_these() -> Case:
    """Something that no cause of the catalogue is, with the formula that was found for it."""
    swirl = Term(
        formula="0.815/m n x (x - (0.51, 0.08) m)",
        words="a force that swirls about (0.51, 0.08) m, counter-clockwise, 8 1/s^2",
        estimates=(
            estimate("push_x", 0.068, 0.01, "1", about="Push along x, as a share of weight."),
            estimate("push_y", 0.031, 0.012, "1", about="Push along y, as a share of weight."),
            estimate("swirl", 0.815, 0.09, "1/m", about="Push round a point, by each metre from it."),
            estimate("about_x", 0.512, 0.014, "m", null=np.nan, about="Where the force vanishes, along x."),
            estimate("about_y", 0.083, 0.011, "m", null=np.nan, about="Where the force vanishes, along y."),
        ),
    )
    formula = Formula(
        text="f / (m g) = 0.815/m n x (x - (0.51, 0.08) m)",
        words="A force that swirls about (0.51, 0.08) m, counter-clockwise, 8 1/s^2.",
        terms=(swirl,),
    )
    field = arrows((0.0, 0.0), 0.0006)
    away = field.places - np.array([0.512, 0.083], np.float32)
    r = np.linalg.norm(away, axis=1, keepdims=True) / 0.11
    turned = np.stack([-away[:, 1], away[:, 0]], axis=1) / 0.11 * np.exp(-(r**2)) * 0.009
    return replace(
        a_set(),
        amount=named().amount,
        verdict="none_of_these",
        sentences=(
            "Something acts that no known cause explains, with a probability of 96 %.",
            "It is best said as a force. A force that swirls about (0.51, 0.08) m, counter-clockwise, 8 1/s^2.",
        ),
        limits=(),
        causes=(),
        ranking=(drift(0.06), *others()),
        formula=formula,
        leftover=0.96,
        arrows=replace(field, displacements=(field.displacements + turned).astype(np.float32)),
        frames=frames("world"),
        next_push=None,
    )


CASES = {"named": named, "set": a_set, "none": none, "none_of_these": none_of_these}
