"""Which end of an object is its first, in episodes between which nobody saw it move.

A rope that is laid anew may lie the other way round. What acts along it then has the other sign, and over all episodes
none. The way round of each episode is the one in which what one such parameter does adds up: to choose it costs what
chance gains by that, a factor of two for each episode but the first.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from jaxtyping import Float64

from app.discovery.evidence import Forms, Residuals, fitted
from app.discovery.inference import Prior, projected

Ends = Mapping[int, float]
"""By episode: 1 as the labels are, -1 the other way round."""


def found_ends(data: Residuals, prior: Prior, odd: Sequence[int]) -> Ends:
    """The way round of each episode. `odd`: columns of parameters that change their sign with the direction."""
    if not odd:
        return dict.fromkeys(np.unique(data.episode).tolist(), 1.0)
    fit = fitted(data, prior.variance, prior.mean)
    scores = [_scores(fit.forms, fit.theta, prior, column) for column in odd]
    best = max(scores, key=lambda each: float(np.abs(each).sum()))
    signs = np.where(best * best[np.abs(best).argmax()] < 0, -1.0, 1.0)
    return dict(zip(fit.forms.episode.tolist(), signs.tolist(), strict=True))


def _scores(forms: Forms, theta: Float64[np.ndarray, " P"], prior: Prior, column: int) -> Float64[np.ndarray, " E"]:
    """Of each episode for one column, everything else projected out, in standard deviations of their sum."""
    left = forms.b - forms.A @ theta
    rest, projection, information = projected(forms.A.sum(0), prior, [column])
    # Its own usual value was fitted with the rest; what an episode says includes it.
    whole = left[:, column] + forms.A[:, column, column] * theta[column]
    return (whole - left[:, rest] @ projection[:, 0]) / np.sqrt(max(float(information[0, 0]), 1e-12))


def turned(data: Residuals, ends: Ends, odd: Sequence[int]) -> Residuals:
    """The same with the slopes of odd parameters as they are with these ends."""
    signs = np.array([ends[int(episode)] for episode in data.episode])
    J = data.J.copy()
    J[:, :, list(odd)] *= signs[:, None, None]
    return replace(data, J=J)
