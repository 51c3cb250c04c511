"""Rate limiter: a token bucket that fills up steadily. Pure; the caller owns the clock."""

from typing import final


@final
class RateLimiter:
    """Limit of `steady_hz` a second, with `burst` at once after a pause."""

    def __init__(self, now_s: float, *, steady_hz: float, burst: float) -> None:
        self._steady_hz, self._burst = steady_hz, burst
        self._left, self._last_s = burst, now_s

    def wait_s(self, now_s: float) -> float:
        """Count one; returns the time to wait before the next [s]."""
        self._fill(now_s)
        self._left -= 1.0
        return max(0.0, -self._left / self._steady_hz)

    def allows(self, now_s: float) -> bool:
        """True where one more is within the limit; it is then counted."""
        self._fill(now_s)
        allowed = self._left >= 1.0
        self._left -= float(allowed)
        return allowed

    def _fill(self, now_s: float) -> None:
        self._left = min(self._burst, self._left + (now_s - self._last_s) * self._steady_hz)
        self._last_s = now_s
