"""A file is replaced at once, through links, and as it was where that fails."""

import subprocess
import sys
from contextlib import suppress
from pathlib import Path

import pytest

from app.core.system.disk import path_beside, replacement


def replace(path: Path, text: str) -> None:
    with replacement(path) as new:
        new.write_text(text)


def test_the_file_behind_a_link_is_written_and_the_link_stays(tmp_path: Path) -> None:
    (tmp_path / "shared").mkdir()
    real, link = tmp_path / "shared" / "real", tmp_path / "link"
    real.write_text("old")
    real.chmod(0o640)
    link.symlink_to("shared/real")
    replace(link, "new")
    assert link.is_symlink()
    assert real.read_text() == "new"
    assert real.stat().st_mode & 0o777 == 0o640
    assert list(tmp_path.rglob(".*")) == []


def test_a_link_without_a_file_gets_one_and_a_circle_is_an_error(tmp_path: Path) -> None:
    link = tmp_path / "link"
    link.symlink_to("elsewhere")
    replace(link, "new")
    assert (tmp_path / "elsewhere").read_text() == link.read_text() == "new"
    link.unlink()
    link.symlink_to("link")
    with pytest.raises(OSError, match="Too many levels"):
        replace(link, "new")


def test_an_error_leaves_the_old_file_alone(tmp_path: Path) -> None:
    path = tmp_path / "a"
    path.write_text("old")
    with suppress(ValueError), replacement(path) as new:
        new.write_text("half")
        raise ValueError
    assert path.read_text() == "old"
    assert list(tmp_path.iterdir()) == [path]


@pytest.mark.parametrize("letter", ["a", "\N{LATIN SMALL LETTER U WITH DIAERESIS}", "\N{SNOWMAN}"])
def test_the_longest_names_are_replaced_too(letter: str, tmp_path: Path) -> None:
    path = tmp_path / (letter * (250 // len(letter.encode())) + ".toml")
    replace(path, "new")
    replace(path, "newer")
    assert path.read_text() == "newer"
    assert len(path_beside(path, ".unfinished").name.encode()) < 255


@pytest.mark.serial
def test_a_device_gets_the_content_and_stays_what_it_is() -> None:
    program = (
        "import sys\nfrom pathlib import Path\nfrom app.core.system.disk import replacement\n"
        "with replacement(Path('/dev/stdout')) as new:\n    new.write_text('content')\n"
    )
    found = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert found.stdout == "content"
    replace(Path("/dev/null"), "content")
    assert Path("/dev/null").is_char_device()
