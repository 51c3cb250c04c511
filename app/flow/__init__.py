"""The running application: `flow.py` is all of it on one page."""

from app.flow.flow import Flow

__all__ = ["Flow"]
