"""Null priors are learnt from studies that were made up with known ones."""

import numpy as np
import pytest

from app.discovery.inference.weighing import null_prior
from app.discovery.residuals.rows import Block, Residuals
from app.discovery.residuals.sensitivity import steps_of
from app.jobs.discovery_subject import subject_of
from app.sim.model.numerics import ANY_NUMERICS
from app.tasks import load
from bench.hidden.null_priors import Screened, learnt, weighed

SUBJECT = subject_of(load("pour_water"))
CATALOGUE = SUBJECT.catalogue()
STEPS = tuple(steps_of(CATALOGUE, SUBJECT.calibrated, {}))
NAMES = [CATALOGUE.specs[step.column].name for step in STEPS]
NOISE_M = 2e-3


def made_up(number: int, *, outflow: float, friction: float = 0.0) -> Screened:
    """A study of 60 pours that differ in what they say of either; all else changes nothing."""
    rng = np.random.default_rng(number)
    J = np.zeros((60, 2, len(STEPS)))
    J[:, 1, NAMES.index("outflow")] = 0.01 * rng.uniform(0.3, 1.0, 60)
    J[:, 1, NAMES.index("finger_friction")] = -0.02 * rng.uniform(0.3, 1.0, 60)
    theta = np.zeros(len(STEPS))
    theta[NAMES.index("outflow")], theta[NAMES.index("finger_friction")] = outflow, friction
    known = np.tile([False, True], (60, 1))
    return Screened(
        about=CATALOGUE.nominal(SUBJECT),
        steps=STEPS,
        data=Residuals(
            r=(J @ theta + NOISE_M * rng.standard_normal((60, 2))) * known,
            J=J,
            spread=np.zeros((60, 2, len(STEPS))),
            known=known,
            episode=np.repeat(np.arange(6), 10),
            blocks=(Block(slice(0, 2)),),
        ),
    )


def test_what_numerics_seem_to_be_is_learnt_with_its_mean_and_deviation() -> None:
    rng = np.random.default_rng(1)
    true = 0.4 + 0.2 * rng.standard_normal(16)
    found = learnt(SUBJECT, [made_up(number, outflow=value) for number, value in enumerate(true)], 0.0)
    at = found.names.index("outflow")
    assert found.mean[at] == pytest.approx(true.mean(), abs=0.05)
    assert found.deviation[at] == pytest.approx(true.std(), abs=0.06)
    assert found.deviation[found.names.index("finger_friction")] < 0.05


def test_what_has_a_direction_has_no_mean_and_what_is_not_seen_keeps_its_prior() -> None:
    found = learnt(SUBJECT, [made_up(number, outflow=0.2) for number in range(3)], 0.0)
    tilts = [found.names.index(name) for name in ("tilt_x", "tilt_y")]
    assert found.mean[tilts].tolist() == [0.0, 0.0]
    assert found.deviation[tilts[0]] == found.deviation[tilts[1]]
    spec = CATALOGUE.specs[CATALOGUE.column("adhesion")]
    assert found.deviation[found.names.index("adhesion")] == pytest.approx(
        null_prior("physics", spec, kind=SUBJECT.kind)[1]
    )
    assert set(found.names) >= ANY_NUMERICS & set(NAMES)


def test_a_cause_beyond_what_studies_of_nothing_show_is_first_by_what_ships() -> None:
    screening = weighed(SUBJECT, made_up(5, outflow=0.2, friction=2.0))
    assert screening.suspects[0].cause == "finger_friction"
    assert screening.suspects[0].finding.log_bayes > 3
