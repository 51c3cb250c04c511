"""Made-up lines of results: cases as the suite draws them, and solvers that are functions from a case to a verdict."""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from app.discovery.dataset.model_under_test import catalogue
from bench.hidden.draws import Case, Chosen, World, drawn, kinds
from bench.hidden.outcome import Outcome, outcome

FAMILIES = {cause.name: cause.family for cause in catalogue().causes}
SEED = 11
Told = tuple[str, list[dict[str, Any]], list[dict[str, Any]]]
"""A kind of verdict, its causes and its ranking."""
Solver = Callable[[Case, np.random.Generator], Told]


def outcomes(solver: Solver, count: int = 600, world: World = "own", *, shuffled: bool = False) -> list[Outcome]:
    """Outcomes of a solver on so many cases; `shuffled`: scored by the truths of others."""
    rng = np.random.default_rng(SEED)
    cases = [drawn(SEED, number, world) for number in range(count)]
    verdicts = [solver(case, rng) for case in cases]
    if shuffled:
        cases = [cases[at] for at in rng.permutation(count)]
    return [outcome(line(case, told)) for case, told in zip(cases, verdicts, strict=True)]


def line(case: Case, told: Told, *, nominal: float = 3.0, extended: float = 2.0) -> dict[str, Any]:
    """A line of results with that verdict. Sizes of truths are their typical ones."""
    kind, causes, ranking = told
    extended = nominal if kind == "none" else extended
    return {
        "case": {
            "number": case.number,
            "world": case.world,
            "dynamics": "rods",
            "images": case.world == "mujoco",
            "seed": SEED,
            "episodes": 10,
            "pushes": 20,
            "hidden": [[each.effect, each.size] for each in case.hidden],
        },
        "truth": {"effects": [truth(each) for each in case.hidden]},
        "verdict": {
            "verdict": kind,
            "causes": causes,
            "ranking": ranking,
            "formula": None,
            "leftover": None,
            "heldout": {"nominal": nominal, "extended": extended},
            "limits": [],
            "amount": {"pushes": 200},
            "spent_s": [
                {"stage": "nominal fit", "seconds": 10.0},
                {"stage": "screening of every cause", "seconds": 50.0},
                {"stage": "decision", "seconds": 100.0},
            ],
        },
        "spent": {"wall_s": 200.0, "processor_s": 300.0, "peak_mb": 900.0},
        "oracle": {"nominal": nominal, "extended": 2.0} if case.hidden else None,
    }


def truth(chosen: Chosen) -> dict[str, Any]:
    return {
        "effect": chosen.effect,
        "family": FAMILIES.get(chosen.effect, "physics"),
        "catalogued": chosen.effect in FAMILIES,
        "parameters": {"size": {"value": chosen.size, "unit": "1", "null": 0.0}},
    }


def blamed(effect: str, probability: float, size: float = 1.0, deviation: float = 0.1) -> dict[str, Any]:
    """An entry of a verdict, with the 90 % interval of a normal law."""
    return {
        "effect": effect,
        "family": FAMILIES[effect],
        "size": size,
        "low": size - 1.645 * deviation,
        "high": size + 1.645 * deviation,
        "probability": probability,
    }


def others(effect: str, rng: np.random.Generator) -> list[str]:
    """The rest of the catalogue in any order."""
    return [name for name in rng.permutation(kinds("own")).tolist() if name != effect]


def ranked(first: Sequence[dict[str, Any]], rng: np.random.Generator) -> list[dict[str, Any]]:
    """A whole ranking that begins with `first`."""
    named = [each["effect"] for each in first]
    return [*first, *(blamed(name, 1e-3) for name in others(named[0], rng) if name not in named)]


def good(case: Case, rng: np.random.Generator) -> Told:
    """A solver that is right as often as is asked for, and a little more; 19 of 20 sizes lie in their intervals."""
    outside = any(each.effect not in FAMILIES for each in case.hidden)
    if not case.hidden or (outside and rng.uniform() > 0.9):
        return "none", [], ranked([blamed(others("", rng)[0], 0.02)], rng)
    if outside:
        return "none_of_these", [], ranked([blamed(others("", rng)[0], 0.03)], rng)
    found = [_measured(each, rng) for each in case.hidden]
    if len(found) == 2 and rng.uniform() > 0.8:
        found = found[:1]
    if len(case.hidden) == 1 and rng.uniform() > 0.99:
        wrong = blamed(others(case.hidden[0].effect, rng)[0], 0.85)
        return "named", [wrong], ranked([wrong, found[0] | {"probability": 0.1}], rng)
    return "named", found, ranked(found, rng)


def guessing(case: Case, rng: np.random.Generator) -> Told:
    """A solver that draws causes as the suite does, and looks at nothing."""
    if rng.uniform() < 0.25:
        return "none", [], ranked([blamed(others("", rng)[0], 0.3)], rng)
    named = blamed(others("", rng)[0], 0.9, float(rng.uniform(0.25, 2)))
    return "named", [named], ranked([named], rng)


def always_friction(case: Case, rng: np.random.Generator) -> Told:
    """A solver that always says that friction differs from place to place, whatever was seen."""
    named = blamed("friction_map", 0.95)
    return "named", [named], ranked([named], rng)


def never(case: Case, rng: np.random.Generator) -> Told:
    """A solver that always says that nothing is missing."""
    return "none", [], ranked([blamed(others("", rng)[0], 0.1)], rng)


def _measured(chosen: Chosen, rng: np.random.Generator) -> dict[str, Any]:
    deviation = 0.08 * chosen.size
    return blamed(chosen.effect, 0.97, chosen.size + deviation * float(rng.standard_normal()), deviation)
