"""Null priors of pours, learnt from recordings in which nothing is hidden.

`python -m bench.hidden.null_priors FOLDER --studies 12` makes so many, each of a drawn world, and refits and screens it
(two minutes of a core a study of 24 pours); FOLDER keeps what was screened, so that an interrupted run goes on. Then it
prints what each cause seems to be where nothing is missing, as mean and deviation in typical sizes, by expectation and
maximisation over all studies, and by which share of a step the simulator errs in a pour: that which makes the studies
most likely. `--finer N` adds as many of a second world, of three times the drops, and takes an hour; both worlds count
as much. `--hide EFFECT SIZE` screens recordings with that effect instead, and says what the priors that ship make
of them.
"""

import pickle
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Final, final

import numpy as np
import tyro
from jaxtyping import Float64
from rich.console import Console
from rich.progress import track
from rich.table import Table
from threadpoolctl import threadpool_limits

from app.core.errors import SimulationError
from app.discovery.dataset.model_under_test import Catalogue, Subject, Theta
from app.discovery.inference.mixed_effects import fit_mixed_effects
from app.discovery.inference.screen import Screening, prior_of, refit, screen, screening_about
from app.discovery.inference.weighing import Prior, log_evidence, posterior
from app.discovery.residuals.predict import Predictor
from app.discovery.residuals.rows import Residuals
from app.discovery.residuals.sensitivity import Step, erring
from app.discovery.residuals.simulation_batch import prepare
from app.jobs.discovery_subject import subject_of
from app.policy.random_pours import pour_design
from app.sim.model.numerics import ANY_NUMERICS
from app.tasks import load
from bench.hidden.draws import Chosen
from bench.hidden.pours import DROPS, PourCase, Poured

_ROUNDS: Final = 30
"""Rounds of expectation and maximisation."""
_SHARES: Final = (0.0, 0.05, 0.1, 0.15, 0.2, 0.3)
"""Shares of a step by which the simulator may err in a pour, of which the likeliest is found."""
_SAID: Final = 4
"""Causes that are told of a screening."""


@final
@dataclass(frozen=True, kw_only=True, eq=False)
class Screened:
    """Residuals and slopes of a study about its refitted nominal model."""

    about: Theta
    steps: tuple[Step, ...]
    data: Residuals


@final
@dataclass(frozen=True, kw_only=True, eq=False)
class NullPriors:
    """Mean and deviation of what each of the parameters `names` seems to be in studies of nothing, in typical sizes.

    `log_evidence` is that of all studies under them, where the simulator errs by `share` of a step in each pour.
    """

    names: tuple[str, ...]
    mean: Float64[np.ndarray, " P"]
    deviation: Float64[np.ndarray, " P"]
    share: float
    log_evidence: float


@threadpool_limits.wrap(limits=1, user_api="blas")
def screened(case: PourCase) -> Screened:
    """The case as `dipac discover` screens it."""
    study, subject = case.record(), subject_of(case.task)
    predictor = Predictor(subject, subject.catalogue())
    trials = prepare(study, subject)
    found = screen(predictor, trials, refit(predictor, trials))
    return Screened(about=found.about, steps=found.steps, data=found.data)


def learnt(
    subject: Subject, studies: Sequence[Screened], share: float, weights: Sequence[float] | None = None
) -> NullPriors:
    """The priors of physics and of a pour's numerics that make the studies most likely; all others stay as they are.

    `weights`: of each study; all count as much where they are left out. What has a direction has no mean, and the same
    deviation in all (Dempster, Laird and Rubin 1977, "Maximum likelihood from incomplete data via the EM algorithm").
    """
    catalogue = subject.catalogue()
    names = tuple(
        catalogue.specs[column].name
        for cause in catalogue.causes
        if cause.family in ("physics", "numerics") or cause.name == "fill_level"
        for column in cause.columns
    )
    directed = _directed(catalogue, names)
    usual = [_prior(subject, study) for study in studies]
    columns = [_columns(catalogue, study.steps, names) for study in studies]
    zeros = [_zeros(study, own) for study, own in zip(studies, columns, strict=True)]
    mean = np.mean([prior.mean[own] + zero for prior, own, zero in zip(usual, columns, zeros, strict=True)], axis=0)
    deviation = np.sqrt(usual[0].variance[columns[0]])
    evidence, counted = -np.inf, np.ones(len(studies)) if weights is None else np.array(weights)
    counted /= counted.sum()
    data = [_with_share(catalogue, study, share) for study in studies]
    for _ in range(_ROUNDS):
        seems, unsure, evidence = np.zeros((len(studies), len(names))), np.zeros((len(studies), len(names))), 0.0
        for row, (rows, prior, own, zero) in enumerate(zip(data, usual, columns, zeros, strict=True)):
            means, variances = prior.mean.copy(), prior.variance.copy()
            means[own], variances[own] = mean - zero, deviation**2
            supposed = replace(prior, mean=means, variance=variances)
            fit = fit_mixed_effects(rows, supposed.variance, supposed.mean)
            evidence += len(studies) * counted[row] * log_evidence(fit, supposed, 1.0)
            seems[row] = fit.theta[own] + zero
            unsure[row] = np.diag(posterior(fit, supposed, 1.0))[own]
        mean = np.where(directed, 0.0, counted @ seems)
        variance = counted @ (unsure + (seems - mean) ** 2)
        variance[directed] = variance[directed].mean() if directed.any() else 0.0
        deviation = np.sqrt(variance)
    return NullPriors(names=names, mean=mean, deviation=deviation, share=share, log_evidence=evidence)


def likeliest(subject: Subject, studies: Sequence[Screened], weights: Sequence[float]) -> NullPriors:
    """The priors, and the share of a step, that make the studies most likely."""
    tried = (learnt(subject, studies, share, weights) for share in _SHARES)
    return max(tried, key=lambda found: found.log_evidence)


def _directed(catalogue: Catalogue, names: Sequence[str]) -> Float64[np.ndarray, " P"]:
    """Mask of the components of a direction: of causes with several parameters that make them vanish."""
    found = {
        catalogue.specs[column].name for cause in catalogue.causes if cause.switches > 1 for column in cause.columns
    }
    return np.array([name in found for name in names])


def _prior(subject: Subject, study: Screened) -> Prior:
    return prior_of(subject.catalogue(), subject.calibrated, study.about, study.steps)


def _columns(catalogue: Catalogue, steps: Sequence[Step], names: Sequence[str]) -> list[int]:
    known = [catalogue.specs[step.column].name for step in steps]
    return [known.index(name) for name in names]


def _zeros(study: Screened, columns: Sequence[int]) -> Float64[np.ndarray, " P"]:
    """Values of the fitted numerics about which the study was screened, in steps; 0 of causes."""
    steps = [study.steps[column] for column in columns]
    return np.array([study.about[step.column] / step.size if step.cause in ANY_NUMERICS else 0.0 for step in steps])


def _with_share(catalogue: Catalogue, study: Screened, share: float) -> Residuals:
    """The residuals, were the simulator to err by this share of a step in each pour."""
    count, spread = len(study.steps), study.data.spread.copy()
    shipped = erring(catalogue, study.steps)
    spread[:, :, -count:] = study.data.J * np.where(shipped > 0, share, 0.0)
    still = (study.data.spread[:, :, -count:] == 0).all(axis=(0, 2))
    spread[:, still, -count:] = 0.0
    return replace(study.data, spread=spread)


def weighed(subject: Subject, study: Screened) -> Screening:
    """The screening by the priors and the share that ship."""
    catalogue = subject.catalogue()
    shares = erring(catalogue, study.steps)
    data = _with_share(catalogue, study, float(shares.max()))
    return screening_about(catalogue, subject.calibrated, study.about, study.steps, data)


def main(
    folder: tyro.conf.Positional[Path],
    /,
    *,
    task: Annotated[Poured, tyro.conf.arg(help="what is poured")] = "pour_water",
    studies: Annotated[int, tyro.conf.arg(help="how many")] = 12,
    seed: Annotated[int, tyro.conf.arg(help="of the first; the others follow")] = 911,
    episodes: int = 8,
    pours: Annotated[int, tyro.conf.arg(help="in each episode")] = 3,
    finer: Annotated[int, tyro.conf.arg(help="how many more, of three times the drops")] = 0,
    hide: Annotated[tuple[str, float] | None, tyro.conf.arg(help="an effect, and its size in typical ones")] = None,
) -> None:
    """Make and screen the missing studies, and print the priors that they ask for, or what was found."""
    terminal = Console()
    folder.mkdir(parents=True, exist_ok=True)
    hidden = () if hide is None else (Chosen(effect=hide[0], size=hide[1]),)
    subject, kept = subject_of(load(task)), dict[int, Screened]()
    first_finer = seed + studies
    for number in track(range(seed, first_finer + finer), "studies", console=terminal):
        drops = DROPS if number < first_finer else 3 * DROPS
        case = PourCase(seed=number, of=task, hidden=hidden, plan=pour_design(episodes, pours), drops=drops)
        way = "-".join([task, str(number), f"{episodes}x{pours}", str(drops), *map(str, hide or ())])
        path = folder / f"{way}.pickle"
        if not path.exists():
            try:
                path.write_bytes(pickle.dumps(screened(case)))
            except SimulationError as error:
                terminal.print(f"{number}: {error}")
                continue
        kept[number] = pickle.loads(path.read_bytes())
    for number, study in kept.items():
        terminal.print(f"{number}: {_said(weighed(subject, study))}")
    if hide is None and kept:
        coarse = sum(number < first_finer for number in kept)
        weights = [1 / coarse if number < first_finer else 1 / (len(kept) - coarse) for number in kept]
        terminal.print(_shown(likeliest(subject, list(kept.values()), weights), len(kept)))


def _said(screening: Screening) -> str:
    return ", ".join(
        f"{suspect.cause} {suspect.finding.log_bayes:.1f} nats at {np.round(suspect.finding.mean, 2).tolist()}"
        for suspect in screening.suspects[:_SAID]
    )


def _shown(priors: NullPriors, count: int) -> Table:
    title = f"{count} studies, share of a step {priors.share:g}, log evidence {priors.log_evidence:.1f}"
    table = Table("parameter", "mean, typical sizes", "deviation", title=title)
    for name, mean, deviation in zip(priors.names, priors.mean, priors.deviation, strict=True):
        table.add_row(name, f"{mean:.2f}", f"{deviation:.2f}")
    return table


if __name__ == "__main__":
    tyro.cli(main)
