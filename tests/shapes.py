"""The run-time check of declared shapes and types."""

from collections.abc import Callable
from typing import Any

from beartype import beartype
from beartype.roar import BeartypeDecorHintPep673Exception


def checked(function: Callable[..., Any]) -> Callable[..., Any]:
    """`function` with its arguments and result checked by beartype.

    A method that says `Self` stays unchecked: beartype resolves that only where it decorates the whole class, and
    jaxtyping's import hook decorates methods.
    """
    try:
        return beartype(function)
    except BeartypeDecorHintPep673Exception:
        return function
