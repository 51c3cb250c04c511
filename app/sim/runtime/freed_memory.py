"""Freed memory as the next call's: without, the C library hands large arrays back, and each call faults all pages in.

XLA allocates the scratch of a call, a grid above all, and frees it afterwards. The simulated water's is 48 MB in calls
of a hundredth of a second: mapping its pages took more time than the simulation did.
"""

import ctypes
from functools import cache

_TRIM_THRESHOLD, _MMAP_THRESHOLD = -1, -3
"""Parameters of glibc's `mallopt` (mallopt(3)): free memory at the heap's end, and size of an array, above which it is
handed back."""
_LARGEST_ARRAY_BYTES, _MOST_FREE_BYTES = 1 << 30, (1 << 31) - 1


@cache
def keep_freed_memory() -> bool:
    """True if this process keeps what it frees for its next arrays; False where its C library is not glibc, or refuses.

    One of the two limits alone would be worse than none: setting it turns off what glibc adapts by itself.
    """
    mallopt = getattr(ctypes.CDLL(None), "mallopt", None)
    if mallopt is None:
        return False
    return bool(mallopt(_MMAP_THRESHOLD, _LARGEST_ARRAY_BYTES) and mallopt(_TRIM_THRESHOLD, _MOST_FREE_BYTES))
