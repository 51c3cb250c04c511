"""A calibration as a picture: the loss and each parameter over the trials, with the intervals that came out."""

from pathlib import Path

import numpy as np

from app.evaluation.figure import save
from app.evaluation.scores import MM2
from app.jobs.jit_cache import Calibrated


def draw_trials(found: Calibrated, path: Path) -> None:
    """Write an SVG: the loss above, a panel a parameter below, with its final value and 90 % interval."""
    from matplotlib.figure import Figure  # Takes a second to load, which nobody pays who draws nothing.

    values = np.array([trial.values for trial in found.trials])
    losses = MM2 * np.array([trial.loss_m2 for trial in found.trials])
    fitted = {parameter.name: parameter for parameter in (*found.model.parameters, *found.model.apparatus)}
    figure = Figure(figsize=(7.0, 2.2 * (1 + len(found.names))), layout="constrained")
    panels = np.atleast_1d(figure.subplots(1 + len(found.names), sharex=True))
    panels[0].plot(losses, ".-", color="black")
    panels[0].plot(np.fmin.accumulate(losses), color="tab:blue", label="best so far")
    panels[0].set(ylabel="one-step Chamfer\ndistance [mm$^2$]", title=f"{found.model.task}: calibration")
    panels[0].legend(fontsize="small")
    for panel, name, tried in zip(panels[1:], found.names, values.T, strict=True):
        parameter = fitted[name]
        panel.plot(tried, ".-", color="black")
        panel.axhline(parameter.value, color="tab:blue")
        panel.axhspan(parameter.low, parameter.high, color="tab:blue", alpha=0.15, linewidth=0, label="90 % interval")
        panel.set(
            ylabel=f"{name} [{parameter.unit}]", yscale="log" if tried.min() > 0 and parameter.low > 0 else "linear"
        )
        panel.legend(fontsize="small")
    panels[-1].set_xlabel("trial")
    save(figure, path, salt=found.model.task)
