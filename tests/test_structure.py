"""The structure of the program holds: layers, sizes, one thing a file, nothing of one machine in the sources."""

import ast
import re
import subprocess
import sys
from collections import defaultdict
from collections.abc import Collection, Iterable, Iterator, Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import pytest

from app import tasks

ROOT = Path(__file__).parent.parent
MODULES = sorted(ROOT.glob("app/**/*.py"))
COMMANDS = sorted(file for file in ROOT.glob("app/commands/**/*.py") if not file.stem.startswith("_"))
BENCHES = sorted(ROOT.glob("bench/**/*.py"))
EXAMPLES = sorted(ROOT.glob("examples/*.py"))
TESTS = sorted(ROOT.glob("tests/**/*.py"))
MAX_LINES = 400
ROUNDABOUT = {"What", "Which", "Where", "Who", "Whether", "How", "When", "Of", "By"}
"""First words of docstrings that talk about a thing before they say what it is."""
MAX_MODULES = 15
ONE_FILE_EACH = {"app/commands", "app/rig/simulated/injected_effects", "app/sim/effects", "app/tasks"}
"""Folders that grow by a file with each command, effect or task."""
EFFECTS = ("app/discovery/sensor_actuator_errors", "app/rig/simulated/injected_effects", "app/sim/effects")
HOMONYMS = {"adhesion", "cohesion", "finger_friction", "permanent_set", "rest_curvature", "swirl"}
"""Effects that are called as a hook, a field of `RodPhysics` or a parameter, which others name."""
NAMES_EFFECTS = {
    "app/discovery/checks/direct_checks.py": {"camera_time_offset", "command_delay", "under_reach"},
    "app/jobs/jit_cache.py": {"tcp_offset"},
}
"""Modules that name effects with a reason, whatever other effects there are: three are what the direct checks measure,
and calibration estimates the offset of the tool."""
SHAPES = "app.core.geometry.shapes"
MATCHES_SHAPES = {
    "app/rig/simulated/cameras/appearance.py": {
        "Bowl",
        "Finger",
        "Gripper",
        "HeldBowl",
        "Mat",
        "Obstacle",
        "Paddle",
        "Rack",
    },
    "app/rig/simulated/kinds/beans.py": {"Paddle"},
    "app/rig/simulated/kinds/cloth.py": {"Gripper"},
    "app/rig/simulated/kinds/liquid.py": {"Bowl", "HeldBowl"},
    "app/rig/simulated/kinds/rope.py": {"Finger", "Obstacle"},
    "app/rig/simulated/worlds/cloth_world.py": {"Rack"},
    "app/rig/simulated/worlds/liquid_world.py": {"Bowl", "HeldBowl", "Mat", "Obstacle"},
    "app/tasks/elements/base.py": {"Finger"},
    "bench/table.py": {"Obstacle"},
}
"""Modules that ask for the type of a tool or fixture: they build simulated worlds or pictures of it, and a task says
which of its tools is a finger. The list gets shorter alone: geometry is a method of the shape."""
PARTICIPLE = re.compile(
    r"[a-z]+ed|begun|bent|bound|bought|built|caught|chosen|dealt|done|drawn|driven|felt|found|frozen|given|gone|grown"
    r"|heard|held|hidden|kept|known|laid|left|lent|lit|lost|made|meant|met|paid|said|seen|sent|shown|spoken|stood"
    r"|stolen|struck|taken|taught|thrown|told|torn|understood|withdrawn|won|worn|wound|woken|written"
)
NO_PARTICIPLES = {"embed", "exceed", "feed", "need", "proceed", "seed", "shed", "speed"}
PARTICIPLES = {
    "app/arm/control.py": {"commanded", "measured"},
    "app/arm/process_arm.py": {"held"},
    "app/cells/rehearsal.py": {"simulated"},
    "app/core/messages.py": {"chosen", "made"},
    "app/core/ports.py": {"held", "kept", "simulated"},
    "app/recording/exchange/calibration_file.py": {"kept"},
    "app/recording/exchange/npz_import.py": {"mapped"},
    "app/recording/library/label.py": {"written"},
    "app/recording/library/recording_index.py": {"said"},
    "app/recording/library/session_recorder.py": {"written"},
    "app/rig/simulated/rig.py": {"simulated"},
}
"""Public functions and methods that are called by a participle alone; the list gets shorter alone."""
MACHINE_SPECIFIC = re.compile(
    r"(?<![\w.])/(home|root|Users|work|opt|mnt)/\w"  # a folder of one machine
    r"|https?://[^/\s]*(pypi|pythonhosted|artifactory|nexus)[^/\s]*"  # a package registry
    r"|^--?(index-url|extra-index-url|find-links|i|f)\b",
    re.MULTILINE,
)


def name(file: Path) -> str:
    return str(file.relative_to(ROOT))


@dataclass(frozen=True, kw_only=True)
class Facts:
    """Facts of a file that the rules below ask for, so that it is parsed once."""

    lines: int
    docstring: str | None
    docstrings: dict[int, str]
    """Those below fields and constants included, by line."""
    classes: tuple[str, ...]
    """Public ones at the top of the module."""
    functions: frozenset[str]
    """Functions at the top of the module."""
    callables: frozenset[str]
    """Those, and the methods of classes."""
    strings: frozenset[str]
    imported: frozenset[str]
    """Names, and the last parts of the modules that they are from."""
    asked: frozenset[str]
    """Shapes whose type is asked for."""


@cache
def facts(file: Path) -> Facts:
    text = file.read_text(encoding="utf-8")
    module = ast.parse(text)
    nodes = list(ast.walk(module))
    values = ((node.lineno, node.value) for node in nodes if isinstance(node, ast.Expr))
    constants = ((line, value.value) for line, value in values if isinstance(value, ast.Constant))
    imports = [node for node in nodes if isinstance(node, ast.ImportFrom)]
    inside = [node.body for node in nodes if isinstance(node, ast.ClassDef)]
    shapes = {
        alias.asname or alias.name: alias.name
        for node in imports
        if node.module and node.module.startswith(SHAPES)
        for alias in node.names
    }
    asked = {node.id for each in asked_types(nodes) for node in ast.walk(each) if isinstance(node, ast.Name)}
    return Facts(
        lines=len(text.splitlines()),
        docstring=ast.get_docstring(module),
        docstrings={line: value for line, value in constants if isinstance(value, str)},
        classes=tuple(
            node.name for node in module.body if isinstance(node, ast.ClassDef) and not node.name.startswith("_")
        ),
        functions=frozenset(node.name for node in module.body if isinstance(node, ast.FunctionDef)),
        callables=frozenset(
            node.name
            for body in [module.body, *inside]
            for node in body
            if isinstance(node, (ast.FunctionDef, ast.AsyncFunctionDef))
        ),
        strings=frozenset(
            node.value for node in nodes if isinstance(node, ast.Constant) and isinstance(node.value, str)
        ),
        imported=frozenset(
            {node.module.split(".")[-1] for node in imports if node.module}
            | {alias.name for node in imports for alias in node.names}
        ),
        asked=frozenset(shapes[each] for each in asked & shapes.keys()),
    )


def asked_types(nodes: Iterable[ast.AST]) -> Iterator[ast.expr]:
    """Expressions that stand where code asks for a type: patterns, `isinstance`, comparisons and keys of tables."""
    for node in nodes:
        if isinstance(node, ast.MatchClass):
            yield node.cls
        elif isinstance(node, ast.Call) and isinstance(node.func, ast.Name):
            if node.func.id in {"isinstance", "issubclass"}:
                yield node.args[1]
        elif isinstance(node, ast.Compare):
            yield from node.comparators
        elif isinstance(node, ast.Dict):
            yield from (key for key in node.keys if key)


def differing(found: Mapping[Path, Collection[str]], known: Mapping[str, Collection[str]]) -> dict[str, object]:
    """Files in which something else is found than is known of them, with both."""
    names = {name(file): set(each) for file, each in found.items()}
    asked = sorted(names.keys() | known.keys())
    return {
        each: {"found": names.get(each, set()), "known": set(known.get(each, ()))}
        for each in asked
        if names.get(each, set()) != set(known.get(each, ()))
    }


@pytest.mark.serial
def test_imports_keep_to_the_layers():
    # A process of its own: in this one the linter would write to a stream that an earlier test has closed.
    linter = Path(sys.executable).with_name("lint-imports")
    linted = subprocess.run([linter, "--no-cache"], cwd=ROOT, capture_output=True, text=True, check=False)
    assert linted.returncode == 0, linted.stdout + linted.stderr


def test_a_module_says_what_it_is():
    silent = [name(file) for file in MODULES if not facts(file).docstring]
    assert not silent, "give these modules a docstring"


def test_a_docstring_begins_with_what_the_thing_is():
    found = {
        f"{name(file)}:{line}": text
        for file in [*MODULES, *BENCHES, *EXAMPLES, *TESTS]
        for line, text in facts(file).docstrings.items()
        if re.split(r"\W", text.strip(), maxsplit=1)[0] in ROUNDABOUT
    }
    assert not found, "say what the thing is, or does, in the first words"


def test_a_module_is_short_enough_to_be_read():
    long = {name(file): facts(file).lines for file in MODULES if facts(file).lines > MAX_LINES}
    assert not long, "split them by what they do"


def test_a_folder_is_small_enough_to_be_known():
    folders = defaultdict[str, int](int)
    for file in MODULES:
        folders[name(file.parent)] += file.stem != "__init__"
    crowded = {each: count for each, count in folders.items() if count > MAX_MODULES and each not in ONE_FILE_EACH}
    assert not crowded, "give these modules rooms, by what they do"


def test_a_public_class_name_is_defined_once():
    files = defaultdict[str, list[str]](list)
    for file in MODULES:
        for each in facts(file).classes:
            files[each].append(name(file))
    several = {key: where for key, where in files.items() if len(where) > 1}
    assert not several, "give the less central of them a more specific name, in the field's words"


def is_participle(word: str) -> bool:
    """True for a single word that is a participle, as far as its ending or the list of irregular ones tells."""
    return word not in NO_PARTICIPLES and PARTICIPLE.fullmatch(word) is not None


def test_functions_and_methods_are_verbs_or_nouns_of_what_they_return():
    found = {file: {each for each in facts(file).callables if is_participle(each)} for file in MODULES}
    assert not differing(found, PARTICIPLES), "name it by what it does, or by what it returns"


@pytest.mark.parametrize("file", [file for file in MODULES if file.is_relative_to(ROOT / "app/session")], ids=name)
def test_the_session_has_its_time_from_its_clock(file):
    nodes = list(ast.walk(ast.parse(file.read_text(encoding="utf-8"))))
    called = {node.attr for node in nodes if isinstance(node, ast.Attribute)}
    timed = [node for node in nodes if isinstance(node, ast.ImportFrom)]
    imported = {alias.name for node in timed if node.module in ("anyio", "asyncio", "time") for alias in node.names}
    given = {node.arg for node in nodes if isinstance(node, ast.keyword)}
    owned = {"sleep_until", "move_on_at", "fail_after", "fail_at", "current_time", "deadline", "monotonic", "wait_for"}
    assert not owned & (called | imported | given), "ask the clock"
    assert not {"sleep", "move_on_after", "time"} & imported, "ask the clock"
    calls = (node.func for node in nodes if isinstance(node, ast.Call))
    asked = [ast.unparse(call) for call in calls if isinstance(call, ast.Attribute)]
    assert not {"anyio.sleep", "anyio.move_on_after", "time.time", "time.sleep"} & set(asked), "ask the clock"


def test_an_effect_is_named_in_its_own_files_alone():
    files = {each.stem for folder in EFFECTS for each in ROOT.glob(f"{folder}/*.py")}
    effects = files - {"__init__", "base"} - HOMONYMS
    others = [file for file in MODULES if name(file.parent) not in EFFECTS]
    found = {file: (facts(file).strings | facts(file).imported) & effects for file in others}
    assert not differing(found, NAMES_EFFECTS), "say it in the effect's own file"


def test_the_type_of_a_tool_or_fixture_is_asked_by_builders_alone():
    found = {file: facts(file).asked for file in [*MODULES, *BENCHES, *EXAMPLES]}
    assert not differing(found, MATCHES_SHAPES), "make it a method of the shape, and ask the object"


@pytest.mark.parametrize("file", COMMANDS, ids=name)
def test_a_command_file_defines_the_function_of_its_name_alone(file):
    functions = facts(file).functions
    assert file.stem in functions
    assert {key for key in functions if not key.startswith("_")} == {file.stem}


def test_every_task_file_defines_a_task_named_as_the_file():
    assert "rope_push" in tasks.names()
    for task in tasks.names():
        assert tasks.load(task).name == task


@pytest.mark.serial
def test_no_tracked_file_names_a_machine_s_folder_or_a_package_registry():
    listed = subprocess.run(["git", "ls-files", "-z"], cwd=ROOT, capture_output=True, text=True)
    if listed.returncode != 0:
        pytest.skip("not a git checkout")
    files = [ROOT / entry for entry in listed.stdout.split("\0") if entry]
    found = []
    for file in files:
        if file == Path(__file__) or not file.is_file():
            continue
        content = file.read_bytes()
        if b"\0" in content:
            continue
        text = content.decode("utf-8")
        found += [f"{name(file)}: {match.group().strip()}" for match in MACHINE_SPECIFIC.finditer(text)]
    assert not found
