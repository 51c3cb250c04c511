"""Upper bound of the gain, from known causes: `python -m bench.hidden.oracle --causes A B -o FILE RECORDINGS...`

A process of its own. The hidden causes are taken for known and fitted as discovery fits those that it finds; FILE
gets the one-step errors [mm] of that model and of the refitted nominal one, on episodes left out.
"""

import argparse
import json
from collections.abc import Sequence
from pathlib import Path

from threadpoolctl import threadpool_limits

from app.commands._named import Dynamics, full_name
from app.discovery.inference.refine import refine, start_of
from app.discovery.inference.screen import refit, screen
from app.discovery.residuals.predict import Predictor
from app.discovery.residuals.simulation_batch import prepare
from app.discovery.results.gain import measure_gain
from app.jobs.discovery_subject import subject_of
from app.services.study import read_study
from app.tasks import load


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("recordings", type=Path, nargs="+")
    parser.add_argument("--causes", nargs="+", required=True)
    parser.add_argument("-o", "--output", type=Path, required=True)
    parser.add_argument("--dynamics", choices=("rods", "mpm"), default="rods")
    options = parser.parse_args()
    found = errors_mm(options.recordings, options.causes, options.dynamics)
    options.output.write_text(json.dumps(found), encoding="utf-8")


@threadpool_limits.wrap(limits=1, user_api="blas")
def errors_mm(recordings: Sequence[Path], causes: Sequence[str], dynamics: Dynamics) -> dict[str, float]:
    """One-step errors of the refitted nominal model and of the oracle's [mm]."""
    study = read_study(recordings)
    subject = subject_of(load(full_name(study.task, dynamics=dynamics)))
    predictor, trials = Predictor(subject, subject.catalogue()), prepare(study, subject)
    screening = screen(predictor, trials, refit(predictor, trials), only=causes)
    trials = trials.with_ends(screening.ends)
    suspects = [suspect for suspect in screening.suspects if suspect.cause in causes]
    starts = [(suspect.cause, start_of(predictor.catalogue, screening.about, suspect)) for suspect in suspects]
    gain = measure_gain(predictor, trials, screening, refine(predictor, trials, screening, starts)).gain
    return {"nominal": gain.nominal_mm, "extended": gain.extended_mm}


if __name__ == "__main__":
    main()
