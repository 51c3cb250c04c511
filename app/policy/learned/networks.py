"""Parts of the networks that see: convolutions over pictures, and where in them their features are."""

from typing import Any, final

import flax.linen as nn
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from app.policy.learned.base import Params
from app.policy.learned.sight import PolicyObservation

_GROUPS = 8


def apply_network(network: nn.Module, params: Params, *inputs: Any, method: str | None = None) -> Any:
    """Output of a network, or of one of its methods, for these parameters and inputs."""
    return network.apply({"params": params}, *inputs, method=method)


@final
class Eyes(nn.Module):
    """Three convolutions with a stride of two and one without, of a picture and the coordinates of its pixels."""

    width: int

    @nn.compact
    def __call__(self, picture: Float[Array, "B R C K"]) -> Float[Array, "B r c F"]:
        """Features of blocks of 8 by 8 pixels."""
        x = jnp.concatenate([picture, _coordinates(picture)], axis=-1)
        for layer, stride in enumerate((2, 2, 2, 1)):
            x = nn.Conv(self.width * min(layer + 1, 2), (3, 3), strides=(stride, stride))(x)
            x = nn.relu(nn.GroupNorm(_GROUPS)(x))
        return x


@final
class Gist(nn.Module):
    """Feature vector of an observation: spatial softmax and strength of each feature of each picture, and the tool.

    Where: the expected pixel under a softmax of the feature over the picture (Levine et al. 2016, "End-to-end training
    of deep visuomotor policies", section 5.1).
    """

    width: int

    @nn.compact
    def __call__(self, seen: PolicyObservation) -> Float[Array, "B F"]:
        """For each of B."""
        parts = [seen.tool]
        for index, picture in enumerate(seen.pictures):
            features = Eyes(self.width)(picture)
            sharpness = self.param(f"sharpness_{index}", nn.initializers.constant(4.0), ())
            at = _coordinates(features).reshape(len(features), -1, 2)
            flat = features.reshape(*at.shape[:2], -1)
            weights = jax.nn.softmax(flat * sharpness, axis=1)
            where = jnp.einsum("bpf,bpk->bfk", weights, at)
            parts += [where.reshape(len(features), -1), (weights * flat).sum(1)]
        return jnp.concatenate(parts, axis=-1)


@final
class Dense(nn.Module):
    """Layers of this width, and one of `size` numbers."""

    width: int
    depth: int
    size: int

    @nn.compact
    def __call__(self, x: Float[Array, "B F"]) -> Float[Array, "B S"]:
        """For each of B."""
        for _ in range(self.depth):
            x = nn.relu(nn.LayerNorm()(nn.Dense(self.width)(x)))
        return nn.Dense(self.size)(x)


@final
class EncoderMLP(nn.Module):
    """A multilayer perceptron of `size` outputs on the feature vector of an observation."""

    width: int
    hidden: int
    depth: int
    size: int

    @nn.compact
    def __call__(self, seen: PolicyObservation) -> Float[Array, "B S"]:
        """For each of B."""
        return Dense(self.hidden, self.depth, self.size)(Gist(self.width)(seen))


def _coordinates(picture: Float[Array, "B R C K"]) -> Float[Array, "B R C 2"]:
    """Row and column of every pixel, from -1 to 1."""
    rows, columns = picture.shape[1:3]
    grid = jnp.stack(jnp.meshgrid(jnp.linspace(-1, 1, rows), jnp.linspace(-1, 1, columns), indexing="ij"), axis=-1)
    return jnp.broadcast_to(grid, (len(picture), rows, columns, 2))
