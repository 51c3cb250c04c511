"""The browser that looks at the console: for its pictures, and for the tests of what an operator sees."""

import os
import shutil
from collections.abc import Generator, Iterable
from contextlib import contextmanager

from playwright.sync_api import Browser, sync_playwright

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
    """Path of Chromium: from $DIPAC_CHROMIUM or the search path."""
    return os.environ.get("DIPAC_CHROMIUM") or next(filter(None, map(shutil.which, _BROWSERS)), None)


@contextmanager
def open_browser() -> Generator[Browser]:
    """A Chromium without a window, which draws in software. Raises SystemExit where there is none."""
    executable = chromium()
    if executable is None:
        raise SystemExit(MISSING)
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=executable, args=FLAGS)
        yield browser
        browser.close()


def console_url(lines: Iterable[str]) -> str:
    """URL of the console, from the program's output at its start. Raises SystemExit if it ends before."""
    head, printed = "Operator console: ", list[str]()
    for line in lines:
        if line.startswith(head):
            return line.removeprefix(head).strip()
        printed.append(line)
    raise SystemExit("The program ended before its console was there:\n" + "".join(printed))
