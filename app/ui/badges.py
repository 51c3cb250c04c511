"""Which browser it is that speaks to us on another way than viser's."""

import secrets
import threading
from typing import final


@final
class Badges:
    """A key for each browser, told to it alone, that nobody can guess. Every method may be called from any thread."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._owners: dict[str, str] = {}

    def issue(self, operator: str) -> str:
        """A key for a browser that has come."""
        key = secrets.token_urlsafe(24)
        with self._lock:
            self._owners[key] = operator
        return key

    def owner(self, key: str) -> str | None:
        """Whose key it is; None where it is nobody's, or whose it was has gone."""
        with self._lock:
            return self._owners.get(key)

    def revoke(self, operator: str) -> None:
        """A browser has gone."""
        with self._lock:
            self._owners = {key: name for key, name in self._owners.items() if name != operator}
