"""The browser that looks at the console: for its pictures, and for the tests of what an operator sees."""

import os
import shutil

_BROWSERS = ("chromium", "chromium-browser", "google-chrome")
FLAGS = [
    "--no-sandbox",
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
    "--disable-gpu",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
]
MISSING = "Chromium is missing; install it (`apt-get install chromium`) or set DIPAC_CHROMIUM to its path."


def chromium() -> str | None:
    """Where Chromium is: in $DIPAC_CHROMIUM or on the path."""
    return os.environ.get("DIPAC_CHROMIUM") or next(filter(None, map(shutil.which, _BROWSERS)), None)
