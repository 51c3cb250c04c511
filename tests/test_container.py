"""The image and the development container are of files that are there, and nobody is root in them."""

import json
import shlex
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent
DOCKERFILE = ROOT / "Dockerfile"
CONTAINER = ROOT / ".devcontainer" / "devcontainer.json"


def instructions() -> list[list[str]]:
    """The instructions of the Dockerfile, a list of words each."""
    lines = (line for line in DOCKERFILE.read_text().splitlines() if not line.startswith("#"))
    joined = "\n".join(lines).replace("\\\n", " ")
    return [shlex.split(line) for line in joined.splitlines() if line.strip()]


def stages() -> dict[str, list[list[str]]]:
    """Instructions of each stage with those that it goes on from, by its name."""
    found = dict[str, list[list[str]]]()
    for words in instructions():
        if words[0] == "FROM":
            base, name = words[1], words[3]
            found[name] = list(found.get(base, [["FROM", base]]))
        else:
            found[name].append(words)
    return found


@pytest.mark.parametrize("stage", ["program", "development"])
def test_nobody_is_root(stage: str) -> None:
    users = [words[1] for words in stages()[stage] if words[0] == "USER"]
    assert users[-1:] == ["dipac"]
    assert any("useradd" in words and "dipac" in words for words in stages()[stage] if words[0] == "RUN")


def test_the_program_is_the_last_stage_which_is_built_where_none_is_named() -> None:
    assert list(stages())[-1] == "program"


def test_all_that_is_copied_is_there_and_not_left_out() -> None:
    kept = [line[1:] for line in (ROOT / ".dockerignore").read_text().splitlines() if line.startswith("!")]
    sources = {
        source
        for words in instructions()
        if words[0] == "COPY"
        for source in [word for word in words[1:] if not word.startswith("--")][:-1]
    }
    for source in sources:
        assert (ROOT / source).exists()
        assert Path(source).parts[0] in kept, f"{source} is not in the build's context"
    assert {Path(source).parts[0] for source in sources} == set(kept)


def test_the_development_container_is_a_stage_of_the_same_file() -> None:
    told = json.loads(CONTAINER.read_text())
    build = told["build"]
    assert (CONTAINER.parent / build["dockerfile"]).resolve() == DOCKERFILE
    assert (CONTAINER.parent / build["context"]).resolve() == ROOT
    assert build["target"] in stages()
    assert told["remoteUser"] == "dipac"
    target = told["postCreateCommand"].removeprefix("make ")
    assert f"\n{target}:" in (ROOT / "Makefile").read_text()
