"""Measured confidence: the rate at which evidence like this named the right cause in randomly drawn worlds.

Recordings of another engine, with objects, tools and frictions drawn anew and none, one or two effects hidden, went
through the same screening (`python -m bench.hidden.calibration`). A softmax over the causes and nothing (multinomial
logistic regression; Bishop 2006, "Pattern Recognition and Machine Learning", 4.3.4) was fitted to what was hidden in
them. It sees each cause's evidence, whether pushes and episodes agree about it, how much these very pushes could say of
it, and what its rivals have: what would have shown, and does not, counts against it.
"""

import json
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from importlib.resources import files
from importlib.resources.abc import Traversable
from typing import Final, final

import numpy as np
from jaxtyping import Float64

from app.discovery import sensor_actuator_errors
from app.discovery.inference.mixed_effects import scores
from app.discovery.inference.screen import CandidateCause, Screening
from app.discovery.inference.weighing import project_out
from app.sim.files import files_of

TABLE: Final = "calibration.json"
_LARGEST: Final = 15.0
"""Evidence [nats] at which the feature saturates."""
_DIRECT: Final = frozenset(name for name, _ in files_of(sensor_actuator_errors))
"""Causes of cameras and arm."""
_TYPICAL_PRECISION: Final = 1.0
"""Prior precision of a cause's size, in typical sizes."""


@final
@dataclass(frozen=True, kw_only=True, eq=False)
class Calibration:
    """Learnt parameters of the softmax: features' usual sizes (F) and weights, and a bias of each cause.

    `studies`: the number of drawn recordings that it was learnt from.
    """

    usual: Float64[np.ndarray, " F"]
    weights: Float64[np.ndarray, " F"]
    biases: Mapping[str, float]
    nothing: float
    studies: int

    def probabilities(self, screening: Screening) -> tuple[Mapping[str, float], float]:
        """Probabilities of each cause, of a force of none of them (`forces.FORMULA`), and of no detectable effect."""
        causes, table = features(screening)
        least = min(self.biases.values())  # Of what no drawn world hid, as little is believed as of anything.
        biases = np.array([self.biases.get(cause, least) for cause in causes])
        logits = np.append(table / self.usual @ self.weights + biases, self.nothing)
        shares = np.exp(logits - logits.max())
        shares /= shares.sum()
        return dict(zip(causes, shares[:-1].tolist(), strict=True)), float(shares[-1])


@cache
def calibration() -> Calibration:
    """The table that comes with the program."""
    return calibration_in(files("app.discovery.inference").joinpath(TABLE))


def calibration_in(file: Traversable) -> Calibration:
    """The table of a file."""
    known = json.loads(file.read_text(encoding="utf-8"))
    return Calibration(
        usual=np.array(known["usual"]),
        weights=np.array(known["weights"]),
        biases=known["biases"],
        nothing=known["nothing"],
        studies=known["studies"],
    )


def features(screening: Screening) -> tuple[list[str], Float64[np.ndarray, "C F"]]:
    """Feature vectors of the screened causes, in alphabetical order.

    Those of cameras and arm stand in columns of their own: direct observations give other evidence than simulations
    alone.
    """
    by_push, by_episode = _scores(screening)
    suspects = sorted(screening.causes, key=lambda suspect: suspect.cause)
    rows = np.array([_row(screening, suspect, by_push, by_episode) for suspect in suspects])
    log_bayes, score = rows[:, 0], rows[:, 1]
    evidence, rivals = _logarithmic(log_bayes), _best_of_others(log_bayes)
    relative = np.clip(log_bayes - rivals, -_LARGEST, _LARGEST)
    ahead = [np.log1p(np.maximum(rivals, 0)), np.log1p(np.maximum(_best_of_others(score), 0))]
    capped = np.minimum(log_bayes, _LARGEST)
    table = np.column_stack([evidence, capped, relative, *ahead, rows[:, 1:]])
    direct = np.array([suspect.cause in _DIRECT for suspect in suspects])[:, None]
    return [suspect.cause for suspect in suspects], np.concatenate([table * ~direct, table * direct], axis=1)


def _row(
    screening: Screening,
    suspect: CandidateCause,
    by_push: Float64[np.ndarray, "K P"],
    by_episode: Float64[np.ndarray, "E P"],
) -> list[float]:
    """Evidence and robust scores of one cause, how many pushes carry it and agree, information, and size."""
    own = list(suspect.columns)
    rest, projection, information = project_out(screening.weighing.nothing.forms.A.sum(0), screening.prior, own)
    pushes, episodes = (each[:, own] - each[:, rest] @ projection for each in (by_push, by_episode))
    precision = information + _TYPICAL_PRECISION * np.eye(len(own))
    estimate = np.linalg.solve(precision, pushes.sum(0))
    shares = pushes @ estimate
    carried = np.abs(shares).sum() ** 2 / max(float((shares**2).sum()), 1e-12)
    return [
        suspect.finding.log_bayes,
        float(np.clip(_robust(pushes), -3.0, 60.0)),
        float(np.clip(_robust(episodes), -3.0, 40.0)),
        float(np.log(carried + 0.5)),
        float((shares > 0).mean()),
        float((episodes @ estimate > 0).mean()),
        0.5 * float(np.linalg.slogdet(precision)[1]),
        float(np.log(np.linalg.norm(suspect.finding.mean) + 0.05)),
        float(np.log(len(shares))),
    ]


def _scores(screening: Screening) -> tuple[Float64[np.ndarray, "K P"], Float64[np.ndarray, "E P"]]:
    """Scores of each push and of each episode for all columns, about the fit under the null hypothesis."""
    fit, episode = screening.weighing.nothing, screening.data.episode
    by_push = scores(screening.data, fit)
    return by_push, np.stack([by_push[episode == number].sum(0) for number in np.unique(episode)])


def _robust(each: Float64[np.ndarray, "D Q"]) -> float:
    """The squared sum in units of its own scatter, less what chance makes of it (a sandwich; White 1982)."""
    scatter = each.T @ each
    least = 1e-3 * max(float(np.trace(scatter)) / scatter.shape[0], 1e-9)
    total = each.sum(0)
    return float(total @ np.linalg.solve(scatter + least * np.eye(len(total)), total)) - len(total)


def _logarithmic(values: Float64[np.ndarray, " C"]) -> Float64[np.ndarray, " C"]:
    return np.sign(values) * np.log1p(np.abs(values))


def _best_of_others(values: Float64[np.ndarray, " C"]) -> Float64[np.ndarray, " C"]:
    """Largest value of the others, for each."""
    ordered = np.sort(values)
    return np.where(values == ordered[-1], ordered[-2], ordered[-1])
