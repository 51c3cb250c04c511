"""The page of verdicts has every case of the bench: its commands, what they printed, and a picture that is there."""

import re

import pytest

from bench.gallery import CASES, DOCS, Shown, section

PAGE = (DOCS / "gallery.md").read_text(encoding="utf-8")


@pytest.mark.parametrize("case", CASES, ids=[case.name for case in CASES])
def test_a_case_is_on_the_page_as_it_was_printed(case: Shown) -> None:
    printed, truth = re.search(
        rf"## {re.escape(case.title)}\n.*?```text\n(.*?)\n```\n\nHidden was: (.*?)\.\n", PAGE, re.DOTALL
    ).groups()  # pyright: ignore[reportOptionalMemberAccess] - a page without the case fails here
    assert section(case, printed, truth) in PAGE
    assert "─" in printed
    assert all(name.split("=")[0] in truth for name in case.hidden)
    assert (DOCS / "images" / f"gallery-{case.name}.png").stat().st_size > 10_000


def test_no_case_is_told_what_is_hidden_by_the_name_of_its_folder() -> None:
    for case in CASES:
        effects = " ".join(case.hidden)
        assert case.name not in effects
        assert not any("truth" in word for word in case.discover)
