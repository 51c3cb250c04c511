"""Validation of a simulation's input on the host, before it costs anything; errors name index and value."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import NamedTuple, TypeAlias, final

import jax
import numpy as np
from jaxtyping import Bool, Float32, Float64

from app.core.errors import ParameterError
from app.sim.codegen.tool_composition import parts
from app.sim.effects.base import Effect
from app.sim.model.params import parameters_with, require_ranges, with_stiffness_up_to
from app.sim.model.scene import Scene
from app.sim.parameter import ParameterSpec
from app.sim.state import Setting, State
from app.sim.tools.base import COORDINATES, Tool

Arrays: TypeAlias = jax.Array | np.ndarray

UNIT = 1e-3
"""Tolerance on the norm of a quaternion about 1: another norm scales what it rotates."""

_AXES = "xyz"
_POSE = (*_AXES, "w", "qx", "qy", "qz", "opening")


@final
@dataclass(frozen=True, kw_only=True)
class Setup:
    """Configuration of a simulator: scene, number of particles of each body, effects."""

    scene: Scene
    counts: tuple[int, ...]
    effects: tuple[Effect, ...]

    def specs(self) -> tuple[ParameterSpec, ...]:
        """Specifications of the columns of phi."""
        return with_stiffness_up_to(parameters_with(self.effects), self.scene.stiffest_pa)

    def sizes(self) -> "Sizes":
        """Sizes of the arrays that its simulator takes."""
        return Sizes(len(self.specs()), sum(self.counts), parts(self.scene.tools)[2])


class Sizes(NamedTuple):
    """Sizes of the arrays that a simulator takes."""

    parameters: int
    particles: int
    coordinates: int


def require_counts(scene: Scene, counts: Sequence[int]) -> None:
    """Raises ParameterError where a body has no particle, or a count no body."""
    if len(counts) != len(scene.bodies):
        raise ParameterError(
            f"particle_count = {tuple(counts)} has {len(counts)} numbers; give one for each of the scene's "
            f"{len(scene.bodies)} bodies."
        )
    for body, count in enumerate(counts):
        if count < 1:
            raise ParameterError(f"particle_count of body {body} is {count}; it must be at least 1.")


def require_shapes(phi: Arrays, state: State, tool: Arrays, setting: Setting, sizes: Sizes) -> None:
    """Raises ParameterError where the arrays do not fit each other or the simulator."""
    candidates, particles = phi.shape[0] if phi.ndim else 0, sizes.particles
    substeps = max(2, tool.shape[1] if tool.ndim == 3 else 0)
    expected = {
        "phi": (phi.shape, (candidates, sizes.parameters)),
        "state.x": (state.x.shape, (candidates, particles, 3)),
        "state.v": (state.v.shape, (candidates, particles, 3)),
        "state.C": (state.C.shape, (candidates, particles, 3, 3)),
        "state.F": (state.F.shape, (candidates, particles, 3, 3)),
        "tool": (tool.shape, (candidates, substeps, sizes.coordinates)),
        "setting.label": (setting.label.shape, (candidates, particles, 4)),
        "setting.time": (setting.time.shape, (candidates,)),
    }
    for name, (given, wanted) in expected.items():
        if tuple(given) != wanted:
            raise ParameterError(f"{name} has shape {tuple(given)}; this simulator takes {wanted}.")


def require_inputs(setup: Setup, phi: Arrays, state: State, tool: Arrays, setting: Setting) -> None:
    """Raises ParameterError for the first number that no simulation can begin with, and says which it is."""
    require_counts(setup.scene, setup.counts)
    require_shapes(phi, state, tool, setting, setup.sizes())
    path = np.asarray(tool, np.float32)
    _require_finite(setup, phi, state, path, setting)
    require_ranges(setup.specs(), np.asarray(phi, np.float32))
    _require_volume(np.asarray(state.F, np.float64))
    _require_inside(setup.scene, np.asarray(state.x, np.float32))
    _require_slow(setup.scene, np.asarray(state.v, np.float64))
    _require_path(setup.scene, path)


def require_finite(name: str, values: Arrays, axis: str, columns: Sequence[str]) -> None:
    """Raises ParameterError for the first number of B candidates' `values` that is not finite, and says which it is.

    Values have the shape (B, rows..., columns...): `axis` is what a row is, "" where there is one; `columns` name the
    numbers of a row.
    """
    array = np.asarray(values)
    flat = array.reshape(array.shape[0], -1, len(columns)) if columns else array
    if wrong := first(~np.isfinite(flat)):
        b, row, column = wrong
        where = f", {axis} {row}" if axis else ""
        raise ParameterError(
            f"{name} is {flat[wrong]} for candidate {b}{where}, component {columns[column]}; every number must be "
            "finite: look where this one is computed."
        )


def inside(scene: Scene, x: Float32[np.ndarray, "*batch 3"]) -> Bool[np.ndarray, "*batch"]:
    """True if all 27 nodes around a particle exist, by the kernels' rule; False for NaN."""
    q = (x - np.asarray(scene.low, np.float32)) * np.float32(1 / scene.cell_m)
    return np.all((q >= 0.5) & (q < np.asarray(scene.shape, np.float32) - 1.5), axis=-1)


def room(scene: Scene) -> str:
    """Text for people: the box in which particles may be."""
    low = np.asarray(scene.low) + 0.5 * scene.cell_m
    high = np.asarray(scene.low) + (np.asarray(scene.shape) - 1.5) * scene.cell_m
    return f"{words(low)} to {words(high)} m"


def words(point: np.ndarray) -> str:
    """A point or vector for people."""
    return f"({', '.join(f'{number + 0.0:.4g}' for number in point)})"


def _require_finite(
    setup: Setup, phi: Arrays, state: State, tool: Float32[np.ndarray, "B T A"], setting: Setting
) -> None:
    pairs = [f"{a}{b}" for a in _AXES for b in _AXES]
    particles = [("x", _AXES), ("v", _AXES), ("C", pairs), ("F", pairs)]
    named = [
        ("phi", phi, "", [spec.name for spec in setup.specs()]),
        *((f"state.{name}", getattr(state, name), "particle", columns) for name, columns in particles),
        ("tool", tool, "path point", _coordinates(setup.scene.tools)),
        ("setting.label", setting.label, "particle", [str(column) for column in range(4)]),
        ("setting.time", np.asarray(setting.time)[:, None], "", ["time"]),
    ]
    for name, values, axis, columns in named:
        require_finite(name, values, axis, columns)


def _require_volume(F: Float64[np.ndarray, "B N 3 3"]) -> None:
    volume = np.linalg.det(F)
    if wrong := first(volume <= 0):
        b, p = wrong
        raise ParameterError(
            f"Particle {p} of candidate {b} has the relative volume det F = {volume[wrong]:.4g}; it must be positive: "
            "begin with an F that is not turned inside out, the identity where nothing is known."
        )


def _require_inside(scene: Scene, x: Float32[np.ndarray, "B N 3"]) -> None:
    if wrong := first(~inside(scene, x)):
        b, p = wrong
        raise ParameterError(
            f"Particle {p} of candidate {b} is at {words(x[wrong])} m, outside of where the grid can hold it, "
            f"{room(scene)}; move it, or widen the scene's low and high."
        )


def _require_slow(scene: Scene, v: Float64[np.ndarray, "B N 3"]) -> None:
    speed = np.linalg.norm(v, axis=-1)
    if wrong := first(speed * scene.dt_s >= scene.cell_m):
        b, p = wrong
        raise ParameterError(
            f"Particle {p} of candidate {b} moves at {speed[wrong]:.4g} m/s, {_too_far(scene, float(speed[wrong]))}; "
            f"slow it down, or shorten dt_s below {scene.cell_m / speed[wrong]:.3g} s."
        )


def _require_path(scene: Scene, tool: Float32[np.ndarray, "B T A"]) -> None:
    """No tool may jump over matter, and quaternions turn without stretching."""
    at = 0
    for number, one in enumerate(scene.tools):
        pose = tool[..., at : at + COORDINATES[one.motion]]
        at += COORDINATES[one.motion]
        for name, part in _lengths(pose):
            speed = np.linalg.norm(np.diff(part, axis=1), axis=-1) / scene.dt_s
            if wrong := first(speed * scene.dt_s >= scene.cell_m):
                b, s = wrong
                raise ParameterError(
                    f"Tool {number} of candidate {b}: its {name} goes from {words(part[b, s])} to "
                    f"{words(part[b, s + 1])} m in substep {s}, {_too_far(scene, float(speed[wrong]))}; make the "
                    "path of smaller steps."
                )
        turn = np.linalg.norm(pose[..., 3:7], axis=-1)
        if pose.shape[-1] > 3 and (wrong := first(np.abs(turn - 1) > UNIT)):
            raise ParameterError(
                f"Tool {number} of candidate {wrong[0]}: the quaternion of path point {wrong[1]} has the length "
                f"{turn[wrong]:.4g}; divide it by its length."
            )


def _lengths(pose: Float32[np.ndarray, "B T A"]) -> Iterator[tuple[str, np.ndarray]]:
    """The parts of a pose that are lengths [m]."""
    if pose.shape[-1] >= 3:
        yield "position", pose[..., :3]
    if pose.shape[-1] == 8:
        yield "opening", pose[..., 7:]


def _coordinates(tools: Sequence[Tool]) -> list[str]:
    """The names of the columns of a tool path."""
    return [f"tool {number} {name}" for number, tool in enumerate(tools) for name in _POSE[: COORDINATES[tool.motion]]]


def _too_far(scene: Scene, speed: float) -> str:
    return f"{speed * scene.dt_s / scene.cell_m:.3g} cells of {scene.cell_m:g} m a substep where less than 1 is allowed"


def first(wrong: Bool[np.ndarray, "..."]) -> tuple[int, ...] | None:
    """The index of the first True, None where there is none."""
    if not wrong.any():
        return None
    return tuple(int(number) for number in np.unravel_index(int(np.argmax(wrong)), wrong.shape))
