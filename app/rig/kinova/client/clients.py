"""The available clients, by name."""

from collections.abc import Callable, Mapping

from app.core.errors import UsageError
from app.rig.kinova.client.client import OwnLink
from app.rig.kinova.client.link import Address, Link
from app.rig.kinova.client.official import OfficialLink

CLIENTS: Mapping[str, Callable[[Address], Link]] = {"dipac": OwnLink, "kortex_api": OfficialLink}
DEFAULT = "dipac"
"""Name of the default client: it needs no wheel, bounds every wait, and lets the arm notice a hanging loop."""


def link_by(address: Address, client: str = DEFAULT) -> Link:
    """An unopened link by the client of that name. Raises UsageError, and PreflightError where it is not installed."""
    if client not in CLIENTS:
        raise UsageError.unknown("client", client, CLIENTS)
    return CLIENTS[client](address)
