"""Trial of code in a process of its own, which a native library may take down."""

import json
import signal
import subprocess
import sys
from dataclasses import dataclass
from typing import Any, Final, final

_TIMEOUT_S: Final = 120.0
"""Generous: importing JAX or Open3D from a cold disk takes tens of seconds."""


@final
@dataclass(frozen=True, kw_only=True)
class ProbeResult:
    """Result of a probe, or the reason of its failure; `was_killed`: by a signal, or because its time was over."""

    said: Any = None
    failure: str = ""
    was_killed: bool = False


def probe(code: str) -> ProbeResult:
    """Run `code`, in which `say(value)` reports a value that JSON can carry."""
    program = f"import json\ndef say(value): print('\\n' + json.dumps(value))\n{code}"
    try:
        result = subprocess.run(  # noqa: S603 - the program is its caller's
            [sys.executable, "-c", program], capture_output=True, text=True, timeout=_TIMEOUT_S
        )
    except subprocess.TimeoutExpired:
        return ProbeResult(failure=f"no answer in {_TIMEOUT_S:.0f} s", was_killed=True)
    if result.returncode < 0:
        return ProbeResult(failure=f"crashed with {signal.Signals(-result.returncode).name}", was_killed=True)
    if result.returncode > 0:
        return ProbeResult(failure=(result.stderr.strip().splitlines() or ["failed without a word"])[-1])
    last = (result.stdout.strip().splitlines() or ["null"])[-1]
    return ProbeResult(said=json.loads(last) if "say(" in code else None)
