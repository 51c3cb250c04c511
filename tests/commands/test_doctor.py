"""The doctor: looks at everything, tells what is required from what is optional, and names what mends it."""

import json
import os
import socket
import sys
from dataclasses import replace
from datetime import UTC, date, datetime
from importlib import metadata
from pathlib import Path

import pytest

from app.cells.cell_file import load_cell
from app.commands import _cell_checks, _checks
from app.commands.doctor import doctor
from app.config import Site
from app.core.errors import PreflightError
from app.core.system.probe import ProbeResult, probe
from app.recording.exchange.calibration_file import save_camera
from app.rig.kinova.client.link import Address
from app.rig.kinova.emulator.process import FakeProcess
from tests.cells.test_cell_file import GOOD, written
from tests.recording.test_calibration_file import camera


@pytest.fixture
def free_port() -> int:
    with socket.socket() as listening:
        listening.bind(("127.0.0.1", 0))
        return listening.getsockname()[1]


@pytest.mark.serial
def test_this_installation_is_whole_and_every_row_is_said_as_json(capsys, tmp_path, free_port):
    doctor(json=True, recordings=tmp_path, port=free_port)
    report = json.loads(capsys.readouterr().out)
    assert report["ok"] is True
    found = {row["what"]: row for row in report["findings"]}
    assert {row["state"] for row in found.values()} <= {"ok", "optional"}
    assert found["Python"]["found"] == ".".join(map(str, sys.version_info[:3]))
    assert found["numpy"]["found"] == metadata.version("numpy")
    assert "cpu" in found["Warp devices"]["found"]
    assert found["JAX devices"]["found"]
    assert found["pyrealsense2 loads"]["found"].startswith(f"SDK {metadata.version('pyrealsense2')[:4]}")
    assert found["Kinova client"]["found"].startswith("dipac")
    for loaded in ("open3d loads", "pyrealsense2 loads", "cv2 loads", "mujoco loads"):
        assert found[loaded]["state"] == "ok"
    for row in found.values():
        assert row["found"]
        assert bool(row["mend"]) == (row["state"] != "ok")


@pytest.mark.serial
def test_a_busy_port_is_missing(tmp_path):
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        (row,) = _checks._port(Site(recordings=tmp_path, console_port=taken.getsockname()[1]))
    assert row.state == "missing"
    assert "in use" in row.found
    assert "--port" in row.mend


def test_a_full_disk_is_missing_room(tmp_path):
    free = next(row for row in _checks._recordings(Site(recordings=tmp_path)) if row.what == "free disk")
    assert free.state == "ok"
    greedy = Site(recordings=tmp_path, min_free_bytes=2**62)
    full = next(row for row in _checks._recordings(greedy) if row.what == "free disk")
    assert full.state == "missing"
    assert full.mend


def test_a_folder_that_does_not_exist_yet_is_judged_by_its_parent(tmp_path):
    row = _checks._recordings(Site(recordings=tmp_path / "new" / "deeper"))[0]
    assert row.state == "ok"
    assert not (tmp_path / "new").exists()


def test_recordings_below_a_file_are_refused(tmp_path):
    (tmp_path / "file").touch()
    row = _checks._recordings(Site(recordings=tmp_path / "file" / "recordings"))[0]
    assert row.state == "missing"
    assert "--recordings" in row.mend


@pytest.mark.skipif(os.geteuid() == 0, reason="root may write anywhere")
def test_recordings_in_a_read_only_folder_are_refused(tmp_path):
    tmp_path.chmod(0o500)
    row = _checks._recordings(Site(recordings=tmp_path / "recordings"))[0]
    assert row.state == "missing"


def test_cameras_are_listed_with_the_speed_of_their_port() -> None:
    none, fast = _checks._cameras([], []), _checks._cameras(["D435 0123, USB 3.2"], [])
    slow = _checks._cameras(["D435 0123, USB 2.1"], ["D435 0123 is connected by USB 2.1"])
    assert (none.state, none.found) == ("optional", "0")
    assert (fast.state, fast.found, fast.mend) == ("ok", "1: D435 0123, USB 3.2", "")
    assert (slow.state, slow.mend) == ("optional", "D435 0123 is connected by USB 2.1")


def test_a_library_that_is_not_there_is_missing():
    row = _checks._library("no-such-library-of-dipac")
    assert (row.state, row.mend) == ("missing", "make setup")


def test_a_library_of_an_extra_is_optional():
    declared = metadata.requires("dipac") or []
    extras = [requirement for requirement in declared if "extra ==" in requirement]
    assert {_checks._library(requirement).state for requirement in extras} <= {"ok", "optional"}
    assert set(_checks.EXTRAS) == set(metadata.metadata("dipac").get_all("Provides-Extra") or [])
    row = _checks._library("no-such-library-of-dipac>=2; extra == 'ray'")
    assert row.state == "optional"
    assert ".[ray]" in row.mend


@pytest.mark.serial
def test_a_probe_reports_what_was_said_and_every_way_to_fail():
    assert probe("say({'devices': ['cpu']})").said == {"devices": ["cpu"]}
    assert "no_such_module" in probe("import no_such_module").failure
    assert probe("import os, signal; os.kill(os.getpid(), signal.SIGSEGV)").failure == "crashed with SIGSEGV"
    assert probe("raise SystemExit(3)").failure == "failed without a word"


def test_kernels_are_counted_by_folder(tmp_path: Path):
    assert _checks._kernels(tmp_path).state == "optional"
    for folder in ("wp_dipac_sim_1234", "wp_app.sim.kernels_5678", "wp_another_project_9"):
        (tmp_path / folder).mkdir()
        (tmp_path / folder / "module.o").write_bytes(b"x" * 1_000_000)
    row = _checks._kernels(tmp_path)
    assert row.state == "ok"
    assert "2 modules, 2.0 MB" in row.found


@pytest.mark.serial
def test_the_command_fails_where_something_required_is_missing(capsys, tmp_path):
    (tmp_path / "file").touch()
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        with pytest.raises(PreflightError, match="2 required: recordings, console port"):
            doctor(recordings=tmp_path / "file", port=taken.getsockname()[1])
    said = capsys.readouterr().out
    assert "missing" in said
    assert "--recordings" in said


@pytest.mark.serial
def test_a_cell_is_looked_at_with_what_mends_each_part(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    delivered = GOOD.replace("tip_m = 0.163", "tip_m = 0.12").replace("turn_deg = 90.0", "turn_deg = 0.0")
    file = written(tmp_path, delivered)
    save_camera(tmp_path / "calibration.toml", replace(camera("012345678901"), calibrated_at=datetime.now(UTC).date()))
    bus = {"connections": {"012345678902": ""}}
    monkeypatch.setattr(_cell_checks, "census", lambda: ProbeResult(said=bus))
    with FakeProcess() as arm:
        there = Address(host=arm.host, tcp_port=arm.ports[0], udp_port=arm.ports[1])
        monkeypatch.setattr(_cell_checks, "address", lambda _: there)
        found = preview(file)
        assert not arm.commands()
        arm.fail(joint=4, bits=1 << 5, lasting=True)
        assert "met too much torque" in preview(file)["arm"].mend
        held = preview(written(tmp_path, GOOD))
        assert "Set the tool" in held["arm"].mend
    assert {what: row.state for what, row in found.items()} == {
        "cell": "ok",
        "camera left": "missing",
        "camera right": "ok",
        "calibration of left": "ok",
        "calibration of right": "missing",
        "arm": "ok",
    }
    assert "7 joints" in found["arm"].found
    assert preview(file)["arm"].state == "missing"


def test_of_an_old_calibration_and_of_none_it_is_said_what_to_do_and_in_which_files(tmp_path: Path) -> None:
    file, kept = written(tmp_path, GOOD), tmp_path / "calibration.toml"
    save_camera(kept, replace(camera("012345678901"), calibrated_at=date(2026, 1, 1)))
    old, none = _cell_checks._calibrations(load_cell(file), file)
    assert (old.state, none.state) == ("optional", "missing")
    # What compares the lens alone does not say whether the camera still stands there.
    assert "calibration check" not in old.mend
    assert f"Check, in the tab Calibrate of `dipac console TASK --rig gen3 --cell {file}`, says whether" in old.mend
    for row in (old, none):
        assert f"`dipac calibration solve FOLDER -o {kept}`" in row.mend


def test_a_file_that_describes_no_cell_is_all_that_is_said_of_one(tmp_path: Path) -> None:
    (row,) = preview(written(tmp_path, GOOD.replace("[limits]", "[limit]"))).values()
    assert (row.what, row.state) == ("cell", "missing")
    assert "Did you mean 'limits'?" in row.mend


def preview(file: Path) -> dict[str, _checks.CheckResult]:
    return {row.what: row for check in _cell_checks.cell_checks(file) for row in check()}
