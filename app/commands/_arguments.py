"""Arguments without a name that several commands take, as `--help` calls them."""

from pathlib import Path
from typing import Annotated, TypeAlias

import tyro

TaskArgument: TypeAlias = Annotated[
    tyro.conf.Positional[str],
    tyro.conf.arg(metavar="TASK", help="such as rope_push or bean_sweep; an unknown one is answered with all names"),
]
FileArgument: TypeAlias = Annotated[tyro.conf.Positional[Path], tyro.conf.arg(metavar="FILE")]
FolderArgument: TypeAlias = Annotated[tyro.conf.Positional[Path], tyro.conf.arg(metavar="FOLDER")]
Files: TypeAlias = Annotated[
    tyro.conf.Positional[tuple[Path, ...]], tyro.conf.arg(metavar="FILE ...", help_behavior_hint="")
]
Places: TypeAlias = Annotated[tyro.conf.Positional[tuple[Path, ...]], tyro.conf.arg(metavar="PLACE ...")]
"""Files, or folders that are searched."""
