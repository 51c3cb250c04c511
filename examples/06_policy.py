"""Learn a policy from the pushes of a few recordings by behaviour cloning, and ask it for an action where one began.

Start it with `python examples/06_policy.py RECORDING...`; `dipac collect rope_push --eyes truth` makes ten of them.
"""

from pathlib import Path

import jax.numpy as jnp
import numpy as np
import tyro
from tyro.conf import Positional

from app.config import Site
from app.core.motion import Motion
from app.planner.tree import first_action
from app.policy.base import AWAY, Now
from app.policy.learned.kinds import load as load_kind
from app.policy.learned.train import TrainingSettings, learn
from app.recording.taught import read_taught
from app.tasks import load
from app.tasks.teaching import examples, lessons


def main(recordings: Positional[tuple[Path, ...]], kind: str = "bc", steps: int = 200) -> Motion:
    """Returns the motion that the policy proposes where the first demonstration began, for the goal it had."""
    shown = [read_taught(path) for path in recordings]
    task = load(shown[0].task)
    taught, how = examples(task, [(each.transitions, each.goals) for each in shown]), lessons(task)
    policy, training = learn(load_kind(kind), how, taught, TrainingSettings(steps=steps, batch=16))
    x, goal = shown[0].transitions[0].before, shown[0].goals[0]
    action = first_action(policy, policy.prepare(x, goal), now := Now.at_rest(jnp.asarray(x)[None]))
    motion = task.actions.motion(np.asarray(task.actions.project(action, now))[0], AWAY, Site())
    made = shown[0].transitions[0].executed.made
    print(f"{kind}: loss {training.curve[-1].loss:.2f} after {training.step} steps with {len(taught.x)} pushes")
    print(f"proposed {motion.positions[0]} to {motion.positions[-1]} m; shown {made[0, :3]} to {made[-1, :3]} m")
    return motion


if __name__ == "__main__":
    np.set_printoptions(precision=3, suppress=True)
    tyro.cli(main)
