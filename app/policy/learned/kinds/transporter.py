"""Transporter networks (Zeng et al. 2020, "Transporter networks: rearranging the visual world").

Where to begin is a pixel that a network chooses (equation 2); where to end, the pixel whose surroundings correlate most
with those of the beginning (equation 3), which are turned by several angles. For pushes and sweeps the two are the ends
of the stroke, as in the paper's tasks of pushing; what a push of many displacements does between them is fitted to the
demonstrations, in the frame of the stroke.
"""

from dataclasses import dataclass
from functools import partial
from math import pi
from typing import ClassVar, Final, Protocol, final, runtime_checkable

import flax.linen as nn
import jax
import jax.numpy as jnp
import optax
from jax.scipy.ndimage import map_coordinates
from jaxtyping import Array, Float, Int, PRNGKeyArray

from app.core.errors import UsageError
from app.policy.base import ActionDistribution
from app.policy.learned.base import Lessons, NextOnly, Params, Scale, Shown
from app.policy.learned.networks import Dense, Eyes, apply_network
from app.policy.learned.sight import PolicyObservation
from app.policy.orthographic_views import OrthographicView

_NEAR: Final = 1
"""Radius around the likeliest pixel within which it is refined, by the mean over the probabilities."""


_FAINT: Final = nn.initializers.variance_scaling(0.01, "fan_in", "truncated_normal")
"""Initialiser of features that are correlated over a crop: pixels are about equally likely before training."""


@runtime_checkable
class Strokes(Protocol):
    """Actions that begin somewhere on the table and end somewhere else."""

    def ends(self, actions: Float[Array, "B A"]) -> Float[Array, "B 2 2"]:
        """Start and end of each stroke [m]."""
        ...

    def bends(self, actions: Float[Array, "B A"]) -> Float[Array, "B M"]:
        """Bends between start and end, independent of both."""
        ...

    def stroke(self, ends: Float[Array, "B 2 2"], bends: Float[Array, "B M"]) -> Float[Array, "B A"]:
        """Actions of these ends and bends."""
        ...


@final
@dataclass(frozen=True, kw_only=True)
class Transporter(NextOnly):
    """`crop` pixels of a side around the beginning, turned by `turns` angles; `features` that are correlated.

    An odd `crop` has the beginning in its middle.
    """

    eyes: int = 32
    features: int = 8
    crop: int = 17
    turns: int = 4
    hidden: int = 128

    window: ClassVar[int] = 1

    def begin(self, key: PRNGKeyArray, seen: PolicyObservation, how: Lessons) -> Params:
        """Initial parameters, as flax draws them. Raises UsageError for actions that are no strokes."""
        somewhere = jnp.full((len(seen.tool), 2), self.crop)
        return self._network(how).init(key, seen.pictures[0], somewhere, somewhere)["params"]

    def loss(self, params: Params, key: PRNGKeyArray, shown: Shown, how: Lessons, scale: Scale) -> Float[Array, ""]:
        """Cross entropy of both pixels (section 3.3), and the mean squared error of the bends."""
        del key, scale
        space, view = _strokes(how), how.views[0]
        first, last = jnp.moveaxis(_pixels(view, space.ends(shown.actions)), 1, 0)
        begins, ends, bends = apply_network(self._network(how), params, shown.seen.pictures[0], first, last)
        lost = _surprise(begins, first) + _surprise(ends, last)
        off = (bends - space.bends(shown.actions)) * _pieces(bends)
        return lost + (off**2).sum() / max(off.size, 1)

    def act(self, params: Params, seen: PolicyObservation, how: Lessons, scale: Scale) -> ActionDistribution:
        """The likeliest pixels, refined among their neighbours."""
        space, view, network, picture = _strokes(how), how.views[0], self._network(how), seen.pictures[0]
        begin, begin_spread = _likeliest(apply_network(network, params, picture, method="beginning"))
        first = jnp.round(begin).astype(jnp.int32)
        end, end_spread = _likeliest(apply_network(network, params, picture, first, method="ending"))
        last = jnp.round(end).astype(jnp.int32)
        bends = apply_network(network, params, picture, first, last, method="bending")
        actions = space.stroke(_places(view, jnp.stack([begin, end], axis=1)), bends)
        # How wide the maps are is of the ends; the numbers between share it as they share what the ends do.
        wide = view.pixel_m * jnp.concatenate([begin_spread, end_spread], axis=1).max(1, keepdims=True)
        share = scale.std.reshape(-1) / scale.std.max()
        return ActionDistribution(actions, wide * share)

    def _network(self, how: Lessons) -> "_Transporter":
        between = _strokes(how).bends(jnp.zeros((1, how.space.chunk[0] * how.space.chunk[1]))).shape[1]
        return _Transporter(self.eyes, self.features, self.crop, self.turns, self.hidden, between)


@final
class _Transporter(nn.Module):
    eyes: int
    features: int
    crop: int
    turns: int
    hidden: int
    between: int

    def setup(self) -> None:
        self.begins = _Whole(self.eyes, 1)
        self.keys = _Whole(self.eyes, self.features)
        self.queries = _Whole(self.eyes, self.features)
        self.sharpness = self.param("sharpness", nn.initializers.constant(1.0), ())
        self.bent = Dense(self.hidden, 2, self.between)

    def __call__(
        self, picture: Float[Array, "B R C 4"], first: Int[Array, "B 2"], last: Int[Array, "B 2"]
    ) -> tuple[Float[Array, "B R C"], Float[Array, "B R C"], Float[Array, "B M"]]:
        """Logits of starts, logits of ends given the start, and the bends between them."""
        return self.beginning(picture), self.ending(picture, first), self.bending(picture, first, last)

    def beginning(self, picture: Float[Array, "B R C 4"]) -> Float[Array, "B R C"]:
        """Equation 2: how good a beginning each pixel is."""
        return self.begins(picture)[..., 0]

    def ending(self, picture: Float[Array, "B R C 4"], first: Int[Array, "B 2"]) -> Float[Array, "B R C"]:
        """Equation 3: correlation of the crop around the start with each pixel, at the best of all angles."""
        queries, keys = self.queries(picture), self.keys(picture)

        def correlated(query: Float[Array, "R C F"], key: Float[Array, "R C F"], at: Int[Array, "2"]) -> Array:
            return jax.nn.logsumexp(_correlation(key, self._crops(query, at)), axis=0)

        return self.sharpness * jax.vmap(correlated)(queries, keys, first) / (self.crop * self.features**0.5)

    def bending(
        self, picture: Float[Array, "B R C 4"], first: Int[Array, "B 2"], last: Int[Array, "B 2"]
    ) -> Float[Array, "B M"]:
        """Bends between both ends, predicted from the features around them; empty if strokes are straight."""
        if not self.between:
            return jnp.zeros((len(picture), 0))
        features = self.queries(picture)
        each = jnp.arange(len(picture))
        around = [features[each, pixel[:, 0], pixel[:, 1]] for pixel in (first, last)]
        way = (last - first) / jnp.array(picture.shape[1:3])
        told = self.bent(jnp.concatenate([*around, way], axis=-1))
        return told / _pieces(told)

    def _crops(self, query: Float[Array, "R C F"], at: Int[Array, "2"]) -> Float[Array, "G S S F"]:
        """Crops around a pixel, one for each angle."""
        side = jnp.arange(self.crop) - (self.crop - 1) / 2
        rows, columns = jnp.meshgrid(side, side, indexing="ij")
        angles = (2 * pi * jnp.arange(self.turns) / self.turns)[:, None, None]
        c, s = jnp.cos(angles), jnp.sin(angles)
        there = [at[0] + c * rows - s * columns, at[1] + s * rows + c * columns]
        return jax.vmap(partial(map_coordinates, coordinates=there, order=1), in_axes=-1, out_axes=-1)(query)


@final
class _Whole(nn.Module):
    """Features of every pixel: of its neighbours as they are, and of the blocks around it."""

    eyes: int
    features: int

    @nn.compact
    def __call__(self, picture: Float[Array, "B R C K"]) -> Float[Array, "B R C F"]:
        """Feature maps of the picture's size."""
        fine = self.eyes // 2
        near = nn.relu(nn.Conv(fine, (3, 3))(picture))
        far = nn.Conv(fine, (1, 1))(Eyes(self.eyes)(picture))
        far = jax.image.resize(far, (*picture.shape[:3], fine), "bilinear")
        both = nn.relu(nn.Conv(fine, (3, 3))(jnp.concatenate([near, far], axis=-1)))
        return nn.Conv(self.features, (1, 1), kernel_init=_FAINT)(both)


def _correlation(picture: Float[Array, "R C F"], crops: Float[Array, "G S S F"]) -> Float[Array, "G R C"]:
    """Cross-correlation of each crop with the picture at each pixel, zero-padded; by Fourier transforms."""
    rows, columns, _ = picture.shape
    side = crops.shape[1]
    shape = (rows + side, columns + side)
    whole = jnp.fft.rfft2(picture, shape, axes=(0, 1))
    parts = jnp.fft.rfft2(crops, shape, axes=(1, 2))
    found = jnp.fft.irfft2((whole * parts.conj()).sum(-1), shape, axes=(1, 2))
    return jnp.roll(found, (side // 2, side // 2), axis=(1, 2))[:, :rows, :columns]


def _pieces(bends: Float[Array, "B M"]) -> int:
    """Number of segments of a stroke, each about the same share of it; 1 if it is straight."""
    return max(bends.shape[1] // 2, 1)


def _strokes(how: Lessons) -> Strokes:
    """Raises UsageError for actions that are none."""
    if not isinstance(how.space, Strokes):
        raise UsageError(
            f"A Transporter chooses where a stroke begins and ends; {type(how.space).__name__} have no such ends: "
            "choose another --policy."
        )
    return how.space


def _pixels(view: OrthographicView, places: Float[Array, "B E 2"]) -> Int[Array, "B E 2"]:
    """The nearest ones in the picture."""
    points = jnp.concatenate([places, jnp.zeros((*places.shape[:2], 1))], axis=-1)
    return jnp.clip(jnp.round(view.pixels(points)).astype(jnp.int32), 0, jnp.array(view.shape) - 1)


def _places(view: OrthographicView, pixels: Float[Array, "B E 2"]) -> Float[Array, "B E 2"]:
    """The middles of pixels [m]."""
    return jnp.array(view.low[:2]) + (pixels + 0.5) * view.pixel_m


def _surprise(logits: Float[Array, "B R C"], pixel: Int[Array, "B 2"]) -> Float[Array, ""]:
    """The mean cross entropy of one pixel each."""
    flat = logits.reshape(len(logits), -1)
    return optax.softmax_cross_entropy_with_integer_labels(flat, pixel[:, 0] * logits.shape[2] + pixel[:, 1]).mean()


def _likeliest(logits: Float[Array, "B R C"]) -> tuple[Float[Array, "B 2"], Float[Array, "B 1"]]:
    """The likeliest pixel, refined, and the standard deviation about it [pixel]."""
    count, rows, columns = logits.shape
    share = jax.nn.softmax(logits.reshape(count, -1)).reshape(logits.shape)
    best = jnp.stack(jnp.unravel_index(jnp.argmax(logits.reshape(count, -1), axis=1), (rows, columns)), axis=-1)
    grid = jnp.stack(jnp.meshgrid(jnp.arange(rows), jnp.arange(columns), indexing="ij"), axis=-1)
    off = grid[None] - best[:, None, None]
    near = share * (jnp.abs(off).max(-1) <= _NEAR)
    refined = best + (near[..., None] * off).sum((1, 2)) / near.sum((1, 2))[:, None]
    return refined, jnp.sqrt((share * (off**2).sum(-1)).sum((1, 2)) / 2)[:, None]


LEARNER = Transporter()
