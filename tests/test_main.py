"""The command line: finds the commands, imports the chosen one alone, and says every error in one line."""

import os
import subprocess
import sys

import anyio
import pytest

from app import __version__
from app.__main__ import COMMANDS, command_names, exit_code_of, main
from app.core.errors import DeviceError, DipacError, RecordingError, UsageError


def raising(error: BaseException):
    def action() -> None:
        raise error

    return action


def test_the_overview_names_every_command_with_its_docstring(capsys):
    assert main([]) == 0
    overview = capsys.readouterr().out
    assert main(["--help"]) == 0
    assert capsys.readouterr().out == overview
    places = [*COMMANDS.glob("*.py"), *(file.parent for file in COMMANDS.glob("*/__init__.py"))]
    files = {place.stem for place in places if not place.stem.startswith("_")}
    assert {name.replace("-", "_") for name in command_names()} == {file.rstrip("_") for file in files}
    for name in command_names():
        line = next(line for line in overview.splitlines() if line.split()[:1] == [name])
        assert len(line.split()) > 2


def test_a_folder_of_commands_has_an_overview_of_its_own(capsys):
    assert main(["recordings"]) == 0
    overview = capsys.readouterr().out
    assert overview.startswith("usage: dipac recordings COMMAND")
    for name in command_names(COMMANDS / "recordings"):
        line = next(line for line in overview.splitlines() if line.split()[:1] == [name])
        assert len(line.split()) > 2
    assert main(["recordings", "lst"]) == UsageError.exit_code
    assert "Did you mean 'list'?" in capsys.readouterr().err


@pytest.mark.serial
def test_the_overview_imports_no_command_and_nothing_heavy():
    program = "import sys, app.__main__ as m; m.main(['--help']); print(sorted(sys.modules), file=sys.stderr)"
    result = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    loaded = result.stderr
    assert "'app.core.errors'" in loaded
    for heavy in ("app.commands", "jax", "numpy", "warp", "mujoco", "open3d", "viser", "tyro", "rich"):
        assert f"'{heavy}'" not in loaded


def test_the_version_is_that_of_the_package(capsys):
    assert main(["--version"]) == 0
    assert capsys.readouterr().out == f"dipac {__version__}\n"


def test_an_unknown_command_names_the_nearest_and_exits_as_a_usage_error(capsys):
    assert main(["docter"]) == UsageError.exit_code
    said = capsys.readouterr().err
    assert said.startswith("dipac: Unknown command 'docter'. Did you mean 'doctor'? Known: ")
    assert said.count("\n") == 1


def test_a_command_says_its_options(capsys):
    with pytest.raises(SystemExit) as stopped:
        main(["doctor", "--help"])
    assert stopped.value.code == 0
    said = capsys.readouterr().out
    assert "dipac doctor" in said
    assert "--json" in said


def test_an_unknown_option_is_a_usage_error(capsys):
    with pytest.raises(SystemExit) as stopped:
        main(["doctor", "--no-such-option"])
    assert stopped.value.code == UsageError.exit_code
    assert "no-such-option" in capsys.readouterr().err


def test_an_error_is_one_line_with_its_own_exit_code(capsys):
    assert exit_code_of(raising(RecordingError("a.mcap is cut off\nat byte 17."))) == RecordingError.exit_code
    captured = capsys.readouterr()
    assert captured.err == "dipac: a.mcap is cut off at byte 17.\n"
    assert captured.out == ""


def test_a_long_error_is_not_wrapped_and_brackets_are_not_markup(capsys):
    text = "[red]left[/red] " + "very " * 60 + "long"
    exit_code_of(raising(DeviceError(text)))
    assert capsys.readouterr().err == f"dipac: {text}\n"


def test_errors_of_concurrent_tasks_are_said_one_a_line(capsys):
    async def fail() -> None:
        raise DeviceError("camera left: no frame in 5 s")

    async def side_by_side() -> None:
        async with anyio.create_task_group() as tasks:
            tasks.start_soon(fail)

    assert exit_code_of(lambda: anyio.run(side_by_side)) == DeviceError.exit_code
    assert capsys.readouterr().err == "dipac: camera left: no frame in 5 s\n"


def test_ctrl_c_is_one_line_and_exit_code_130(capsys):
    assert exit_code_of(raising(KeyboardInterrupt())) == 130
    assert exit_code_of(raising(BaseExceptionGroup("tasks", [DeviceError("gone"), KeyboardInterrupt()]))) == 130
    assert capsys.readouterr().err == "dipac: interrupted\ndipac: interrupted\n"


def test_a_defect_keeps_its_traceback():
    with pytest.raises(ZeroDivisionError):
        exit_code_of(raising(ZeroDivisionError()))
    with pytest.raises(ExceptionGroup):
        exit_code_of(raising(ExceptionGroup("tasks", [DeviceError("gone"), ZeroDivisionError()])))


def test_success_is_zero_and_silent(capsys):
    assert exit_code_of(lambda: None) == 0
    assert capsys.readouterr() == ("", "")


def test_a_library_that_is_not_installed_is_said_in_one_line_with_what_mends_it(capsys):
    assert exit_code_of(raising(ModuleNotFoundError("No module named 'viser'", name="viser"))) == DipacError.exit_code
    said = capsys.readouterr().err
    assert said.count("\n") == 1
    assert "viser" in said
    assert "make clean setup" in said


def test_a_module_of_the_programs_own_that_is_missing_is_a_defect():
    with pytest.raises(ModuleNotFoundError):
        exit_code_of(raising(ModuleNotFoundError("No module named 'app.none'", name="app.none")))


@pytest.mark.serial
@pytest.mark.parametrize("home", ["/proc/none", "/proc"], ids=["missing", "read-only"])
def test_a_home_that_cannot_be_written_to_is_said_in_one_line_and_the_command_goes_on(home, tmp_path):
    temporary = tmp_path / "temporary"
    temporary.mkdir()
    environment = {key: value for key, value in os.environ.items() if not key.startswith(("XDG_", "JAX_"))}
    environment |= {"HOME": home, "TMPDIR": str(temporary)}
    program = "import sys; from app.__main__ import main; sys.exit(main(['replay', 'none.mcap']))"
    result = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, check=False, env=environment
    )
    first, second = result.stderr.splitlines()
    assert "XDG_CACHE_HOME" in first
    assert "none.mcap" in second
    assert list(temporary.iterdir()) == []
