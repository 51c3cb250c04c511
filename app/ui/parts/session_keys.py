"""Session keys, which identify a browser on connections other than viser's."""

import secrets
import threading
from typing import final


@final
class SessionKeys:
    """Unguessable key of each browser, known to it alone. Every method may be called from any thread."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._owners: dict[str, str] = {}

    def issue(self, operator: str) -> str:
        """Issue a key to a new browser."""
        key = secrets.token_urlsafe(24)
        with self._lock:
            self._owners[key] = operator
        return key

    def owner(self, key: str) -> str | None:
        """Operator of a key; None for an unknown one, or where its browser has left."""
        with self._lock:
            return self._owners.get(key)

    def revoke(self, operator: str) -> None:
        """Revoke the keys of a browser that has left."""
        with self._lock:
            self._owners = {key: name for key, name in self._owners.items() if name != operator}
