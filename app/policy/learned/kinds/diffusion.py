"""Diffusion policy (Chi et al. 2023, "Diffusion policy: visuomotor policy learning via action diffusion").

A chunk of small moves is found by taking noise away from noise, step by step, heeding what is seen (section II-B). The
network tells the moves themselves instead of the noise in them, which equation 5 weighs otherwise and which is the same
at its best (Salimans and Ho 2022, "Progressive distillation", section 4): of one demonstration it was off by 9 to 67 mm
after 500 steps where noise that is told was off by 41 to 180 mm.
"""

from dataclasses import dataclass
from typing import ClassVar, final

import flax.linen as nn
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Float32, Int, PRNGKeyArray

from app.policy.base import ActionDistribution
from app.policy.learned.attention import Tokens, TransformerBlock, waves
from app.policy.learned.base import Chunk, Lessons, NextOnly, Params, Scale, Shown
from app.policy.learned.networks import apply_network
from app.policy.learned.sight import PolicyObservation

_OFFSET = 0.008
"""`s` of the squared cosine schedule (Nichol and Dhariwal 2021, "Improved denoising diffusion", equation 17)."""
_LARGEST_NOISE = 0.999
_FARTHEST = 4.0
"""Bound on denoised moves, in standard deviations of the demonstrations, as the paper clips."""
_DRAWN = 4
"""Chunks denoised from as many noises, for the spread; the first is executed."""


@final
@dataclass(frozen=True, kw_only=True)
class Diffusion(NextOnly):
    """`noisy` levels of noise in training, of which acting passes `steps` (DDIM: Song et al. 2021)."""

    eyes: int = 32
    width: int = 128
    depth: int = 3
    noisy: int = 100
    steps: int = 10

    window: ClassVar[int] = 1

    def begin(self, key: PRNGKeyArray, seen: PolicyObservation, how: Lessons) -> Params:
        """Initial parameters, as flax draws them."""
        count, chunk = len(seen.tool), how.space.chunk
        return self._network(chunk).init(key, seen, jnp.zeros((count, *chunk)), jnp.zeros(count, jnp.int32))["params"]

    def loss(self, params: Params, key: PRNGKeyArray, shown: Shown, how: Lessons, scale: Scale) -> Float[Array, ""]:
        """Equation 5, of moves: mean squared error of their prediction from noised ones, at a random level each."""
        moves, (drawn, noised) = scale.to(shown.actions), jax.random.split(key)
        level = jax.random.randint(drawn, (len(moves),), 0, self.noisy)
        noise = jax.random.normal(noised, moves.shape)
        kept = jnp.asarray(self._cosine_schedule())[level][:, None, None]
        noised_moves = jnp.sqrt(kept) * moves + jnp.sqrt(1 - kept) * noise
        told = apply_network(self._network(how.space.chunk), params, shown.seen, noised_moves, level)
        return ((told - moves) ** 2).mean()

    def act(self, params: Params, seen: PolicyObservation, how: Lessons, scale: Scale) -> ActionDistribution:
        """Actions denoised from a fixed noise, so that they depend on the observation alone."""
        chunk, count = how.space.chunk, len(seen.tool)
        network = self._network(chunk)
        tokens = apply_network(network, params, seen, method="look")
        noises = jax.random.normal(jax.random.key(0), (_DRAWN, 1, *chunk))

        def found(noise: Float[Array, "1 T K"]) -> Float[Array, "B T K"]:
            return self._denoise(network, params, tokens, jnp.broadcast_to(noise, (count, *chunk)))

        # Apart from each other, so that who asks for the mean alone does not pay for the spread.
        return scale.back(found(noises[0]), jax.vmap(found)(noises).std(0))

    def _denoise(
        self, network: "_Denoiser", params: Params, tokens: Float[Array, "B P W"], noise: Float[Array, "B T K"]
    ) -> Float[Array, "B T K"]:
        """DDIM, equation 12 with no noise put in again: from level to level, by way of the moves that are believed."""
        levels = np.linspace(self.noisy - 1, 0, self.steps).round().astype(np.int32)
        kept = self._cosine_schedule()
        before, after = kept[levels], np.append(kept[levels[1:]], 1.0)

        def step(x: Float[Array, "B T K"], at: tuple[Array, Array, Array]) -> tuple[Float[Array, "B T K"], None]:
            level, here, there = at
            moves = apply_network(network, params, tokens, x, jnp.full(len(x), level), method="denoise")
            moves = jnp.clip(moves, -_FARTHEST, _FARTHEST)
            told = (x - jnp.sqrt(here) * moves) / jnp.sqrt(1 - here)
            return jnp.sqrt(there) * moves + jnp.sqrt(1 - there) * told, None

        at = (jnp.asarray(levels), jnp.asarray(before), jnp.asarray(after, jnp.float32))
        return jax.lax.scan(step, noise, at)[0]

    def _cosine_schedule(self) -> Float32[np.ndarray, " L"]:
        """The share of the signal's variance at each level: the squared cosine schedule."""
        time = np.arange(self.noisy + 1) / self.noisy
        share = np.cos((time + _OFFSET) / (1 + _OFFSET) * np.pi / 2) ** 2
        lost = np.minimum(1 - share[1:] / share[:-1], _LARGEST_NOISE)
        return np.cumprod(1 - lost).astype(np.float32)

    def _network(self, chunk: Chunk) -> "_Denoiser":
        return _Denoiser(self.eyes, self.width, self.depth, chunk)


@final
class _Denoiser(nn.Module):
    """The paper's transformer: moves attend to each other and to the observation (section III-A)."""

    eyes: int
    width: int
    depth: int
    chunk: Chunk

    def setup(self) -> None:
        self.seen = Tokens(self.eyes, self.width)
        self.told = nn.Dense(self.width)
        self.level = nn.Dense(self.width)
        self.blocks = [TransformerBlock() for _ in range(self.depth)]
        self.out = nn.Dense(self.chunk[1])

    def __call__(
        self, seen: PolicyObservation, moves: Float[Array, "B T K"], level: Int[Array, " B"]
    ) -> Float[Array, "B T K"]:
        """The moves without their noise."""
        return self.denoise(self.look(seen), moves, level)

    def look(self, seen: PolicyObservation) -> Float[Array, "B P W"]:
        """Tokens of the observation, attended to at every denoising step."""
        return self.seen(seen)

    def denoise(
        self, tokens: Float[Array, "B P W"], moves: Float[Array, "B T K"], level: Int[Array, " B"]
    ) -> Float[Array, "B T K"]:
        """The moves without their noise, of which there is so much."""
        known = nn.gelu(self.level(waves(level.astype(jnp.float32), self.width)))[:, None]
        x = self.told(moves) + waves(jnp.arange(1.0 * self.chunk[0]), self.width) + known
        others = jnp.concatenate([tokens, known], axis=1)
        for block in self.blocks:
            x = block(x, others)
        return self.out(x)


LEARNER = Diffusion()
