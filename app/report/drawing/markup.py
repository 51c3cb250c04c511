"""Elements of HTML and SVG as text. Strings are escaped; only `tag` makes markup, so that tags match."""

from collections.abc import Iterable
from dataclasses import dataclass
from html import escape
from typing import Final, TypeAlias, final

Attribute: TypeAlias = str | float | bool | None

_VOID: Final = {"meta", "br", "hr", "input", "col"}


@final
@dataclass(frozen=True)
class Markup:
    """Text that is already markup."""

    text: str


Child: TypeAlias = Markup | str


def tag(name: str, /, *children: Child, **attributes: Attribute) -> Markup:
    """An element. `class_` is written class, `data_key` data-key; None and False leave an attribute out."""
    written = "".join(_attribute(key, value) for key, value in attributes.items())
    if name in _VOID:
        return Markup(f"<{name}{written}>")
    return Markup(f"<{name}{written}>{concat(children).text}</{name}>")


def concat(children: Iterable[Child], between: str = "") -> Markup:
    """Concatenated elements and text."""
    return Markup(
        escape(between).join(child.text if isinstance(child, Markup) else escape(child) for child in children)
    )


def short(value: float) -> str:
    """Number of an attribute: a tenth of a pixel is enough."""
    return f"{round(value, 1) + 0.0:.1f}".removesuffix(".0")


def _attribute(key: str, value: Attribute) -> str:
    name = key.removesuffix("_").replace("_", "-")
    if value is None or value is False:
        return ""
    if value is True:
        return f" {name}"
    return f' {name}="{escape(value if isinstance(value, str) else short(value))}"'
