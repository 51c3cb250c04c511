"""Goal upload: receives files from a browser, and requests the goal from the program."""

from collections.abc import Callable, Sequence
from typing import Final, final

import anyio
from aiohttp import web
from anyio import to_thread

from app.core.dialogue.requests import GoalRequest, PictureGoalRequest
from app.core.errors import UsageError
from app.core.messages import fresh_id
from app.ui.goals.files import are_points, pictures_of, points_of
from app.ui.parts.operator_controller import OperatorController
from app.ui.parts.session_keys import SessionKeys

_MOST_FILES: Final = 2


@final
class GoalUpload:
    """Serves `POST /goal`: a form with the browser's `key`, the name of a `camera`, and one file or two as `files`.

    Answers in words, which the page shows. Files are read in a thread of their own.
    """

    def __init__(
        self, controller: OperatorController, session_keys: SessionKeys, refused: Callable[[str], None]
    ) -> None:
        self._controller, self._session_keys, self._refused = controller, session_keys, refused
        self._one_at_a_time = anyio.Lock()

    async def receive(self, request: web.Request) -> web.Response:
        """Handle one form."""
        try:
            form = await request.post()
        except (ValueError, web.HTTPRequestEntityTooLarge):
            self._refused("A file was too large, or no form.")
            return web.Response(status=413, text="That is too large, or no form; give files of up to 32 MB in all.")
        operator = self._session_keys.owner(str(form.get("key", "")))
        if operator is None:
            self._refused("A file came from a browser that is not known.")
            return web.Response(status=403, text="This page is not known any more; reload it.")
        sent = [each for each in form.getall("files", []) if isinstance(each, web.FileField)][: _MOST_FILES + 1]
        try:
            async with self._one_at_a_time:
                asked = await to_thread.run_sync(self._goal_request, operator, str(form.get("camera", "")), sent)
        except UsageError as error:
            return web.Response(text=str(error))
        if not self._controller.ask(asked):
            return web.Response(text="Not done; the messages say why.")
        return web.Response(text="Sent; the messages say what came of it.")

    def _goal_request(
        self, operator: str, camera: str, sent: Sequence[web.FileField]
    ) -> GoalRequest | PictureGoalRequest:
        """Request for the goal in the files. Raises UsageError where they are invalid."""
        # Two pictures of a camera may have one name, in folders of their own.
        files = {f"{index} {each.filename}": each.file.read() for index, each in enumerate(sent)}
        named, now_s = fresh_id("goal"), self._controller.now()
        if are_points(files):
            points = points_of(files)
            return GoalRequest(id=named, time_s=now_s, operator=operator, source="file", positions=points)
        color, depth = pictures_of(files)
        return PictureGoalRequest(id=named, time_s=now_s, operator=operator, camera=camera, color=color, depth=depth)
