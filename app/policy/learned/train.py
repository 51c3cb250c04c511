"""Learning from demonstrations: batches of what was done, moved by the task's symmetries, until nothing is gained."""

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial
from typing import Any, NamedTuple, TypeAlias, cast, final

import jax
import jax.numpy as jnp
import numpy as np
import optax
from jaxtyping import Array, Float, PRNGKeyArray

from app.policy.learned.base import LearnedPolicy, Learner, Lessons, Params, Scale
from app.policy.learned.examples import Batch, Examples, scale_of
from app.policy.symmetry import Isometry


@final
@dataclass(frozen=True, kw_only=True)
class TrainingSettings:
    """Duration and rates of training. It stops after `patience` checks, each `check_every` steps, without a gain.

    `hindsight`: the share of what was done that is shown as done for where it led.
    """

    steps: int = 4000
    batch: int = 64
    learning_rate: float = 5e-4
    weight_decay: float = 1e-4
    warm_up: int = 100
    check_every: int = 100
    patience: int = 10
    hindsight: float = 0.5
    seed: int = 0


@final
class Progress(NamedTuple):
    """Result of a check: mean loss of the steps since the last one, and of the demonstration that is held out."""

    step: int
    loss: float
    held_out: float
    best: bool


Listener: TypeAlias = Callable[[Progress], None]


@final
@dataclass(kw_only=True, eq=False)
class Training:
    """State of training: parameters, the best ones, and the optimiser's state.

    `curve`: every check that there was.
    """

    params: Params
    best: Params
    optimiser: Any
    step: int = 0
    best_loss: float = float("inf")
    idle: int = 0
    curve: list[Progress] = field(default_factory=list[Progress])

    @property
    def left_out(self) -> int:
        """Steps that changed nothing, as their slopes were no numbers."""
        return int(self.optimiser.total_notfinite)


def begin(learner: Learner, lessons: Lessons, examples: Examples, settings: TrainingSettings) -> Training:
    """State of training before the first step."""
    params, optimiser = _initial_state(
        learner, lessons, jax.random.key(settings.seed), Batch.of(examples, np.array([0]))
    )
    return Training(params=params, best=params, optimiser=optimiser)


# One program: flax would have hundreds of small ones compiled, one after the other. It runs once, so that what the
# compiler would need to make it fast is not worth it.
@partial(jax.jit, static_argnums=(0, 1), compiler_options={"xla_backend_optimization_level": 0})
def _initial_state(learner: Learner, lessons: Lessons, key: PRNGKeyArray, first: Batch) -> tuple[Params, Any]:
    """Parameters, and the optimiser's state, which begins alike whatever its settings."""
    params = learner.begin(key, first.to_frame(lessons).observe(lessons).seen, lessons)
    return params, _optimiser(TrainingSettings()).init(params)


def learn(
    learner: Learner,
    lessons: Lessons,
    examples: Examples,
    settings: TrainingSettings,
    training: Training | None = None,
    listen: Listener | None = None,
) -> tuple[LearnedPolicy, Training]:
    """Go on with `training`, or begin; to the end of `settings.steps`, or until the held out one gains nothing.

    The last demonstration is held out, where there are two at least. Both what a step is made of and what it draws
    follow from the seed and its number, so that a training that was broken off goes on as if it had not been.
    """
    told = training or begin(learner, lessons, examples, settings)
    held = examples.episode == examples.episode.max()
    taught = examples.of(~held) if not held.all() else examples
    scale = scale_of(lessons, taught, settings.seed)
    kept = Batch.of(examples.of(held), np.arange(held.sum()), learner.window)
    # Where goals do not lie just anywhere, what was done on the way to them teaches nothing of others.
    chances = taught.chances(settings.hindsight) if lessons.symmetry.everywhere else np.zeros(len(taught.x))
    step = partial(_step, learner, lessons, settings, scale)
    losses = list[Float[Array, ""]]()
    while told.step < settings.steps and told.idle < settings.patience:
        rng = np.random.default_rng([settings.seed, told.step])
        key = jax.random.fold_in(jax.random.key(settings.seed), told.step)
        chosen = Batch.draw(taught, rng.integers(len(taught.x), size=settings.batch), chances, learner.window, rng)
        by = lessons.symmetry.draw(rng, settings.batch)
        told.params, told.optimiser, loss = step(told.params, told.optimiser, key, chosen, by)
        losses.append(loss)
        told.step += 1
        if told.step % settings.check_every == 0 or told.step == settings.steps:
            _check(learner, lessons, scale, told, kept, float(jnp.mean(jnp.stack(losses))), listen)
            losses.clear()
    return LearnedPolicy.of(learner, lessons, told.best, scale), told


@partial(jax.jit, static_argnums=(0, 1, 2))
def _step(
    learner: Learner,
    lessons: Lessons,
    settings: TrainingSettings,
    scale: Scale,
    params: Params,
    optimiser: Any,
    key: PRNGKeyArray,
    chosen: Batch,
    by: Isometry,
) -> tuple[Params, Any, Float[Array, ""]]:
    """One step of gradient descent."""
    shown = chosen.to_frame(lessons).transform(lessons, by).observe(lessons)
    loss, slopes = jax.value_and_grad(learner.loss)(params, key, shown, lessons, scale)
    updates, optimiser = _optimiser(settings).update(slopes, optimiser, params)
    stepped = cast("Params", optax.apply_updates(params, updates))
    return stepped, optimiser, loss


@partial(jax.jit, static_argnums=(0, 1))
def _held_out(
    learner: Learner, lessons: Lessons, scale: Scale, params: Params, key: PRNGKeyArray, held: Batch
) -> Float[Array, ""]:
    return learner.loss(params, key, held.to_frame(lessons).observe(lessons), lessons, scale)


def _check(
    learner: Learner,
    lessons: Lessons,
    scale: Scale,
    told: Training,
    held: Batch,
    loss: float,
    listen: Listener | None,
) -> None:
    found = float(_held_out(learner, lessons, scale, told.params, jax.random.key(0), held))
    best = found < told.best_loss
    if best:
        told.best, told.best_loss = told.params, found
    told.idle = 0 if best else told.idle + 1
    told.curve.append(Progress(told.step, loss, found, best))
    if listen is not None:
        listen(told.curve[-1])


def _optimiser(settings: TrainingSettings) -> optax.GradientTransformation:
    """Steps whose gradients are no numbers, as a simulation may have them, are left out."""
    warm_up = min(settings.warm_up, settings.steps // 4)
    rate = optax.warmup_cosine_decay_schedule(0.0, settings.learning_rate, warm_up, settings.steps)
    descent = optax.chain(optax.clip_by_global_norm(1.0), optax.adamw(rate, weight_decay=settings.weight_decay))
    return optax.apply_if_finite(descent, max_consecutive_errors=settings.steps)
