"""Conclusions: what is named predicts episodes that were left out, or is not named and changes no model."""

from dataclasses import replace
from unittest.mock import Mock

import numpy as np
import pytest

from app.core.dialogue.model_monitor_messages import VerdictKind
from app.discovery import pipeline
from app.discovery.inference.screen import Screening
from app.discovery.pipeline import Conclusion, Judged, conclude
from app.discovery.residuals.forces import with_formula
from app.discovery.residuals.predict import Predictor
from app.discovery.results.gain import Gained
from app.discovery.unexplained.formula import NO_FORCE, AcceptedFormula, UnexplainedForce
from app.discovery.unexplained.residual_test import ResidualTest
from tests.discovery.test_soundness import gain
from tests.discovery.test_steppers import trials
from tests.discovery.test_verdict import CATALOGUE, SUBJECT, SURE, TORN, model

FORMULA = AcceptedFormula(features=("swirl",), model=model("table_tilt"), catalogue=with_formula(CATALOGUE, ("swirl",)))
FORCE = UnexplainedForce(ResidualTest(0.98, 0.008), FORMULA)
FOUND = {"named": (SURE, NO_FORCE), "set": (TORN, NO_FORCE), "none_of_these": (SURE, FORCE)}
"""Decisions, and forces beside them, by the verdict that they lead to."""


def gained(nominal_mm: float, extended_mm: float, *, low: float, high: float) -> Gained:
    errors = np.array([[nominal_mm, extended_mm]])
    found = gain(nominal_mm, extended_mm, low=low, high=high)
    return Gained(gain=found, per_episode=errors, steps=errors, examples=())


BETTER = gained(20.0, 12.0, low=0.3, high=0.5)
A_LITTLE_WORSE = gained(20.0, 22.0, low=-0.12, high=-0.05)
WORSE = gained(20.0, 60.0, low=-2.8, high=-1.5)


def concluded(monkeypatch: pytest.MonkeyPatch, kind: str, measured: Gained) -> Conclusion:
    decision, force = FOUND[kind]
    monkeypatch.setattr(pipeline, "measure_gain", Mock(return_value=measured))
    return conclude(
        Judged(
            predictor=Predictor(SUBJECT, CATALOGUE),
            trials=trials(),
            about=CATALOGUE.nominal(SUBJECT),
            screening=object.__new__(Screening),  # For the gain alone, which is given.
            decision=decision,
            limits=(),
        ),
        force,
    )


@pytest.mark.parametrize("measured", [BETTER, A_LITTLE_WORSE], ids=["better", "a little worse"])
@pytest.mark.parametrize("kind", sorted(FOUND))
def test_what_predicts_as_well_or_better_stays_what_was_decided(
    monkeypatch: pytest.MonkeyPatch, kind: VerdictKind, measured: Gained
) -> None:
    found = concluded(monkeypatch, kind, measured)
    assert found.verdict == kind
    assert found.model is not None
    assert found.gain is measured
    assert not found.limits


@pytest.mark.parametrize("kind", sorted(FOUND))
def test_what_predicts_worse_is_not_named_and_extends_no_model(monkeypatch: pytest.MonkeyPatch, kind: str) -> None:
    found = concluded(monkeypatch, kind, WORSE)
    # Causes that cannot be told apart are still those that are left.
    assert (found.verdict, bool(found.names)) == (("set", True) if kind == "set" else ("none", False))
    assert found.model is None
    (limit,) = found.limits
    assert "errs by 60.0 mm a push" in limit.text
    assert ("the force that was found" in limit.text) == (kind == "none_of_these")
    assert found.gain.gain == replace(WORSE.gain, extended_mm=20.0, gain=0.0, low=0.0, high=0.0)
    np.testing.assert_array_equal(found.gain.steps, [[20.0, 20.0]])
