"""Run a task in the simulated cell as `dipac run` does, and say how far its pushes ended from what was promised.

Start it with `python examples/00_run.py`, or `python examples/00_run.py --seed 8 --pushes 1`.
"""

from pathlib import Path

import tyro

from app.commands.run import EpisodeReport, Options, run
from app.core.dialogue.words import millimetres


def main(
    task: str = "rope_push", seed: int = 0, pushes: int = 2, recordings: Path = Path("recordings")
) -> EpisodeReport:
    """Perceive, plan, approve, push and learn, with rendered cameras and an arm in a process of its own."""
    report = run(task, options=Options(seed=seed, pushes=pushes, recordings=recordings, port=0))
    done = report.summary
    pairs = zip(done.predicted_chamfer_m2, done.chamfer_m2[1:], strict=True)
    worst_mm = max((abs(millimetres(promised) - millimetres(seen)) for promised, seen in pairs), default=0.0)
    print(f"after {done.pushes} pushes: distances to the goal differ from those promised by {worst_mm:.1f} mm at most")
    print(f"{report.recorded} messages are recorded; look at them with examples/01_recording.py {report.recording}")
    return report


if __name__ == "__main__":
    tyro.cli(main)
