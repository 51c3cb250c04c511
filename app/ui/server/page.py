"""The page around viser's own: a bar with the name, the kind of cell, and STOP, above everything and never movable.

Viser's theme leaves room for a title bar, and ours lies there. The bar works without viser: STOP is a request of its
own, and it turns red where that request fails.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from html import escape
from importlib.resources import files
from typing import Final, Literal, TypeAlias, final

from app.ui.server.jog_panel import drawer


@final
@dataclass(frozen=True, kw_only=True)
class Asset:
    """A file served beside the page."""

    body: bytes
    kind: str


def _asset(name: str, kind: str) -> Asset:
    return Asset(body=files("app.ui").joinpath("assets", name).read_bytes(), kind=kind)


ASSETS: Final = {
    "console.css": _asset("console.css", "text/css"),
    "console.js": _asset("console.js", "text/javascript"),
    "jog.js": _asset("jog.js", "text/javascript"),
}

ENTERING: Final = """<!doctype html><meta charset="utf-8"><title>dipac</title>
<script>location.replace("/")</script><a href="/">Open the console</a>"""


Cell: TypeAlias = Literal["simulated", "replayed", "real", "replay"]
"""Kind of cell behind the console: a simulated arm, with simulated cameras or recorded ones that do not see it; a
real one; or a recording alone."""

_BANNERS: Final[Mapping[Cell, tuple[str, str]]] = {
    "simulated": ("SIMULATED", "nothing real moves"),
    "replayed": ("RECORDED IMAGES", "nothing that is seen answers to the arm"),
    "real": ("REAL ARM", "keep a hand on the hardware stop"),
    "replay": ("REPLAY", "a recording: nothing moves"),
}


@final
@dataclass(frozen=True, kw_only=True)
class Page:
    """Content of the bar. `jogging`: True where the tool can be jogged from here."""

    title: str
    cell: Cell
    jogging: bool = False

    def around(self, viser_html: bytes) -> bytes:
        """Viser's page with our title, style, script and bar in it."""
        jog = '<script defer src="/jog.js"></script>' if self.jogging else ""
        head = (
            f"<title>{escape(self.title)}</title>"
            '<link rel="stylesheet" href="/console.css"><script defer src="/console.js"></script>'
            f"{jog}</head>"
        )
        html = viser_html.replace(b"<title>Viser</title>", b"", 1).replace(b"</head>", head.encode(), 1)
        body = html.index(b"<body")
        end = html.index(b">", body) + 1
        return html[:end] + (self._bar() + (drawer() if self.jogging else "")).encode() + html[end:]

    def _bar(self) -> str:
        said, small = _BANNERS[self.cell]
        banner = f'<span class="dp-{self.cell}" role="status">{said}<small>{small}</small></span>'
        stop, why = ("disabled", "Nothing can move here") if self.cell == "replay" else ("", "Stop the arm now (Esc)")
        return (
            f'<header class="dp-bar"><span class="dp-brand">{escape(self.title)}</span>{banner}'
            '<span id="dp-mode-now" title="What the program does by itself"></span><span class="dp-room"></span>'
            '<span id="dp-stop-says" role="alert"></span>'
            '<span id="dp-lost" role="alert" hidden>No connection: what you see is old</span>'
            f'<button id="dp-stop" type="button" aria-label="STOP" title="{why}" {stop}>STOP'
            "<kbd>Esc</kbd></button></header>"
        )


def refusal_page(reason: str) -> str:
    """The page for a visitor without the token."""
    return (
        '<!doctype html><meta charset="utf-8"><title>dipac: not admitted</title>'
        '<body style="font:16px/1.5 system-ui,sans-serif;max-width:34rem;margin:18vh auto;padding:0 1rem">'
        "<h1 style='font-size:1.4rem'>This console needs its key</h1>"
        f"<p>{escape(reason)}</p><p>Open the URL that the program printed when it started "
        "(it ends in <code>/?token=…</code>). Each run has a new one.</p>"
    )
