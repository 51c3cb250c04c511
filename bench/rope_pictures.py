"""A push of the real rope seen from above, as a drawing of its own: before, observed, and as two models predict it."""

from collections.abc import Sequence
from typing import Final

from app.core.types import Points
from app.report.drawing.chart import Plot, label
from app.report.drawing.ground import Flat, bounds, cloud, ground, surface, way
from app.report.drawing.markup import Markup, concat, tag
from app.ui.parts.palette import MEASURED, OBSERVED, PREDICTED, STEEL, Colour

_WIDTH, _HEAD = 460.0, 24.0
_EXTENDED: Final[Colour] = (0, 114, 178)
_LAYERS: Final = (
    ("before", "before", STEEL),
    ("nominal", "nominal", PREDICTED),
    ("extended", "extended", _EXTENDED),
    ("observed", "observed", OBSERVED),
)


def picture(title: str, clouds: Sequence[Points], tool: Flat, extended: str) -> str:
    """The text of an SVG file. `clouds`: before, nominal, extended, observed; all within one drawing."""
    p = ground(bounds([*clouds, tool]), _WIDTH)
    drawn = [cloud(p, points, kind) for points, (kind, _, _) in zip(clouds, _LAYERS, strict=True)]
    return tag(
        "svg",
        tag("title", title),
        tag("style", Markup(_style())),
        tag("rect", width=p.width, height=p.height + _HEAD, fill="#ffffff"),
        tag("g", surface(p), *drawn, way(p, tool), transform=f"translate(0 {_HEAD:g})"),
        label(p.x.start, 16, title, "name"),
        _legend(p, extended),
        xmlns="http://www.w3.org/2000/svg",
        viewBox=f"0 0 {p.width:.0f} {p.height + _HEAD:.0f}",
        width=p.width,
        height=p.height + _HEAD,
        role="img",
    ).text


def _legend(p: Plot, extended: str) -> Markup:
    """Above the drawing, on its right."""
    parts, x = list[Markup](), p.x.end
    for kind, name, _ in reversed(_LAYERS):
        said = extended if kind == "extended" else name
        x -= 6.5 * len(said) + 18
        parts += [tag("circle", cx=x + 5, cy=12, r=3.5, class_=f"key-{kind}"), label(x + 12, 16, said, "tick")]
    return concat(parts)


def _style() -> str:
    dots = "".join(f".{kind}{{stroke:{_hex(colour)}}}.key-{kind}{{fill:{_hex(colour)}}}" for kind, _, colour in _LAYERS)
    return (
        "text{font:11px sans-serif;fill:#444}.name{font-size:12px;fill:#222}path{fill:none}"
        ".dots{stroke-width:3.2;stroke-linecap:round}.grid{stroke:#e8e8e8}.axis{stroke:#999}.ground{fill:#fafafa}"
        f".tool{{stroke:{_hex(MEASURED)};stroke-width:2}}.tool-start{{stroke:{_hex(MEASURED)};stroke-width:7}}{dots}"
    )


def _hex(colour: Colour) -> str:
    return "#" + "".join(f"{part:02x}" for part in colour)
