"""The running application: `session.py` is all of it on one page."""

from app.session.parts import Parts
from app.session.session import Session

__all__ = ["Parts", "Session"]
