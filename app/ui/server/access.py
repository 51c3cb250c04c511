"""Access control of the console, as functions of request headers. Pure.

A page on another site can make the operator's browser send requests here, and a name under an attacker's control can be
pointed at 127.0.0.1; so a request needs the token (as a cookie), a Host that is one of our names and, where it changes
anything, an Origin equal to that Host.
"""

import hmac
from dataclasses import dataclass, field
from typing import final
from urllib.parse import urlsplit

LOOPBACK = ("127.0.0.1", "localhost", "::1")


@final
@dataclass(frozen=True, kw_only=True)
class Access:
    """Credentials of one console. `cookie` is the name under which the browser keeps the token.

    `names`: host names that the console answers to; `secure`: over TLS alone.
    """

    token: str = field(repr=False)
    cookie: str
    names: tuple[str, ...] = LOOPBACK
    secure: bool = False

    def knows(self, given: str | None) -> bool:
        """True where `given` is the token, in constant time."""
        # Bytes of a header that are not UTF-8 arrive as surrogates.
        return hmac.compare_digest((given or "").encode(errors="surrogateescape"), self.token.encode())

    def refusal(self, *, host: str, origin: str | None, cookie: str | None, acts: bool) -> str | None:
        """Reason why this request is refused, None where it may pass. `acts`: a WebSocket or anything but a GET."""
        if not self.answers_to(host):
            return "The console does not answer to this name."
        if origin is None and acts:
            return "The request does not say which page it comes from."
        if origin is not None and self._authority(origin) != host:
            return "The request comes from another page."
        if not self.knows(cookie):
            return "The token is missing or is not the one of this run."
        return None

    def answers_to(self, host: str) -> bool:
        """True where a Host header is ours, at any port: an SSH tunnel may use another one."""
        try:
            return urlsplit(f"//{host}").hostname in self.names
        except ValueError:
            return False

    def _authority(self, origin: str) -> str | None:
        """Host and port of an Origin header, None where it is opaque, malformed or of another scheme."""
        try:
            parts = urlsplit(origin)
        except ValueError:
            return None
        return parts.netloc if parts.scheme == ("https" if self.secure else "http") else None
