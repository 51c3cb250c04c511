"""Training examples from demonstrations, and batches of them, augmented by the task's symmetries."""

from functools import partial
from typing import NamedTuple, Self, final

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Float32, Float64, Int

from app.core.geometry.chamfer import chamfer_m2
from app.policy.base import PlanningState
from app.policy.learned.base import Lessons, Scale, Shown
from app.policy.symmetry import Isometry

_DRAWS = 32
"""Random symmetries per example from which the actions' mean and standard deviation are computed."""
_LEAST, _ASSUMED = 1e-4, 1e-2
"""Standard deviation [m, rad] below which a number of an action is taken for constant, and its value then."""


@final
class Examples(NamedTuple):
    """E situations, what was done in them, and where the object was `after` it [m].

    `episode`: of which demonstration each is, counted from 0; those of one are in their order.
    """

    x: Float32[np.ndarray, "E N 3"]
    goal: Float32[np.ndarray, "E M 3"]
    tool: Float32[np.ndarray, "E 8"]
    actions: Float32[np.ndarray, "E A"]
    after: Float32[np.ndarray, "E N 3"]
    episode: Int[np.ndarray, " E"]

    def of(self, chosen: Bool[np.ndarray, " E"] | Int[np.ndarray, " C"]) -> Self:
        """The chosen examples."""
        return type(self)(*(each[chosen] for each in self))

    def following(self, window: int) -> Int[np.ndarray, "E W"]:
        """Index of each example and of those that follow; the demonstration's last one is repeated past its end."""
        return np.minimum(np.arange(len(self.x))[:, None] + np.arange(window), self._last[:, None])

    def chances(self, hindsight: float) -> Float64[np.ndarray, " E"]:
        """Probability of relabelling each example with another goal: `hindsight`; 1 if it came no nearer to its own."""
        pairs = zip(self.x, self.after, self.goal, strict=True)
        gained = [chamfer_m2(after, goal) < chamfer_m2(before, goal) for before, after, goal in pairs]
        return np.where(gained, hindsight, 1.0)

    def goals(
        self, chosen: Int[np.ndarray, " B"], chances: Float64[np.ndarray, " E"], rng: np.random.Generator
    ) -> tuple[Float32[np.ndarray, "B M 3"], Int[np.ndarray, " B"]]:
        """Goals of the chosen examples: their own or, by chance, the object after a later action.

        An action leads there as surely as to its own goal (Andrychowicz et al. 2017, "Hindsight experience replay",
        section 4.1 with its strategy "future"). Also the index of the last example that served that goal.
        """
        later = rng.integers(chosen, self._last[chosen], endpoint=True)
        instead = rng.random(len(chosen)) < chances[chosen]
        goals = np.where(instead[:, None, None], self.after[later], self.goal[chosen])
        return goals, np.where(instead, later, self._last[chosen])

    @property
    def _last(self) -> Int[np.ndarray, " E"]:
        """Index of the last example of each one's demonstration."""
        return np.searchsorted(self.episode, self.episode, side="right") - 1


@final
class Batch(NamedTuple):
    """B examples, with the outcomes of each and of those after it, as in `Shown`; a JAX pytree."""

    x: Float[Array, "B N 3"]
    goal: Float[Array, "B M 3"]
    tool: Float[Array, "B 8"]
    made: Float[Array, "B W A"]
    after: Float[Array, "B W N 3"]
    counts: Float[Array, "B W"]

    @property
    def actions(self) -> Float[Array, "B A"]:
        """The actions taken there."""
        return self.made[:, 0]

    @classmethod
    def of(cls, examples: Examples, chosen: Int[np.ndarray, " B"], window: int = 1) -> Self:
        """The chosen ones."""
        index = examples.following(window)[chosen]
        counts = np.concatenate([np.ones((len(index), 1)), index[:, 1:] > index[:, :-1]], axis=1)
        x, goal, tool = (jnp.asarray(each[chosen]) for each in examples[:3])
        made, after = (jnp.asarray(each[index]) for each in (examples.actions, examples.after))
        return cls(x, goal, tool, made, after, jnp.asarray(counts, jnp.float32))

    @classmethod
    def draw(
        cls,
        examples: Examples,
        chosen: Int[np.ndarray, " B"],
        chances: Float64[np.ndarray, " E"],
        window: int,
        rng: np.random.Generator,
    ) -> Self:
        """The chosen examples, some relabelled in hindsight; actions after their goal was reached do not count."""
        goals, last = examples.goals(chosen, chances, rng)
        own = cls.of(examples, chosen, window)
        towards = chosen[:, None] + np.arange(window) <= last[:, None]
        return own._replace(goal=jnp.asarray(goals), counts=own.counts * towards)

    def to_frame(self, lessons: Lessons) -> Self:
        """Each as it is in its frame."""
        return self._apply_isometry(lessons, lessons.symmetry.frame(self.goal, self.x))

    def transform(self, lessons: Lessons, by: Isometry) -> Self:
        """Each as it would be on the moved table.

        Where frames are none, one that the arm could not do there stays as it is: what it does elsewhere tells nothing.
        """
        new = self._apply_isometry(lessons, by)
        if lessons.symmetry.turns:
            return new
        may = lessons.space.is_allowed(new.actions, PlanningState.at_rest(new.x)._replace(tool=new.tool))
        pairs = zip(new, self, strict=True)
        return type(self)(*(jnp.where(may.reshape(-1, *[1] * (there.ndim - 1)), there, here) for there, here in pairs))

    def observe(self, lessons: Lessons) -> Shown:
        """The batch as observed by a learner."""
        now = PlanningState.at_rest(self.x)._replace(tool=self.tool)
        return Shown(lessons.observation(self.goal, now), self.goal, now, self.made, self.after, self.counts)

    def _apply_isometry(self, lessons: Lessons, by: Isometry) -> Self:
        window, places = self.made.shape[1], by.places
        made = jnp.stack([lessons.space.transform(self.made[:, at], by) for at in range(window)], axis=1)
        return type(self)(places(self.x), places(self.goal), by.poses(self.tool), made, places(self.after), self.counts)


def scale_of(lessons: Lessons, examples: Examples, seed: int) -> Scale:
    """Mean and standard deviation of the training actions under random symmetries."""
    rng, count = np.random.default_rng([seed, len(examples.x)]), len(examples.x)
    many = Batch.of(examples, np.repeat(np.arange(count), _DRAWS))
    by = lessons.symmetry.draw(rng, _DRAWS * count)
    actions = np.asarray(_moved_actions(lessons, many, by))
    mean, std = (each(actions, axis=0).reshape(lessons.space.chunk).astype(np.float32) for each in (np.mean, np.std))
    return Scale(mean, np.where(std < _LEAST, np.float32(_ASSUMED), std))


@partial(jax.jit, static_argnums=0)
def _moved_actions(lessons: Lessons, batch: Batch, by: Isometry) -> Float[Array, "B A"]:
    """Actions of a batch in its frames, moved on the table."""
    return batch.to_frame(lessons).transform(lessons, by).actions
