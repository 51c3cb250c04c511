"""Methods of tasks as one program each: outside of `jax.jit`, each of their operations would be compiled apart."""

from collections.abc import Callable
from functools import cache
from typing import Any

import jax


@cache
def program(method: Callable[..., Any]) -> Callable[..., Any]:
    """The method, compiled as a whole for each shape of its arguments."""
    return jax.jit(method)
