"""Learn a policy from the pushes of a few recordings by behaviour cloning, and let it propose one where one was shown.

Start it with `python examples/06_policy.py RECORDING...`; `dipac collect rope_push --eyes truth` makes ten of them.
"""

from pathlib import Path

import jax.numpy as jnp
import numpy as np
import tyro
from jaxtyping import Float32
from tyro.conf import Positional

from app.jobs.teaching import examples, lessons
from app.planner.search.tree import first_action
from app.policy.base import PlanningState
from app.policy.learned.kinds import load as load_kind
from app.policy.learned.train import TrainingSettings, learn
from app.recording.library.demonstrations import read_taught
from app.tasks import load


def main(recordings: Positional[tuple[Path, ...]], kind: str = "bc", steps: int = 100) -> Float32[np.ndarray, "2 2 2"]:
    """Begin and end [m] of the push that is proposed where the first one was shown, and of the one that was shown."""
    shown = [read_taught(path) for path in recordings]
    task = load(shown[0].task)
    taught = examples(task, [(each.transitions, each.goals) for each in shown])
    policy, training = learn(load_kind(kind), lessons(task), taught, TrainingSettings(steps=steps, batch=16))
    now = PlanningState.at_rest(jnp.asarray(taught.x[:1]))
    proposed = first_action(policy, policy.prepare(taught.x[0], taught.goal[0]), now)
    actions = jnp.concatenate([task.actions.project(proposed, now), taught.actions[:1]])
    path = np.asarray(task.actions.tool_path(actions, jnp.repeat(now.tool, 2, axis=0)))
    pushes = path[:, [0, -1], :2]
    begin_mm, end_mm = 1e3 * np.linalg.norm(pushes[0] - pushes[1], axis=-1)
    print(f"{kind} has learnt {len(taught.x)} pushes of {len(shown)} recordings in {training.step} steps")
    print(f"where the first was shown it begins {begin_mm:.0f} mm, and ends {end_mm:.0f} mm, from that one")
    return pushes


if __name__ == "__main__":
    tyro.cli(main)
