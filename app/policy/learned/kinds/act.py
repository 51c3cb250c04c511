"""ACT, action chunking with transformers (Zhao et al. 2023, "Learning fine-grained bimanual manipulation").

A conditional variational autoencoder of a chunk of small moves: what in a demonstration does not follow from what was
seen, its style z, is encoded, and left out where the policy acts (section IV-B, algorithms 1 and 2). Where actions
begin where the tool is, a chunk spans several, and what earlier chunks meant for now has a say (temporal ensembling,
`LearnedPolicy.first`); where they begin anywhere, each is one chunk, and none overlaps another.
"""

from dataclasses import dataclass
from typing import final

import flax.linen as nn
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float, PRNGKeyArray

from app.policy.base import ActionDistribution
from app.policy.learned.attention import Tokens, TransformerBlock, waves
from app.policy.learned.base import Chunk, Lessons, Params, Scale, Shown
from app.policy.learned.networks import apply_network
from app.policy.learned.sight import PolicyObservation

_STYLES = 8
"""Styles sampled to estimate the spread of the actions."""


@final
@dataclass(frozen=True, kw_only=True)
class Act:
    """ACT. `style`: size of z; `beta`: weight of its Kullback-Leibler divergence (table III of the paper: 10).

    `window`: how many actions a chunk spans, where actions begin where the tool is.
    """

    eyes: int = 32
    width: int = 128
    depth: int = 2
    style: int = 16
    beta: float = 10.0
    window: int = 1

    def ahead(self, how: Lessons) -> int:
        """All of a chunk but the next."""
        return 0 if how.space.anywhere else self.window - 1

    def begin(self, key: PRNGKeyArray, seen: PolicyObservation, how: Lessons) -> Params:
        """Initial parameters, as flax draws them."""
        count, numbers = self._chunk(how)
        counts = jnp.ones((len(seen.tool), count))
        moves = jnp.zeros((len(seen.tool), count, numbers))
        return self._network(how).init(key, key, seen, moves, counts)["params"]

    def loss(self, params: Params, key: PRNGKeyArray, shown: Shown, how: Lessons, scale: Scale) -> Float[Array, ""]:
        """Algorithm 1: the mean absolute error of the moves, and beta times z's divergence from a unit Gaussian."""
        spanned, batch = 1 + self.ahead(how), len(shown.made)
        moves = scale.to(shown.made[:, :spanned].reshape(-1, shown.made.shape[-1]))
        moves = moves.reshape(batch, *self._chunk(how))
        counts = jnp.repeat(shown.counts[:, :spanned], how.space.chunk[0], axis=1)
        made, mean, log_variance = apply_network(self._network(how), params, key, shown.seen, moves, counts)
        divergence = -0.5 * (1 + log_variance - mean**2 - jnp.exp(log_variance)).sum(-1)
        off = jnp.abs(made - moves).mean(-1)
        return (counts * off).sum() / counts.sum() + self.beta * divergence.mean()

    def act(self, params: Params, seen: PolicyObservation, how: Lessons, scale: Scale) -> ActionDistribution:
        """Algorithm 2, line 3: z is the prior's mean, 0; samples of z give the spread of the demonstrations."""
        network = self._network(how)
        styles = jax.random.normal(jax.random.key(0), (_STYLES, self.style)).at[0].set(0.0)

        def styled(z: Float[Array, " Z"]) -> Float[Array, "B T K"]:
            each = jnp.broadcast_to(z, (len(seen.tool), self.style))
            made: Float[Array, "B T K"] = apply_network(network, params, seen, each, method="decode")
            return made

        first, meant = how.space.chunk[0], styled(styles[0])
        # Apart from each other, so that who asks for the mean alone does not pay for the spread.
        acted = scale.back(meant[:, :first], jax.vmap(styled)(styles)[:, :, :first].std(0))
        if not (ahead := self.ahead(how)):
            return acted
        later = meant[:, first:].reshape(-1, *how.space.chunk)
        return acted._replace(later=scale.back(later, later).mean.reshape(len(meant), ahead, -1))

    def _chunk(self, how: Lessons) -> Chunk:
        count, numbers = how.space.chunk
        return (1 + self.ahead(how)) * count, numbers

    def _network(self, how: Lessons) -> "_Act":
        return _Act(self.eyes, self.width, self.depth, self.style, self._chunk(how))


@final
class _Act(nn.Module):
    eyes: int
    width: int
    depth: int
    style: int
    chunk: Chunk

    def setup(self) -> None:
        count, numbers = self.chunk
        self.seen = Tokens(self.eyes, self.width)
        self.told = nn.Dense(self.width)
        self.held = nn.Dense(self.width)
        self.whole = self.param("whole", nn.initializers.normal(0.02), (1, self.width))
        self.encoder = [TransformerBlock() for _ in range(self.depth)]
        self.styled = nn.Dense(2 * self.style)
        self.understood = nn.Dense(self.width)
        self.looking = [TransformerBlock() for _ in range(self.depth)]
        self.queries = self.param("queries", nn.initializers.normal(0.02), (count, self.width))
        self.decoder = [TransformerBlock() for _ in range(self.depth)]
        self.out = nn.Dense(numbers)

    def __call__(
        self, key: PRNGKeyArray, seen: PolicyObservation, actions: Float[Array, "B T K"], counts: Float[Array, "B T"]
    ) -> tuple[Float[Array, "B T K"], Float[Array, "B Z"], Float[Array, "B Z"]]:
        """The moves as they are made with a style that is drawn for them, and the Gaussian that it is drawn from."""
        mean, log_variance = self.encode(seen, actions * counts[..., None])
        z = mean + jnp.exp(0.5 * log_variance) * jax.random.normal(key, mean.shape)
        return self.decode(seen, z), mean, log_variance

    def encode(
        self, seen: PolicyObservation, actions: Float[Array, "B T K"]
    ) -> tuple[Float[Array, "B Z"], Float[Array, "B Z"]]:
        """The style of the moves, by them and the tool alone (the paper leaves pictures out here, for speed)."""
        whole = jnp.broadcast_to(self.whole, (len(actions), 1, self.width))
        moves = self.told(actions) + waves(jnp.arange(1.0 * self.chunk[0]), self.width)
        tokens = jnp.concatenate([whole, self.held(seen.tool)[:, None], moves], axis=1)
        for block in self.encoder:
            tokens = block(tokens)
        mean, log_variance = jnp.split(self.styled(tokens[:, 0]), 2, axis=-1)
        return mean, log_variance

    def decode(self, seen: PolicyObservation, z: Float[Array, "B Z"]) -> Float[Array, "B T K"]:
        """The moves of that style where that is seen."""
        tokens = jnp.concatenate([self.understood(z)[:, None], self.seen(seen)], axis=1)
        for block in self.looking:
            tokens = block(tokens)
        moves = jnp.broadcast_to(self.queries, (len(z), *self.queries.shape))
        for block in self.decoder:
            moves = block(moves, tokens)
        return self.out(moves)


LEARNER = Act(window=4)
