"""Energy of rods: what moves, is stretched or bent, and steps in which it grows without a cause."""

from collections.abc import Sequence

import jax.numpy as jnp
import numpy as np
from jaxtyping import Bool, Float32, Float64

from app.sim.effects.base import Effect
from app.sim.rods.domain import distances_m, strains
from app.sim.rods.rollout import rod_numbers
from app.sim.rods.scene import RodScene
from app.sim.rods.state import bends

_APART = 5
"""Segments nearer along the rope do not touch, as in own.h."""
_GAIN, _LEAST_M_S = 2.0, 0.02
"""The factor by which energy may grow between time steps of a rope that nothing touches, and the speed of all of it
whose energy does not count: a step of explicit Euler conserves a neighbouring energy, not this one."""


def energies(
    scene: RodScene, fields: Float32[np.ndarray, "3 n"], springback: float, nodes: Float32[np.ndarray, "K 8 n"]
) -> Float64[np.ndarray, " K"]:
    """Energies of motion, stretch, bending and the table's bristles together [J], by the laws of rod.h.

    `fields` and `springback` as in `RodHistory`.
    """
    k, (mass, bending, curved) = rod_numbers(scene), fields.astype(np.float64)
    state = nodes.astype(np.float64)
    moving = (mass * (state[:, 2:4] ** 2).sum(1)).sum(1) / 2
    share = np.asarray(strains(k.rest, jnp.asarray(nodes)), np.float64)
    stretched = k.stretch * k.rest * (share**2).sum(1) / 2
    angle = np.asarray(bends(jnp.asarray(nodes[:, :2])), np.float64)
    beyond = angle - np.clip(angle, -k.tightest, k.tightest)
    elastic = angle - curved[1:-1] - state[:, 7, 1:-1]
    sprung = springback * state[:, 7, 1:-1] ** 2
    bent = (bending[1:-1] * (elastic**2 + sprung) + k.stop * beyond**2).sum(1) / 2
    held = k.table * (state[:, 4:6] ** 2).sum((1, 2)) / 2
    return moving + stretched + bent + held


def has_gained_energy(
    scene: RodScene,
    effects: Sequence[Effect],
    nodes: Float32[np.ndarray, "K 8 n"],
    finger: Float32[np.ndarray, "K 4"],
    half: Float32[np.ndarray, "2"],
    energy_j: Float64[np.ndarray, " K"],
) -> Bool[np.ndarray, " K"]:
    """States with more energy than when neither finger nor another strand touched the rope any more.

    `half`: from the middle of the finger's core to an end of it [m]. None where walls or effects may add some: walls
    push, and effects pull as they like.
    """
    if scene.walls or any(effect.rod is not None and effect.rod.velocity for effect in effects):
        return np.zeros(len(nodes), bool)
    touched = np.zeros(len(nodes), bool)
    if len(nodes) > 1:
        # In a step nodes are where they were, and the finger is where it goes.
        core = np.tile(half, (len(nodes) - 1, 1))
        gap = np.asarray(distances_m(*map(jnp.asarray, (nodes[:-1, :2], finger[1:, :2], core)))).min(1)
        touched[1:] = (gap < finger[1:, 2]) | near_strands(scene, nodes[:-1])
    least_j = scene.mass_kg * _LEAST_M_S**2 / 2
    since = np.maximum.accumulate(np.where(touched, np.arange(len(nodes)), 0))
    return ~touched & (energy_j > _GAIN * energy_j[since] + least_j)


def near_strands(scene: RodScene, nodes: Float32[np.ndarray, "K 8 n"]) -> Bool[np.ndarray, " K"]:
    """States in which strands of the rope may touch: nodes nearer than its thickness and a segment."""
    near, line = np.zeros(len(nodes), bool), nodes[:, :2]
    reach = 2 * scene.radius_m + scene.rest_m
    for lag in range(_APART, line.shape[2]):
        near |= ((line[..., lag:] - line[..., :-lag]) ** 2).sum(1).min(1) < reach**2
    return near
