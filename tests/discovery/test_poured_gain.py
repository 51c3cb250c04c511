"""The gain on episodes that were left out, of liquids: what is fitted to the others, and what is not measured."""

import numpy as np
import pytest

from app.discovery.inference.screen import Screening, screening_about
from app.discovery.residuals.poured_contents import CONTENTS
from app.discovery.residuals.predict import Predictor
from app.discovery.residuals.rows import Block, Residuals
from app.discovery.residuals.sensitivity import steps_of
from app.discovery.results.gain import folds_of
from app.jobs.discovery_subject import subject_of
from app.tasks import load
from tests.discovery.exact import exact_model

SUBJECT = subject_of(load("pour_water"))
KNOWN = SUBJECT.catalogue()
PREDICTOR = Predictor(SUBJECT, KNOWN)
OUTFLOW = KNOWN.column("outflow")
EPISODES, POURS = 5, 4
ODD = EPISODES - 1
"""The episode in which more flows out than in the others."""


def screened(outflow: float) -> Screening:
    """Screening about a model with this outflow, of pours in which it is 0.2, and 1.2 in the odd episode."""
    about, steps = KNOWN.nominal(SUBJECT), [step for step in steps_of(KNOWN, (), {}) if step.cause == "outflow"]
    about[OUTFLOW] = outflow
    episode = np.repeat(np.arange(EPISODES), POURS)
    slopes = np.zeros((len(episode), 2 * CONTENTS, 1))
    slopes[:, CONTENTS:] = np.random.default_rng(0).uniform(0.01, 0.03, (len(episode), CONTENTS, 1))
    true = np.where(episode == ODD, 1.2, 0.2)
    noise = 1e-4 * np.random.default_rng(1).normal(size=(len(episode), 2 * CONTENTS))
    data = Residuals(
        r=slopes[:, :, 0] * (true - outflow)[:, None] + noise,
        J=slopes,
        spread=np.zeros((len(episode), 2 * CONTENTS, 1)),
        known=np.arange(2 * CONTENTS) >= np.full((len(episode), 1), CONTENTS),
        episode=episode,
        blocks=(Block(slice(0, 2 * CONTENTS)),),
    )
    return screening_about(KNOWN, (), about, steps, data)


@pytest.mark.parametrize("outflow", [0.4, 0.9])
def test_what_flows_out_is_fitted_to_the_other_episodes(outflow: float) -> None:
    model = exact_model(SUBJECT, KNOWN, ("liquid_viscosity",), {"outflow": outflow})
    folds = folds_of(PREDICTOR, screened(outflow), model)
    assert folds.nominal[ODD][OUTFLOW] == pytest.approx(0.2, abs=0.02)
    assert set(folds.extended) == set(folds.nominal)
    for number, theta in folds.extended.items():
        assert theta[OUTFLOW] == folds.nominal[number][OUTFLOW]
