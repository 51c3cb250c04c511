"""The run-time check of declared shapes and types.

jaxtyping's import hook decorates whatever is defined in a module of `app`. Its own decorator binds a signature and
checks all arguments twice a call; `checked` stands in for it, does the same once, and opens a scope for the names of
axes only where there are axes.
"""

import dataclasses
import functools
import inspect
from collections.abc import Callable, Sequence
from types import FunctionType
from typing import Any, get_args, get_type_hints

import jaxtyping
from beartype import BeartypeConf, beartype
from beartype.door import is_bearable
from beartype.roar import BeartypeException
from jaxtyping import AbstractArray, TypeCheckError

_scope = jaxtyping.jaxtyped
_beartype = beartype(conf=BeartypeConf(violation_type=TypeCheckError))


def check_calls(modules: Sequence[str]) -> None:
    """Check every call into these modules, which are to be imported afterwards, against declared shapes and types."""
    # The hook writes `@jaxtyping.jaxtyped(typechecker=...)` above every function and class.
    jaxtyping.jaxtyped = lambda typechecker: typechecker
    jaxtyping.install_import_hook(modules, f"{checked.__module__}.{checked.__name__}")


def checked(item: Any) -> Any:
    """A function, method or dataclass with arguments and results checked by beartype, as far as they can be checked.

    Left unchecked: `Self`, which beartype knows only where it decorates a whole class, names that exist for type
    checkers alone, and Protocols that are not checkable at run time.
    """
    if isinstance(item, classmethod | staticmethod):
        return type(item)(checked(item.__func__))
    if isinstance(item, property):
        return property(*(call and checked(call) for call in (item.fget, item.fset, item.fdel)))
    if inspect.isclass(item) and dataclasses.is_dataclass(item):
        item.__init__ = checked(item.__init__)
    if not isinstance(item, FunctionType):
        return item

    # Compiled at the first call, as most of what is imported is never called.
    @functools.cache
    def compiled() -> Callable[..., Any]:
        return _compiled(item)

    @functools.wraps(item)
    def checking(*args: Any, **kwargs: Any) -> Any:
        return compiled()(*args, **kwargs)

    return checking


def _compiled(function: FunctionType) -> Callable[..., Any]:
    hints = {name: _resolved(hint, function) for name, hint in function.__annotations__.items()}
    try:
        call = _beartype(_annotated(function, hints))
    except BeartypeException:
        hints = {name: hint if _checkable(hint) else Any for name, hint in hints.items()}
        call = _beartype(_annotated(function, hints))
    if not any(map(_has_axes, hints.values())):
        return call

    def within_scope(*args: Any, **kwargs: Any) -> Any:
        with _scope("context"):
            return call(*args, **kwargs)

    return within_scope


def _annotated(function: FunctionType, hints: dict[str, Any]) -> FunctionType:
    """A copy of the function with these hints; the program reads its own."""
    copy = FunctionType(
        function.__code__, function.__globals__, function.__name__, function.__defaults__, function.__closure__
    )
    copy.__kwdefaults__, copy.__annotations__ = function.__kwdefaults__, hints
    copy.__module__, copy.__qualname__ = function.__module__, function.__qualname__
    return copy


def _resolved(hint: Any, function: FunctionType) -> Any:
    """The hint without forward references; Any where its names exist for type checkers alone."""

    def bearer(value: Any) -> None: ...

    bearer.__annotations__ = {"value": hint}
    try:
        return get_type_hints(bearer, function.__globals__, include_extras=True)["value"]
    except (NameError, AttributeError, TypeError):
        return Any


def _has_axes(hint: Any) -> bool:
    return (inspect.isclass(hint) and issubclass(hint, AbstractArray)) or any(map(_has_axes, get_args(hint)))


def _checkable(hint: Any) -> bool:
    try:
        is_bearable(None, hint)
    except BeartypeException:
        return False
    return True
