"""Elements of the page: sections, figures with captions, legends and tables."""

from collections.abc import Iterable, Sequence

from app.report.drawing.markup import Child, Markup, concat, tag


def section(ident: str, number: int, title: str, question: str, *children: Child) -> Markup:
    """A section of the case file: its title and question at the side, and the answer."""
    head = tag("header", tag("h2", tag("span", str(number), class_="number"), title), tag("p", question), class_="side")
    return tag("section", head, tag("div", *children, class_="body"), id=ident)


def figure(drawing: Child, caption: Child, *, legend: Child = "", controls: Child = "", kind: str = "") -> Markup:
    """A drawing with its caption."""
    return tag(
        "figure",
        controls,
        tag("div", drawing, class_="drawing"),
        legend,
        tag("figcaption", caption),
        class_=kind or None,
    )


def legend(entries: Iterable[tuple[str, str]]) -> Markup:
    """Legend of the colours: classes of swatches, and names."""
    return tag("ul", *(tag("li", swatch(kind), name) for kind, name in entries), class_="legend")


def swatch(kind: str) -> Markup:
    """A mark in a class's colour."""
    return tag("i", class_=f"swatch {kind}", aria_hidden="true")


def chooser(group: str, title: str, options: Iterable[tuple[str, str]]) -> Markup:
    """Selector of the parts of `group` that are shown: keys and names (report.js)."""
    choices = [tag("option", name, value=key) for key, name in options]
    return tag("label", title, tag("select", *choices, data_pick=group), class_="chooser")


def table(
    heads: Sequence[str], rows: Iterable[Sequence[Child]], *, numbers: Sequence[int] = (), kind: str = ""
) -> Markup:
    """A table; columns in `numbers` are set flush right."""

    def cells(name: str, row: Sequence[Child]) -> Markup:
        return concat(tag(name, cell, class_="n" if index in numbers else None) for index, cell in enumerate(row))

    head = tag("thead", tag("tr", cells("th", heads)))
    body = tag("tbody", *(tag("tr", cells("td", row)) for row in rows))
    return tag("div", tag("table", head, body, class_=kind or None), class_="scroll")


def columns(*children: Child, kind: str = "two") -> Markup:
    """Elements beside one another where there is room."""
    return tag("div", *children, class_=f"columns {kind}")


def paragraph(text: str, kind: str = "") -> Markup:
    """A paragraph of plain text."""
    return tag("p", text, class_=kind or None)


def details(summary: str, *children: Child) -> Markup:
    """Collapsed details under a summary."""
    return tag("details", tag("summary", summary), *children)
