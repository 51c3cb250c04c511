"""HTML in a panel."""

from typing import final

import viser


@final
class Text:
    """A piece of HTML in the container that is open when this is made, sent only when it changed."""

    def __init__(self, gui: viser.GuiApi, content: str) -> None:
        self._handle = gui.add_html(content)

    def put(self, content: str) -> None:
        """Show `content`."""
        if content != self._handle.content:
            self._handle.content = content
