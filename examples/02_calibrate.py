"""Fit stiffness, frictions and the tool's offset to the pushes of recordings, and save them for `dipac run --model`.

Start it with `python examples/02_calibrate.py RECORDING... --output model.toml`.
"""

from pathlib import Path

import tyro
from tyro.conf import Positional

from app.core.messages import Model
from app.jobs.worker_api import calibrate, nominal_model
from app.recording.exchange.model_file import save_model
from app.recording.read.reader import read_episode, read_transitions
from app.tasks import load, name_with_dynamics


def main(recordings: Positional[tuple[Path, ...]], output: Path = Path("model.toml"), preset: str = "cpu") -> Model:
    """All recordings are of one task; `preset` is that of their clouds' size."""
    task = load(name_with_dynamics(read_episode(recordings[0]).task))
    transitions = [transition for path in recordings for transition in read_transitions(path)]
    model = calibrate(task.name, preset, transitions, nominal_model(task.name))
    for fitted in (*model.parameters, *model.apparatus):
        if fitted.low < fitted.high:
            print(f"{fitted.name}: {fitted.value:.3g} {fitted.unit} (90 % {fitted.low:.3g} to {fitted.high:.3g})")
    save_model(output, model)
    print(f"{1e6 * model.loss_m2:.1f} mm^2 a push in {len(transitions)} pushes; written to {output}")
    return model


if __name__ == "__main__":
    tyro.cli(main)
