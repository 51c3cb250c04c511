"""Plot of a training: losses of the steps, and of the demonstration that is held out."""

from collections.abc import Sequence
from pathlib import Path

from app.evaluation.figure import save
from app.policy.learned.train import Progress


def draw_learning(curve: Sequence[Progress], title: str, path: Path) -> None:
    """Write an SVG, the best step marked."""
    from matplotlib.figure import Figure  # Takes a second to load, which nobody pays who draws nothing.

    steps = [each.step for each in curve]
    figure = Figure(figsize=(7.0, 3.5), layout="constrained")
    panel = figure.subplots()
    panel.plot(steps, [each.loss for each in curve], color="black", label="as taught")
    panel.plot(steps, [each.held_out for each in curve], ".-", color="tab:blue", label="held out")
    best = min(curve, key=lambda each: each.held_out)
    panel.axvline(best.step, color="tab:blue", alpha=0.4, label=f"kept: step {best.step}")
    panel.set(title=title, xlabel="step", ylabel="loss")
    panel.legend(fontsize="small")
    save(figure, path, salt=title)
