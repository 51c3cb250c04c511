"""A hand that holds a key in a browser: samples thirty times a second, from a thread as the console's are."""

import itertools
import json
import threading
import time
from typing import Final, Literal, TypeAlias, final

from app.teleop import Pilot

_PERIOD_S: Final = 0.033
_TURNS_S: Final = 1.0
"""Period after which it reverses."""
Does: TypeAlias = Literal["holds", "releases", "nothing", "babbles"]


@final
class Hand:
    """Tells the pilot what `operator`'s page would."""

    def __init__(self, pilot: Pilot, operator: str) -> None:
        self.pilot = pilot
        self._operator = operator
        self._does: Does = "nothing"
        self._pressed, self._samples = 0, itertools.count()
        threading.Thread(target=self._samples_for_ever, daemon=True).start()

    def hold(self) -> None:
        """A new press, which is held."""
        self._pressed += 1
        self._does = "holds"

    def release(self) -> None:
        """Release the key."""
        self._does = "releases"

    def vanish(self) -> None:
        """Say nothing more."""
        self._does = "nothing"

    def babble(self) -> None:
        """Say numbers that are none."""
        self._does = "babbles"

    def _samples_for_ever(self) -> None:
        while True:
            if self._does != "nothing":
                self.pilot.sample(self._operator, self._sample(), refused=None)
            time.sleep(_PERIOD_S)

    def _sample(self) -> bytes:
        toward = 1.0 if int(time.monotonic() / _TURNS_S) % 2 else -1.0
        told = {
            "axes": {"y": float("nan") if self._does == "babbles" else toward},
            "held": self._does != "releases",
            "pressed": self._pressed,
            "sequence": next(self._samples),
            "speed": 1.0,
        }
        return json.dumps(told).encode()
