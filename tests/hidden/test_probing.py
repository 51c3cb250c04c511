"""The comparison of chosen and random pushes: drawn worlds, lines that are not made again, and what the table says."""

import json
from pathlib import Path
from typing import Any

import pytest
from rich.console import Console

from app.rig.simulated.effect_sampling import injectable_effects
from bench.hidden.probing import compared, drawn, read

SETUP = {"pushes": 12, "batch": 4}


def line(number: int, by: str, ranks: list[int | None], *, hidden: str | None, named: bool = False) -> dict[str, Any]:
    """A world of which the truth had these ranks after each episode, and was named at the end or not."""
    told = [
        {"pushes": 4 * n, "first": hidden if rank == 1 else "draught", "rank": rank, "named": named and n == len(ranks)}
        for n, rank in enumerate(ranks, 1)
    ]
    return {
        "seed": 0,
        "number": number,
        "by": by,
        **SETUP,
        "hidden": [[hidden, 1.0]] if hidden else [],
        "spent_s": 10.0,
        "told": told,
    }


def rows(lines: list[dict[str, Any]]) -> dict[str, list[str]]:
    table = compared(lines, SETUP)
    cells = [list(column.cells) for column in table.columns]
    return {str(text): [str(column[row]) for column in cells[1:]] for row, text in enumerate(cells[0])}


def test_the_same_world_is_drawn_for_a_number_whatever_else_is_and_hides_what_rods_feel() -> None:
    assert drawn(0, 7, **SETUP) == drawn(0, 7, **SETUP)
    cases = [drawn(0, number, **SETUP) for number in range(40)]
    assert len({case.seed for case in cases}) == 40
    effects = [each.effect for case in cases for each in case.hidden]
    assert 25 < len(effects) < 40
    assert set(effects) <= set(injectable_effects())
    assert "rolling_resistance" not in effects
    assert all(1.0 <= each.size <= 2.0 for case in cases for each in case.hidden)
    assert {case.plan.episodes for case in cases} == {3}


def test_pushes_to_the_truth_count_from_when_it_stays_first() -> None:
    lines = [
        line(0, "chosen", [1, 3, 1], hidden="stribeck", named=True),
        line(0, "random", [4, 3, 2], hidden="stribeck"),
        line(1, "chosen", [1, 1], hidden="table_tilt", named=True),
        line(1, "random", [1, 1, 1], hidden="table_tilt"),
    ]
    found = rows(lines)
    assert found["median pushes to the right name (n = 2)"] == ["10 (8 to 12)", "more (more to more)"]
    assert found["median pushes to the truth being first, and staying so (n = 2)"] == ["8 (4 to 12)", "10 (4 to more)"]
    assert found["mean ratio of the latter, of each world"][0].startswith("0.88 ")
    assert [cell.split(",")[0] for cell in found["named rightly, of those"]] == ["2", "0"]
    assert [cell.split(",")[0] for cell in found["truth among three"]] == ["2", "2"]


def test_a_wrong_name_is_counted_also_where_nothing_was_hidden() -> None:
    wrong = line(0, "chosen", [5, 5], hidden="stribeck", named=True)
    control = line(1, "random", [None, None], hidden=None, named=True)
    lines = [wrong, line(0, "random", [5], hidden="stribeck"), control, line(1, "chosen", [None], hidden=None)]
    found = rows(lines)
    assert [cell.split(",")[0] for cell in found["named wrongly, of those"]] == ["1", "0"]
    assert [cell.split(",")[0] for cell in found["named where nothing is (n = 1)"]] == ["0", "1"]


def test_worlds_that_were_played_one_way_alone_are_not_compared_and_no_lines_make_an_empty_table() -> None:
    half = [line(0, "chosen", [1], hidden="stribeck")]
    for lines in (half, []):
        table = compared(lines, SETUP)
        assert str(table.title).startswith("0 worlds")
        Console(quiet=True).print(table)


@pytest.mark.parametrize("other", [{"pushes": 32}, {"batch": 8}])
def test_lines_of_another_setup_and_those_that_were_cut_off_are_left_alone(
    tmp_path: Path, other: dict[str, int]
) -> None:
    own = line(0, "chosen", [1], hidden="stribeck")
    path = tmp_path / "lines.jsonl"
    path.write_text(f"{json.dumps(own)}\n{json.dumps(own | other)}\n{json.dumps(own)[:40]}")
    assert read(path, SETUP) == [own]
    assert read(tmp_path / "none.jsonl", SETUP) == []
