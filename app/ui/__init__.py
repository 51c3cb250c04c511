"""The operator console: a page in the browser that shows messages and sends requests. Computes nothing."""

from app.ui.console import Console, open_console

__all__ = ["Console", "open_console"]
