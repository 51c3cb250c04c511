"""Orientation of an object, as its first end, in episodes between which its motion was not observed.

A rope that is laid anew may lie the other way round. Effects along it then have the other sign, and over all episodes
none. The orientation of each episode is the one in which the effect of one such parameter adds up: the choice costs the
gain expected by chance, a factor of two for each episode but the first.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from jaxtyping import Float64

from app.discovery.inference.mixed_effects import QuadraticForms, fit_mixed_effects
from app.discovery.inference.weighing import Prior, project_out
from app.discovery.residuals.rows import Residuals

Ends = Mapping[int, float]
"""Orientation by episode: 1 as the labels are, -1 reversed."""


def find_ends(data: Residuals, prior: Prior, odd: Sequence[int]) -> Ends:
    """Orientation of each episode. `odd`: columns of parameters that change their sign with the direction."""
    if not odd:
        return dict.fromkeys(np.unique(data.episode).tolist(), 1.0)
    fit = fit_mixed_effects(data, prior.variance, prior.mean)
    scores = [_scores(fit.forms, fit.theta, prior, column) for column in odd]
    best = max(scores, key=lambda each: float(np.abs(each).sum()))
    signs = np.where(best * best[np.abs(best).argmax()] < 0, -1.0, 1.0)
    return dict(zip(fit.forms.episode.tolist(), signs.tolist(), strict=True))


def _scores(
    forms: QuadraticForms, theta: Float64[np.ndarray, " P"], prior: Prior, column: int
) -> Float64[np.ndarray, " E"]:
    """Scores of each episode for one column, all else projected out, in standard deviations of their sum."""
    left = forms.b - forms.A @ theta
    rest, projection, information = project_out(forms.A.sum(0), prior, [column])
    # Its own usual value was fitted with the rest; what an episode says includes it.
    whole = left[:, column] + forms.A[:, column, column] * theta[column]
    return (whole - left[:, rest] @ projection[:, 0]) / np.sqrt(max(float(information[0, 0]), 1e-12))


def turn_rows(data: Residuals, ends: Ends, odd: Sequence[int]) -> Residuals:
    """The residuals as they are of objects whose first ends are these.

    `odd`: columns of parameters that change their sign with the direction.
    """
    signs = np.array([ends[int(episode)] for episode in data.episode])
    rows = np.ones(data.r.shape)
    for block in data.blocks:
        if block.reversed is not None:
            rows[signs < 0, block.rows] = block.reversed
    J = data.J * rows[:, :, None]
    J[:, :, list(odd)] *= signs[:, None, None]
    return replace(data, r=data.r * rows, J=J, spread=data.spread * rows[:, :, None])
