"""The run-time check of declared shapes and types."""

from collections.abc import Callable
from typing import Any

from beartype import beartype
from beartype.door import is_bearable
from beartype.roar import BeartypeException


def checked(function: Callable[..., Any]) -> Callable[..., Any]:
    """`function` with its arguments and result checked by beartype, as far as they can be checked.

    Left unchecked: `Self`, which beartype knows only where it decorates a whole class (jaxtyping's import hook
    decorates methods), names that exist for type checkers alone, and Protocols that are not checkable at run time.
    """
    try:
        return beartype(function)
    except BeartypeException:
        # This is a stand-in that jaxtyping made for checking, not the program's own function.
        hints = function.__annotations__
        function.__annotations__ = {name: hint if _checkable(hint) else Any for name, hint in hints.items()}
        return beartype(function)


def _checkable(hint: Any) -> bool:
    try:
        is_bearable(None, hint)
    except BeartypeException:
        return False
    return True
