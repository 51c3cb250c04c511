"""Checks before a command's work, so that hours of it are not lost at the end."""

from pathlib import Path

from app.config import Site
from app.core.errors import PreflightError, UsageError
from app.core.system.disk import is_stream, link_target


def check_writable(path: Path, option: str) -> None:
    """Raises UsageError, which names `option`, if a file cannot be written at `path`; leaves everything as it is."""
    try:
        if is_stream(path):
            return
        goal = link_target(path)
        is_new = not goal.exists()
        goal.open("ab").close()
        if is_new:
            goal.unlink()
    except OSError as error:
        raise unwritable(path, option, error) from None


def unwritable(path: Path, option: str, error: OSError) -> UsageError:
    """The error to raise if `path`, given as `option`, could not be written."""
    return UsageError(f"Cannot write {path}: {error.strerror}; choose another place with {option}.")


def make_folder(folder: Path, option: str) -> None:
    """Make a folder for results. Raises UsageError, which names `option`, if that fails."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise unwritable(folder, option, error) from None


def check_port(site: Site) -> None:
    """Raises PreflightError if the console's port is taken. Another program may still take it afterwards."""
    from app.ui.server import proxy

    try:
        proxy.listen(site.console_host, site.console_port).close()
    except OSError as error:
        raise PreflightError(
            f"Port {site.console_port} on {site.console_host} cannot be had ({error.strerror}); "
            "choose another with --port."
        ) from None
