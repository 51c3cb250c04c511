"""The clients there are, by name."""

from collections.abc import Callable, Mapping

from app.core.errors import UsageError
from app.rig.kinova.client import OwnLink
from app.rig.kinova.link import Address, Link
from app.rig.kinova.official import OfficialLink

CLIENTS: Mapping[str, Callable[[Address], Link]] = {"dipac": OwnLink, "kortex_api": OfficialLink}
DEFAULT = "dipac"
"""This program's own needs no wheel, has an end to every wait, and leaves it to the arm to notice a loop that hangs."""


def linked(address: Address, client: str = DEFAULT) -> Link:
    """A link by the client of that name, not open yet. Raises UsageError, and PreflightError where it is missing."""
    if client not in CLIENTS:
        raise UsageError.unknown("client", client, CLIENTS)
    return CLIENTS[client](address)
