"""The TLS certificate of a console served to other machines."""

import ssl
from dataclasses import dataclass
from pathlib import Path
from typing import final

from app.core.errors import PreflightError


@final
@dataclass(frozen=True, kw_only=True)
class Tls:
    """A certificate with its key, in PEM files; `name`: its host name, under which visitors come."""

    certificate: Path
    key: Path
    name: str

    def context(self) -> ssl.SSLContext:
        """Server context, TLS 1.2 or newer. Raises PreflightError where the files are missing or do not match."""
        context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
        context.minimum_version = ssl.TLSVersion.TLSv1_2
        try:
            # With an empty passphrase a key that has one is an error, and not a question in the terminal.
            context.load_cert_chain(self.certificate, self.key, password="")
        except (OSError, ssl.SSLError) as error:
            why = error.strerror or str(error)
            raise PreflightError(
                f"Cannot serve with --tls-cert {self.certificate} and --tls-key {self.key} ({why}); give a certificate "
                "and its key without a passphrase, as PEM files."
            ) from error
        return context
