"""Numbers in the operator's form. Pure; every function takes SI and returns a short string."""

import math
from collections.abc import Mapping
from typing import Final

from app.core.dialogue.control import ModeName
from app.core.messages import Proposal

MODES: Final[Mapping[ModeName, str]] = {
    "idle": "Idle",
    "teleoperate": "By hand",
    "plan only": "Plan only",
    "approve each": "Approve each",
    "automatic": "Automatic",
}
"""Labels of the modes."""
NOTHING = "\N{EN DASH}"
"""Shown where there is no number yet."""
_HUNDRED = 99.95
_SURE = 0.01
"""Probabilities nearer to 0 or 1 than this are shown as a bound."""


def duration(seconds: float) -> str:
    """A duration in words, for example `80 ms`, `2.4 s`, `3 min 5 s`."""
    if not math.isfinite(seconds):
        return NOTHING
    if seconds < 0.0995:
        return f"{seconds * 1e3:.0f} ms"
    if seconds < 9.95:
        return f"{seconds:.1f} s"
    whole = round(seconds)
    return f"{whole} s" if whole < 60 else f"{whole // 60} min {whole % 60} s"


def distance(chamfer_m2: float) -> str:
    """A squared Chamfer distance as the mean distance it stands for: the root of its half, in millimetres."""
    return f"{millimetres(chamfer_m2):.1f} mm" if math.isfinite(chamfer_m2) else NOTHING


def millimetres(chamfer_m2: float) -> float:
    """The root of half a squared symmetric Chamfer distance [mm], as `core.dialogue.approval.drift` measures it."""
    return math.sqrt(max(chamfer_m2, 0.0) / 2) * 1e3


def square(chamfer_m2: float) -> str:
    """A squared distance with its unit, for example `123 mm²`."""
    return f"{_format_number(1e6 * chamfer_m2)} mm²" if math.isfinite(chamfer_m2) else NOTHING


def number(value: float) -> str:
    """Three significant digits."""
    return f"{value:.3g}" if math.isfinite(value) else NOTHING


def _format_number(value: float) -> str:
    """Three significant digits, but all before the point."""
    return f"{value:.0f}" if abs(value) >= _HUNDRED else f"{value:.3g}"


def size(count: int) -> str:
    """Bytes in GB or MB."""
    return f"{count / 1e9:.1f} GB" if count >= 1e9 else f"{count / 1e6:.0f} MB"


def probability(share: float) -> str:
    """A probability in per cent: never quite 0 or 100, as nothing is so sure."""
    if not math.isfinite(share):
        return NOTHING
    if share < _SURE:
        return "< 1 %"
    return "> 99 %" if share > 1 - _SURE else f"{100 * share:.0f} %"


def sentence(text: str) -> str:
    """`text` with a capital first letter."""
    return text[:1].upper() + text[1:]


def change(before: float, after: float) -> str:
    """Change of a positive quantity, in per cent, for example `-38 %`; empty where there is no base."""
    if not (math.isfinite(before) and math.isfinite(after)) or before <= 0:
        return ""
    percent = 100 * (after / before - 1)
    sign = "+" if percent >= 0 else "\N{MINUS SIGN}"
    return f"{sign}{abs(percent):.0f} %"


def origin(proposal: Proposal) -> str:
    """Kind of the chosen branch, of how many; or a note that the motion was requested."""
    if proposal.chosen.origin == "asked":
        return "the motion that discovery asks for"
    if proposal.chosen.origin == "start":
        return "the way to the start pose"
    if proposal.chosen.origin == "shown":
        return "a motion of the demonstration"
    if proposal.chosen.origin == "edited":
        return f"the motion as you changed it, before {len(proposal.branches) - 1} others"
    if proposal.chosen.origin == "part":
        return f"a branch that makes a part of each of the policy's actions, of {len(proposal.branches)}"
    if proposal.chosen.origin == "learned":
        return f"the learned policy's branch, of {len(proposal.branches)}"
    return f"{proposal.chosen.origin} branch, {proposal.best + 1} of {len(proposal.branches)}"


def motions(count: int) -> str:
    """Number of motions in words."""
    return "1 motion" if count == 1 else f"{count} motions"
