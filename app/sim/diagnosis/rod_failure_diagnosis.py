"""Autopsy of one rod: the first step after which something is wrong with it, where, and why.

A rope is simulated once more, alone, with every state kept; see `app.sim.diagnosis.failure_diagnosis` for the other
engine's.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Literal, TypeAlias, final

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Bool, Float32, Float64

from app.core.errors import ParameterError
from app.sim.diagnosis.faults import KEPT, FailureDiagnosis, SimulationFault
from app.sim.rods.checks import ROWS, RodSetup, out_of_domain, require_rod_inputs, require_rod_shapes
from app.sim.rods.domain import ROOM_M, are_whole, distances_m, gap_m, strains, strides_m
from app.sim.rods.effect import RodSetting
from app.sim.rods.energy import energies, has_gained_energy, near_strands
from app.sim.rods.geometry.verdict import crossings
from app.sim.rods.rollout import RodPhysics, make_rod_trace
from app.sim.rods.state import RodState
from app.sim.runtime.checks import Arrays, first, words

Kind: TypeAlias = Literal[
    "starts pressed",
    "finger inside",
    "passed through",
    "too fast",
    "stretched",
    "crossing",
    "energy",
    "outside",
    "not finite",
]

ADVICE: Mapping[str, str] = MappingProxyType(
    {
        "starts pressed": "begin beside the rope, or check where cameras and tool see the table",
        "finger inside": "push more slowly or with less of a bend, or shorten dt_s, so that contact can follow",
        "passed through": "make the finger's path of smaller steps",
        "too fast": "slow the finger or the start down, or shorten dt_s",
        "stretched": "shorten dt_s, make the rope heavier, or begin with segments of the length at rest",
        "crossing": "begin with strands that lie apart, and keep the finger from pushing one through the other",
        "energy": "shorten dt_s, or raise stiffest_n_m2 to the rope's rigidity",
        "outside": f"keep the rope within {ROOM_M:g} m of the origin",
        "not finite": "shorten dt_s, and look at the start for what is far from rest",
    }
)
PRESSED_M = 0.001
"""Initial penetration of finger and rope that is reported: the rope springs aside by three times as much and more."""
STRETCH = 0.05
"""Share of a segment's length by which it is longer or shorter where that is worth telling; see `domain.STRAIN`."""


@final
@dataclass(frozen=True, kw_only=True, eq=False)
class RodCase:
    """One candidate's simulation: arrays as a simulator takes them, with one candidate."""

    setup: RodSetup
    physics: RodPhysics
    phi: Float32[np.ndarray, "1 P"]
    state: RodState
    tool: Float32[np.ndarray, "1 T 3"]
    setting: RodSetting

    @property
    def substeps(self) -> int:
        """Number of time steps."""
        return self.tool.shape[1] - 1

    @property
    def summary(self) -> str:
        """The simulated objects and their numbers, in words."""
        scene = self.setup.scene
        return (
            f"a rod of {scene.nodes} nodes ({scene.length_m:g} m, radius {scene.radius_m:g} m), {self.substeps} steps "
            f"of {scene.dt_s:g} s, a finger of {scene.finger_radius_m:g} m, {len(scene.walls)} walls, "
            f"{len(self.setup.effects)} effects"
        )

    def dissect(self) -> "FailureDiagnosis[RodTrace, RodState]":
        """See `dissect_rod`."""
        return dissect_rod(self)


@final
@dataclass(frozen=True, kw_only=True, eq=False)
class RodTrace:
    """Numbers of the states after 0, 1, 2, ... steps: fastest node, longest or shortest segment, finger.

    `stretch`: by how much that segment is longer than at rest, as a share; `gap_m`: from the finger's core to the
    centreline, infinite where its tip is above the rope; `energy_j`: of motion, stretch, bending and bristles.
    """

    speed_m_s: Float64[np.ndarray, " K"]
    stretch: Float64[np.ndarray, " K"]
    gap_m: Float64[np.ndarray, " K"]
    energy_j: Float64[np.ndarray, " K"]

    def __len__(self) -> int:
        return len(self.speed_m_s)

    def columns(self) -> dict[str, list[str]]:
        """The numbers for people, by name."""
        return {
            "max speed [m/s]": [f"{speed:.4g}" for speed in self.speed_m_s],
            "stretch [%]": [f"{100 * share:+.3g}" for share in self.stretch],
            "finger to centreline [mm]": [f"{1e3 * gap:.1f}" if np.isfinite(gap) else "above" for gap in self.gap_m],
            "energy [mJ]": [f"{1e3 * energy:.3g}" for energy in self.energy_j],
        }


def single_rod(
    setup: RodSetup,
    physics: RodPhysics,
    state: RodState,
    tool: Arrays,
    phi: Arrays,
    setting: RodSetting,
    *,
    candidate: int = 0,
) -> RodCase:
    """One of many candidates as a case, on the host."""

    def row(leaf: Arrays) -> np.ndarray:
        return np.asarray(leaf, np.float32)[candidate : candidate + 1]

    return RodCase(
        setup=setup,
        physics=jax.tree.map(row, physics),
        phi=row(phi),
        state=jax.tree.map(row, state),
        tool=row(tool),
        setting=jax.tree.map(row, setting),
    )


def dissect_rod(case: RodCase) -> FailureDiagnosis[RodTrace, RodState]:
    """Simulate the case, and find where it broke. Raises ParameterError where its arrays do not fit its setup."""
    require_rod_shapes(case.setup, case.physics, case.phi, case.state, case.tool, case.setting)
    view = _view(case)
    faults: dict[str, SimulationFault] = {}
    for fault in _faults(view):
        faults.setdefault(fault.kind, fault)
    return FailureDiagnosis(
        steps=case.substeps,
        unit="step",
        failed=min(_failures(view), default=None),
        objection=_objection(case),
        faults=tuple(sorted(faults.values(), key=lambda fault: fault.step)),
        advice=ADVICE,
        trace=_trace(view),
        last=_last(view),
    )


def _objection(case: RodCase) -> str | None:
    try:
        require_rod_inputs(case.setup, case.physics, case.phi, case.state, case.tool, case.setting)
    except ParameterError as error:
        return str(error)
    return None


@final
@dataclass(frozen=True, kw_only=True, eq=False)
class _View:
    """A case's K states before the first that is not finite, and where the finger was then; `broken`: that state.

    `pressed_m`: how much nearer to the rope than contact lets it the finger begins.
    """

    case: RodCase
    nodes: Float32[np.ndarray, "K 8 n"]
    tips: Float32[np.ndarray, "K 3"]
    energy_j: Float64[np.ndarray, " K"]
    gains: Bool[np.ndarray, " K"]
    pressed_m: float
    broken: Float32[np.ndarray, "8 n"] | None

    @property
    def radius_m(self) -> float:
        """Radius of the rope."""
        return self.case.setup.scene.radius_m

    @property
    def half(self) -> Float32[np.ndarray, "K 2"]:
        """Vector from the middle of the finger's core to an end of it, at every state [m]."""
        return np.tile(np.asarray(self.case.physics.finger_half_m, np.float32), (len(self.nodes), 1))


def _view(case: RodCase) -> _View:
    """View of a case; without any step if an input besides the nodes is not finite."""
    state = case.state
    given = jax.tree.leaves((case.physics, case.phi, case.tool, case.setting, state.place, state.offset))
    if not all(np.isfinite(leaf).all() for leaf in given):
        none = np.zeros(0)
        start = np.zeros((0, *case.state.nodes.shape[1:]), np.float32)
        return _View(
            case=case, nodes=start, tips=case.tool[0, :0], energy_j=none, gains=none > 0, pressed_m=0.0, broken=None
        )
    history = make_rod_trace(case.setup.scene, case.setup.effects)(
        *jax.tree.map(jnp.asarray, (case.physics, case.state, case.tool, case.phi, case.setting))
    )
    nodes, finger, fields, springback = (np.asarray(leaf[0]) for leaf in history)
    wrong = first(np.asarray(~np.isfinite(nodes).all((1, 2))))
    count = len(nodes) if wrong is None else wrong[0]
    nodes, broken = nodes[:count], None if wrong is None else nodes[count]
    energy_j = energies(case.setup.scene, fields, float(springback), nodes)
    half = np.asarray(case.physics.finger_half_m[0], np.float32)
    gains = has_gained_energy(case.setup.scene, case.setup.effects, nodes, finger[:count], half, energy_j)
    tips, pressed_m = case.tool[0, :count], 0.0
    if count:
        gap = distances_m(*map(jnp.asarray, (nodes[:1, :2], tips[:1, :2], case.physics.finger_half_m))).min()
        pressed_m = float(finger[0, 2]) - float(gap)
    return _View(case=case, nodes=nodes, tips=tips, energy_j=energy_j, gains=gains, pressed_m=pressed_m, broken=broken)


def _failures(view: _View) -> Iterator[int]:
    """Numbers of steps from which on a rollout is NaN, for each reason that there is."""
    scene, tool = view.case.setup.scene, view.case.tool
    if not len(view.nodes):
        yield 0
        return
    if view.broken is not None:
        yield len(view.nodes)
    if wrong := first(_strides(view) > np.float32(scene.radius_m)):
        yield wrong[0] + 1
    if wrong := first(np.abs(tool[0]).max(1) > ROOM_M):
        yield wrong[0]
    if not bool(are_whole(scene, jnp.asarray(view.nodes[:1]))[0]):
        yield 0


def _faults(view: _View) -> Iterator[SimulationFault]:
    """The first fault of each kind among the states, and what broke the one after them."""
    if len(view.nodes):
        yield from _faults_of_rope(view)
        yield from _faults_of_finger(view)
    if view.broken is not None:
        node = int(np.argmax(~np.isfinite(view.broken).all(0)))
        rows = zip(ROWS, np.isfinite(view.broken[:, node]), strict=True)
        names = ", ".join(name for name, finite in rows if not finite)
        where = f", which was at {words(view.nodes[-1, :2, node])} m," if len(view.nodes) else ""
        yield _fault("not finite", len(view.nodes), node, f"node {node}{where} has no finite {names}")


def _faults_of_rope(view: _View) -> Iterator[SimulationFault]:
    scene, nodes = view.case.setup.scene, view.nodes
    speed, share = _speeds(view), _strains(view)
    if found := first(speed * scene.dt_s > scene.radius_m):
        text = f"moves at {speed[found]:.4g} m/s, {speed[found] * scene.dt_s / scene.radius_m:.3g} radii a step"
        yield _at_node(view, "too fast", found, text)
    if found := first(np.abs(share) > STRETCH):
        k, j = found
        text = f"segment {j} at {words(nodes[k, :2, j])} m is {100 * share[found]:+.3g} % longer than at rest"
        yield _fault("stretched", k, j, text)
    if found := first(out_of_domain(nodes)):
        yield _at_node(view, "outside", found, f"is farther than {ROOM_M:g} m from the origin")
    if found := first(view.gains):
        (k,) = found
        text = f"the rope has {1e3 * view.energy_j[k]:.3g} mJ, more than when it was last touched"
        yield _fault("energy", k, int(np.argmax(speed[k])), text)
    near = near_strands(scene, nodes)
    for k in np.flatnonzero(near).tolist():
        if len(pairs := crossings(nodes[k, :2].T.astype(np.float64))):
            i, j = pairs[0].tolist()
            yield _fault("crossing", k, i, f"segment {i} at {words(nodes[k, :2, i])} m crosses segment {j}")
            break


def _faults_of_finger(view: _View) -> Iterator[SimulationFault]:
    gap = _gaps(view)
    if view.pressed_m > PRESSED_M:
        j, pressed_mm = int(np.argmin(_distances(view)[0])), 1e3 * view.pressed_m
        text = f"the finger at {words(view.tips[0])} m is {pressed_mm:.3g} mm in what it should touch, segment {j}"
        yield _fault("starts pressed", 0, j, text)
    if found := first(gap < np.float32(view.radius_m)):
        (k,) = found
        j = int(np.argmin(_distances(view)[k]))
        text = f"the finger at {words(view.tips[k])} m is {1e3 * gap[k]:.3g} mm from the middle of segment {j}"
        yield _fault("finger inside", k, j, text)
    if found := first(_passes(view)):
        k, j = found
        text = f"segment {j} is on the other side of the finger, which went to {words(view.tips[k + 1])} m"
        yield _fault("passed through", k + 1, j, text)


def _fault(kind: Kind, step: int, index: int, text: str) -> SimulationFault:
    return SimulationFault.after(kind, step, index, text, unit="step")


def _at_node(view: _View, kind: Kind, found: tuple[int, ...], text: str) -> SimulationFault:
    k, i = found
    return _fault(kind, k, i, f"node {i} at {words(view.nodes[k, :2, i])} m {text}")


def _speeds(view: _View) -> Float64[np.ndarray, "K n"]:
    return np.linalg.norm(view.nodes[:, 2:4].astype(np.float64), axis=1)


def _strains(view: _View) -> Float32[np.ndarray, "K m"]:
    return np.asarray(strains(view.case.setup.scene.rest_m, jnp.asarray(view.nodes)))


def _gaps(view: _View) -> Float32[np.ndarray, " K"]:
    return np.asarray(gap_m(view.radius_m, *map(jnp.asarray, (view.nodes, view.tips, view.half))))


def _distances(view: _View) -> Float32[np.ndarray, "K m"]:
    return np.asarray(distances_m(*map(jnp.asarray, (view.nodes[:, :2], view.tips[:, :2], view.half))))


def _strides(view: _View) -> Float32[np.ndarray, " S"]:
    """Strides of the whole path, whatever became of the rope."""
    return np.asarray(strides_m(view.radius_m, jnp.asarray(view.case.tool)))[0]


def _passes(view: _View) -> Bool[np.ndarray, "S m"]:
    """Segments that are on the other side of the finger after a step, both times beside it, or that it crossed.

    Of a flat finger, which is not a point, five of its core: a rope that passes through it passes them.
    """
    down = view.tips[:, 2] < 2 * view.radius_m
    shares = np.linspace(-1, 1, 5) if view.half.any() else np.zeros(1)
    passed = [_passes_point(view, view.tips[:, :2].astype(np.float64) + share * view.half) for share in shares]
    return np.any(passed, axis=0) & (down[:-1] & down[1:])[:, None]


def _passes_point(view: _View, tip: Float64[np.ndarray, "K 2"]) -> Bool[np.ndarray, "S m"]:
    """The same of one point of the finger."""
    line = view.nodes[:, :2].astype(np.float64)
    edge, to = np.diff(line, axis=2), tip[:, :, None] - line[..., :-1]
    side = edge[:, 0] * to[:, 1] - edge[:, 1] * to[:, 0]
    share = (to * edge).sum(1) / (edge**2).sum(1)
    beside = (share >= 0) & (share <= 1)
    turned = side[:-1] * side[1:] < 0
    stroke = np.diff(tip, axis=0)[:, :, None]
    # Where on a segment, as it is after the step, the finger's way meets its line.
    before = tip[:-1, :, None] - line[1:, :, :-1]
    was = edge[1:, 0] * before[:, 1] - edge[1:, 1] * before[:, 0]
    met = share[1:] - (stroke * edge[1:]).sum(1) / (edge[1:] ** 2).sum(1) * side[1:] / np.where(
        side[1:] == was, np.inf, side[1:] - was
    )
    crossed = (was * side[1:] < 0) & (met >= 0) & (met <= 1)
    return (turned & beside[:-1] & beside[1:]) | crossed


def _trace(view: _View) -> RodTrace:
    share = _strains(view)
    worst = np.abs(share).argmax(1)[:, None]
    return RodTrace(
        speed_m_s=_speeds(view).max(1),
        stretch=np.take_along_axis(share, worst, 1)[:, 0].astype(np.float64),
        gap_m=_gaps(view).astype(np.float64),
        energy_j=view.energy_j,
    )


def _last(view: _View) -> RodState:
    """The last states, up to `KEPT`."""
    nodes = view.nodes[-KEPT:]
    place, offset = (np.repeat(leaf, len(nodes), axis=0) for leaf in (view.case.state.place, view.case.state.offset))
    return RodState(nodes=nodes, place=place, offset=offset)  # pyright: ignore[reportArgumentType] - on the host
