"""Read a recording: the clouds of the object, and of each push what was commanded, what was made and what it moved.

Start it with `python examples/01_recording.py RECORDING`; `python examples/00_run.py` makes one.
"""

from pathlib import Path

import numpy as np
import tyro
from tyro.conf import Positional

from app.core.geometry.chamfer import chamfer_m2
from app.core.messages import Episode, Particles, Transition
from app.recording.read.reader import read_messages


def main(recording: Positional[Path]) -> list[Transition]:
    """Print a line for the episode, one for each push, and one for the clouds; returns the pushes."""
    clouds, pushes = list[Particles](), list[Transition]()
    for message in read_messages(recording, [Episode, Particles, Transition]):
        match message:
            case Episode():
                print(f"{message.task} in the {message.rig} cell, seed {message.seed}, code {message.code_version}")
            case Particles():
                clouds.append(message)
            case Transition():
                pushes.append(message)
                print(f"push {len(pushes)}: {_described(message)}")
            case _:
                pass
    span_s = clouds[-1].time_s - clouds[0].time_s
    print(f"{len(clouds)} clouds of {len(clouds[0].positions)} particles in {span_s:.1f} s")
    return pushes


def _described(push: Transition) -> str:
    """Duration, length and tracking error of the motion; the object's, as a distance between its two clouds."""
    made, told = push.executed.made[:, :3], push.executed.commanded[:, :3]
    length_m = np.linalg.norm(np.diff(made, axis=0), axis=1).sum()
    error_m = np.linalg.norm(made - told, axis=1).mean()
    moved_m = np.sqrt(chamfer_m2(push.before, push.after) / 2)
    return (
        f"{push.executed.outcome}, {np.ptp(push.executed.times_s):.1f} s and {length_m:.2f} m of the tool, "
        f"{1e3 * error_m:.1f} mm from the command on average; the object moved by {1e3 * moved_m:.1f} mm"
    )


if __name__ == "__main__":
    tyro.cli(main)
