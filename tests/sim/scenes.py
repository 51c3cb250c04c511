"""Small scenes for the simulator's laws: a short piece of rope, a finger beside it."""

from dataclasses import replace

import numpy as np

from app.sim.model.params import index, nominal_phi
from app.sim.model.scene import Body, Scene

SCENE = Scene(
    low=(0.42, -0.10, -0.02),
    high=(0.60, 0.10, 0.07),
    cell_m=0.010,
    dt_s=5e-4,
    bodies=(Body(volume_m3=np.pi * 0.008**2 * 0.08, density_kg_m3=800.0),),
)
"""A piece of rope, 80 mm long, along x at the middle of a grid of 19 x 21 x 10 nodes."""

PARTICLES = 60


def floating(scene: Scene = SCENE) -> Scene:
    """The same without gravity."""
    return replace(scene, gravity_m_s2=0.0, damping_1_s=0.0)


def rope(count: int = PARTICLES, *, length_m: float = 0.08, height_m: float = 0.008, seed: int = 0) -> np.ndarray:
    """Particles (N, 3) of a straight rope of 8 mm radius along x about (0.51, 0)."""
    rng = np.random.default_rng(seed)
    radius, angle = 0.008 * np.sqrt(rng.random(count)), 2 * np.pi * rng.random(count)
    along = length_m * ((np.arange(count) + 0.5) / count - 0.5)
    return np.stack([0.51 + along, radius * np.cos(angle), height_m + radius * np.sin(angle)], axis=1).astype(
        np.float32
    )


def block(side: int, *, spacing_m: float, low: tuple[float, float, float]) -> np.ndarray:
    """A cube of side^3 evenly spaced particles."""
    axes = np.meshgrid(*[np.arange(side) + 0.5] * 3, indexing="ij")
    return (np.stack(axes, axis=-1).reshape(-1, 3) * spacing_m + np.asarray(low)).astype(np.float32)


def phi_with(**values: float) -> np.ndarray:
    """The nominal parameters but for these."""
    phi = nominal_phi()
    for name, value in values.items():
        phi[index(name)] = value
    return phi


def straight_tool(start: tuple[float, float, float], velocity: tuple[float, float, float], steps: int) -> np.ndarray:
    """Tip positions (steps + 1, 3) at constant velocity [m/s] for SCENE's time step."""
    times = SCENE.dt_s * np.arange(steps + 1)[:, None]
    return (np.asarray(start) + times * np.asarray(velocity)).astype(np.float32)


def far_tool(steps: int) -> np.ndarray:
    """A finger that touches nothing."""
    return straight_tool((0.3, 0.0, 0.3), (0.0, 0.0, 0.0), steps)
