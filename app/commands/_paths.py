"""Paths on the command line, and options that may be left out."""

from dataclasses import replace
from pathlib import Path
from types import NoneType, UnionType
from typing import Any, Final, Literal, Union, get_args

from tyro.constructors import ConstructorRegistry, PrimitiveConstructorSpec, PrimitiveTypeInfo

REGISTRY: Final = ConstructorRegistry()
"""Constructors of options that tyro has not, or has otherwise."""


@REGISTRY.primitive_rule
def path_rule(info: PrimitiveTypeInfo) -> PrimitiveConstructorSpec[Path] | None:
    """Constructor of paths: an empty one, which tyro takes for the working directory, is an error."""
    if info.type is not Path:
        return None
    return PrimitiveConstructorSpec(
        nargs=1,
        metavar="PATH",
        instance_from_str=_path,
        is_instance=lambda given: isinstance(given, Path),
        str_from_instance=lambda path: [str(path)],
    )


@REGISTRY.primitive_rule
def optional_rule(info: PrimitiveTypeInfo) -> PrimitiveConstructorSpec[Any] | None:
    """Constructor of `T | None`: that of T, whose help does not speak of Python's None."""
    kinds = get_args(info.type) if info.type_origin in (Union, UnionType) else ()
    if len(kinds) != 2 or NoneType not in kinds:
        return None
    kind = next(each for each in kinds if each is not NoneType)
    of_value = ConstructorRegistry.get_primitive_spec(PrimitiveTypeInfo.make(kind, info.markers))
    if not isinstance(of_value, PrimitiveConstructorSpec) or of_value.nargs != 1:
        return None

    def from_words(words: list[str]) -> Any:
        return None if words[0] in _NOTHING else of_value.instance_from_str(words)

    def to_words(given: Any) -> list[str]:
        return [_NOTHING[0]] if given is None else of_value.str_from_instance(given)

    def is_instance(given: Any) -> bool | Literal["~"]:
        return given is None or of_value.is_instance(given)

    return replace(of_value, instance_from_str=from_words, is_instance=is_instance, str_from_instance=to_words)


_NOTHING: Final = ("none", "None")


def _path(words: list[str]) -> Path:
    if not words[0]:
        raise ValueError("the path is empty; if a variable of the shell stands there, it is not set")
    try:
        return Path(words[0]).expanduser()  # A shell leaves the ~ in --option=~/FILE as it is.
    except RuntimeError:
        return Path(words[0])
