"""Parts of transformers (Vaswani et al. 2017, "Attention is all you need"), normalised before each part."""

from typing import final

import flax.linen as nn
import jax.numpy as jnp
from jaxtyping import Array, Float

from app.policy.learned.networks import Eyes
from app.policy.learned.sight import PolicyObservation

_HEADS, _WIDER = 4, 2


@final
class Tokens(nn.Module):
    """Tokens of an observation: patches of the pictures with their positions, and the tool."""

    eyes: int
    width: int

    @nn.compact
    def __call__(self, seen: PolicyObservation) -> Float[Array, "B P W"]:
        """Tokens of each of B."""
        tokens = [nn.Dense(self.width)(seen.tool)[:, None]]
        for picture in seen.pictures:
            blocks = nn.Dense(self.width)(Eyes(self.eyes)(picture))
            rows, columns = blocks.shape[1:3]
            place = (
                waves(jnp.arange(1.0 * rows), self.width)[:, None]
                + waves(jnp.arange(1.0 * columns), self.width)[None, :, ::-1]
            )
            tokens.append((blocks + place).reshape(len(blocks), rows * columns, self.width))
        return jnp.concatenate(tokens, axis=1)


@final
class TransformerBlock(nn.Module):
    """Tokens look at each other, at others where there are some, and each is thought about."""

    @nn.compact
    def __call__(self, x: Float[Array, "B T W"], others: Float[Array, "B P W"] | None = None) -> Float[Array, "B T W"]:
        """The tokens after attention."""
        width = x.shape[-1]
        y = nn.LayerNorm()(x)
        x = x + nn.MultiHeadDotProductAttention(_HEADS)(y, y)
        if others is not None:
            x = x + nn.MultiHeadDotProductAttention(_HEADS)(nn.LayerNorm()(x), nn.LayerNorm()(others))
        y = nn.gelu(nn.Dense(_WIDER * width)(nn.LayerNorm()(x)))
        return x + nn.Dense(width)(y)


def waves(numbers: Float[Array, " C"], width: int) -> Float[Array, "C W"]:
    """Numbers as sines and cosines of wavelengths from 2 pi to 10,000 times that (section 3.5)."""
    rate = jnp.exp(-jnp.log(1e4) * jnp.arange(width // 2) / (width // 2))
    angle = numbers[:, None] * rate
    return jnp.concatenate([jnp.sin(angle), jnp.cos(angle)], axis=-1)
