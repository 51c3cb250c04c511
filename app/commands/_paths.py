"""Paths on the command line."""

from pathlib import Path
from typing import Final

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


def _path(words: list[str]) -> Path:
    if not words[0]:
        raise ValueError("the path is empty; if a variable of the shell stands there, it is not set")
    try:
        return Path(words[0]).expanduser()  # A shell leaves the ~ in --option=~/FILE as it is.
    except RuntimeError:
        return Path(words[0])
