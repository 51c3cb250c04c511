"""Ask recorded pushes what the simulation gets wrong: the verdict in words, and how probable each cause is.

Start it with `python examples/03_discover.py RECORDING...`; ten pushes or more tell something.
"""

from pathlib import Path

import tyro
from tyro.conf import Positional

from app.discovery.pipeline import discover
from app.discovery.results.case import Case
from app.jobs.discovery_subject import doubted_in
from app.services.study import read_study
from app.tasks import load, name_with_dynamics


def main(recordings: Positional[tuple[Path, ...]]) -> Case:
    """Refit the nominal model, weigh every cause against it, and say what is missing and how sure that is."""
    study = read_study(recordings)
    doubted = doubted_in(study, load(name_with_dynamics(study.task)))
    case = discover(study, doubted.subject, lambda stage: print(f"  {stage} ..."), doubted.about)
    print(f"{case.verdict}: {' '.join(case.sentences)}")
    for blame in case.ranking[:5]:
        sizes = ", ".join(
            f"{it.name} {it.value:.3g} {it.unit} ({it.low:.3g} to {it.high:.3g})" for it in blame.estimates
        )
        print(f"  {blame.probability:4.0%} {blame.effect}: {sizes}")
    return case


if __name__ == "__main__":
    tyro.cli(main)
