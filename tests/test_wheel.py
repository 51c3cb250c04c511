"""The wheel: everything that the program reads is in it, and what it installs pushes a rope."""

import json
import os
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent
PUSH_S = 1500


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The wheel, as `make wheel` builds it."""
    folder = tmp_path_factory.mktemp("dist")
    built = [sys.executable, "-m", "pip", "wheel", "--disable-pip-version-check", "--quiet", "--no-deps"]
    subprocess.run([*built, "--no-build-isolation", "--wheel-dir", str(folder), str(ROOT)], check=True)
    (found,) = folder.glob("dipac-*-py3-none-any.whl")
    return found


@pytest.mark.serial
def test_every_file_of_the_package_is_in_the_wheel(wheel: Path) -> None:
    files = {path for path in (ROOT / "app").rglob("*") if path.is_file() and "__pycache__" not in path.parts}
    with zipfile.ZipFile(wheel) as archive:
        names = set(archive.namelist())
    assert {str(path.relative_to(ROOT)) for path in files} == {name for name in names if name.startswith("app/")}
    assert not {name.split("/")[0] for name in names} - {"app", f"{wheel.name.split('-py3')[0]}.dist-info"}


@pytest.mark.slow
@pytest.mark.serial
def test_a_wheel_in_an_empty_environment_pushes_a_rope(wheel: Path, tmp_path: Path) -> None:
    # The libraries are those of the environment that runs the tests: they are 2.5 GB, and another test's matter.
    environment, work = tmp_path / "environment", tmp_path / "work"
    work.mkdir()
    subprocess.run([sys.executable, "-m", "venv", "--without-pip", str(environment)], check=True)
    pip = [sys.executable, "-m", "pip", "--python", str(environment), "install", "--quiet", "--no-deps", "--no-index"]
    subprocess.run([*pip, "--disable-pip-version-check", str(wheel)], check=True)
    (packages,) = environment.glob("lib/python*/site-packages")
    libraries = [path for path in sys.path if path.endswith("site-packages")]
    (packages / "libraries.pth").write_text("\n".join(libraries))
    clean = {key: value for key, value in os.environ.items() if key not in ("PYTHONPATH", "PYTHONHOME", "VIRTUAL_ENV")}

    def run(script: str, *arguments: str) -> str:
        command = [environment / "bin" / script, *arguments]
        ran = subprocess.run(command, cwd=work, env=clean, capture_output=True, text=True, timeout=PUSH_S, check=False)
        assert ran.returncode == 0, ran.stdout + ran.stderr
        return ran.stdout

    assert Path(run("python", "-c", "import app; print(app.__file__)").strip()).is_relative_to(environment)
    shown = run("dipac", "run", "rope_push", "--pushes", "1", "--port", "0", "--json", "outcome.json")
    outcome = json.loads((work / "outcome.json").read_text())
    assert outcome["failure"] is None, shown
    assert outcome["faults"] == []
    assert len(outcome["decision_s"]) == 1
    assert Path(work, outcome["recording"]).is_file()
