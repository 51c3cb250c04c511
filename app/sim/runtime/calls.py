"""Warp functions as JAX calls whose compiled programs are found again, by the next call and by other processes.

Warp names the target of a call by how many functions of the same name there were before it, and numbers how often the
call was traced. Both are part of the program: outside of `jax.jit` each call would be compiled anew, and a process
that makes its simulators in another order would find nothing of what was kept on disk. Here a target is named by what
it is made for and by the shapes of its arguments, and is traced once for these. Two of one name that differ in what
a name cannot tell, as functions of the same name do, are numbered.
"""

import re
from collections import Counter
from collections.abc import Callable, Hashable, Mapping
from functools import cache, partial
from hashlib import sha256
from types import FunctionType
from typing import Any, Protocol

import jax
import warp as wp

Dims = tuple[tuple[str, tuple[int, ...]], ...]
"""Names of outputs and their shapes."""
_ADDRESS = re.compile(r" at 0x[0-9a-f]+")
"""Address of a function in a `repr`: another one in every process."""


class WarpCall(Protocol):
    """A Warp function within a JAX program."""

    def __call__(
        self, *arrays: jax.Array, numbers: tuple[int, ...] = (), output_dims: Mapping[str, tuple[int, ...]]
    ) -> list[jax.Array]:
        """All outputs. `numbers` follow the arrays in the function's arguments, and are known when it is traced."""
        ...


_calls: dict[tuple[str, Hashable], WarpCall] = {}
_alike: Counter[str] = Counter()
"""Calls in `_calls` by the words that tell them apart in a name."""


def make_warp_call(function: Callable[..., None], made_for: Hashable, num_outputs: int) -> WarpCall:
    """The call of a function of Warp arrays, then numbers, then `num_outputs` arrays that it writes.

    `made_for`: all that the function has besides its arguments. Functions that are defined at one place and made for
    equal things are the same.
    """
    key = f"{function.__module__}.{function.__qualname__}", made_for
    if key not in _calls:
        words = _ADDRESS.sub("", repr(key))
        _calls[key] = _warp_call(function, f"{words}, {_alike[words]}", num_outputs)
        _alike[words] += 1
    return _calls[key]


def _warp_call(function: Callable[..., None], words: str, num_outputs: int) -> WarpCall:
    assert isinstance(function, FunctionType)

    @cache
    def target(*signature: Any) -> Callable[..., Any]:
        digest = sha256(repr((words, *signature)).encode()).hexdigest()[:16]
        return wp.jax_callable(_rename(function, f"{function.__name__}_{digest}"), num_outputs=num_outputs)

    # Inlined, a program is what it would be without: only the trace is kept.
    @partial(jax.jit, static_argnames=("numbers", "dims"), inline=True)
    def traced(*arrays: jax.Array, numbers: tuple[int, ...], dims: Dims) -> list[jax.Array]:
        run = target(*((array.shape, str(array.dtype)) for array in arrays), numbers, dims)
        return list(run(*arrays, *numbers, output_dims=dict(dims)))

    def call(
        *arrays: jax.Array, numbers: tuple[int, ...] = (), output_dims: Mapping[str, tuple[int, ...]]
    ) -> list[jax.Array]:
        return traced(*arrays, numbers=numbers, dims=tuple(sorted(output_dims.items())))

    return call


def _rename(function: FunctionType, name: str) -> FunctionType:
    """The same function by another name."""
    copy = FunctionType(
        function.__code__, function.__globals__, function.__name__, function.__defaults__, function.__closure__
    )
    copy.__annotations__, copy.__module__, copy.__qualname__ = function.__annotations__, function.__module__, name
    return copy
