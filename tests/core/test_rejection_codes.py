"""Codes by which an arm refuses a motion are all documented for its users."""

import re

from app.core.errors import MotionRefused
from app.core.rejection_codes import Refusal
from tests.conftest import ROOT


def test_a_refusal_shows_its_code_behind_the_sentence() -> None:
    refusal = MotionRefused(Refusal.KEEP_OUT, "The motion enters 'stand'; plan around it.")
    assert str(refusal) == "The motion enters 'stand'; plan around it. [keep-out]"
    assert refusal.code is Refusal.KEEP_OUT


def test_the_safety_page_lists_every_code_and_no_other() -> None:
    page = (ROOT / "docs" / "safety.md").read_text(encoding="utf-8")
    table = page.split("## What is refused")[1].split("## ")[0]
    assert re.findall(r"^\| `([a-z-]+)` \|", table, re.MULTILINE) == [code.value for code in Refusal]
