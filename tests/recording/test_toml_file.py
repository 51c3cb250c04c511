"""Files written by hand: what says nothing, or something else than is meant, is refused with the likeliest mistake."""

import re
from pathlib import Path

import pytest

from app.cells.cell_file import load_cell
from app.cells.gen3 import calibration_of
from app.core.errors import DipacError, ParameterError, RecordingError
from app.jobs.worker_api import check_model, nominal_model
from app.recording.exchange.calibration_file import load_lens
from app.recording.exchange.model_file import load_model, save_model
from app.recording.exchange.object_file import load_object

CELL = """
schema = 1
name = "bench 1"
[arm]
host = "192.168.1.10"
[limits]
workspace = { low = [0.30, -0.25, 0.02], high = [0.55, 0.25, 0.25] }
[[cameras]]
name = "left"
serial = "012345678901"
[[cameras]]
name = "right"
serial = "012345678902"
"""
CAMERA = """
serial = "f1"
[intrinsics]
width = 640
height = 480
fx = 605.0
fy = 603.0
cx = 319.5
cy = 239.5
distortion = [0.1, 0.2, 0.3, 0.4, 0.5]
"""
OBJECT = """
length_m = 0.32
kind = "rope"
colour = "#2a7a3a"
[priors.table_friction]
value = 0.3
low = 0.2
high = 0.5
"""
READERS = {
    "cell": (CELL, load_cell),
    "camera": (CAMERA, load_lens),
    "sizes": ("length_m = 0.3\n", load_object),
    "object": (OBJECT, load_object),
    "model": (None, lambda path: load_model(path, task="rope_push", time_s=0.0)),
}


@pytest.fixture(scope="module")
def model_text(tmp_path_factory: pytest.TempPathFactory) -> str:
    path = tmp_path_factory.mktemp("model") / "model.toml"
    save_model(path, nominal_model("rope_push"))
    return path.read_text()


@pytest.mark.parametrize("kind", READERS)
@pytest.mark.parametrize("encoding", ["utf-8-sig", "utf-16", "latin-1"])
def test_every_reader_takes_a_byte_order_mark_and_names_other_encodings(
    kind: str, encoding: str, model_text: str, tmp_path: Path
) -> None:
    text, read = READERS[kind]
    path = tmp_path / "a.toml"
    path.write_bytes(f"# \u00fc\n{text or model_text}".encode(encoding))
    if encoding == "utf-8-sig":
        assert read(path)
        return
    with pytest.raises(DipacError, match=r"UTF-8") as refused:
        read(path)
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize("kind", ["cell", "camera"])
def test_a_serial_number_without_quotes_is_told_to_get_them(kind: str, tmp_path: Path) -> None:
    text, read = READERS[kind]
    path = tmp_path / "a.toml"
    path.write_text(re.sub(r'serial = "\w+"', "serial = 012345678901", text, count=1))
    with pytest.raises(RecordingError, match="put the value of 'serial' in quotes"):
        read(path)


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("[parameters.stiffness]", "[aparatus.x]\nvalue = 1\n[parameters.stiffness]", "Did you mean 'apparatus'"),
        ('unit = "Pa"', 'unit = "Pa"\nlo = 1', "Did you mean 'low'"),
        ("\nlow = ", "\nlow = 9e9 #", "above high"),
        ("\nhigh = ", "\nhigh = nan #", "no finite number"),
        ("\nvalue = ", "\nvalue = true #", "no number"),
        ("version = 0", "version = inf", "no whole number"),
        ("version = 0", "version = 1.9", "no whole number"),
        ("version = 0", f"version = {10**400}", "model"),
        ("transition_count = 0", "transition_count = -1", "no whole number"),
    ],
)
def test_a_model_that_says_nothing_or_no_number_is_refused(
    old: str, new: str, said: str, model_text: str, tmp_path: Path
) -> None:
    assert old in model_text
    path = tmp_path / "model.toml"
    path.write_text(model_text.replace(old, new, 1))
    with pytest.raises(RecordingError, match=said):
        load_model(path, task="rope_push", time_s=0.0)


EXTENSION = """
[extension]
effects = []
camera_m = [0, 0, 1]
estimated = ["stiffness"]
covariance = [[1.0]]
[extension.recordings]
"""


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("effects = []", 'effects = "table_tilt"', "no list of strings"),
        ("[[1.0]]", "[[nan]]", "no finite number"),
        ("[0, 0, 1]", "[0, inf, 1]", "no finite number"),
        ("effects = []", "effects = []\nefects = []", "Did you mean 'effects'"),
    ],
)
def test_an_extension_of_something_else_is_refused(
    old: str, new: str, said: str, model_text: str, tmp_path: Path
) -> None:
    path = tmp_path / "model.toml"
    path.write_text(model_text + EXTENSION)
    check_model(load_model(path, task="rope_push", time_s=0.0))
    path.write_text(model_text + EXTENSION.replace(old, new))
    with pytest.raises(RecordingError, match=said):
        load_model(path, task="rope_push", time_s=0.0)


def test_units_and_effects_are_those_that_the_program_has(model_text: str, tmp_path: Path) -> None:
    path = tmp_path / "model.toml"
    path.write_text(model_text.replace('unit = "Pa"', 'unit = "kPa"', 1))
    with pytest.raises(ParameterError, match="'kPa'"):
        check_model(load_model(path, task="rope_push", time_s=0.0))
    path.write_text(model_text + EXTENSION.replace("effects = []", 'effects = ["table_tlt"]'))
    with pytest.raises(ParameterError, match="Did you mean 'table_tilt'"):
        check_model(load_model(path, task="rope_push", time_s=0.0))


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("", '[[keep_out]]\nname = "x"\nlow = [0.6, 0.2, 0]\nhigh = [0.7, 0.3, 0.4]\n', "belongs into .limits"),
        ("[limits]", "[limits]\nhost = 'a'", r"belongs into .arm"),
        ("[limits]", "[limits]\nspeed_ms = 0.1", "Did you mean 'speed_m_s'"),
        ("", '[[limits.keep_out]]\nname = "x"\nlow = [0, -1, 0]\nhigh = [1, 1, 1]\n', "fills all of the workspace"),
        ('"left"', '""', "camera"),
        ('"left"', '"../left"', "camera"),
        ('"left"', '"left\\n"', "camera"),
        ('"012345678901"', '""', "serial"),
        ("192.168.1.10", "http://192.168.1.10/", "without http"),
        ("192.168.1.10", "192.168.1.10:10000", "without http"),
        ("192.168.1.10", "", "address"),
        ("0.02]", "-0.30]", "below the table"),
    ],
)
def test_a_cell_in_which_something_else_is_meant_is_refused(old: str, new: str, said: str, tmp_path: Path) -> None:
    path = tmp_path / "cell.toml"
    path.write_text(CELL.replace(old, new, 1) if old else CELL + new)
    with pytest.raises(RecordingError, match=said):
        load_cell(path)


@pytest.mark.parametrize("host", ["192.168.1.10", "::1", "arm.local", "kinova"])
def test_addresses_and_names_of_an_arm_are_taken(host: str, tmp_path: Path) -> None:
    path = tmp_path / "cell.toml"
    path.write_text(CELL.replace("192.168.1.10", host))
    assert load_cell(path).arm.host == host


def test_a_calibration_may_lie_at_home(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "cell.toml"
    path.write_text(f'calibration = "~/calibration.toml"\n{CELL}')
    monkeypatch.setenv("HOME", "/somewhere")
    assert calibration_of(load_cell(path), path) == Path("/somewhere/calibration.toml")


@pytest.mark.parametrize(
    ("distortion", "read"),
    [([0.1, 0.2, 0.3, 0.4], (0.1, 0.2, 0.3, 0.4, 0.0)), ([0.1] * 5 + [0.0] * 3, (0.1,) * 5)],
)
def test_other_lengths_of_distortion_are_read_where_they_say_the_same(
    distortion: list[float], read: tuple[float, ...], tmp_path: Path
) -> None:
    path = tmp_path / "camera.toml"
    path.write_text(CAMERA.replace("[0.1, 0.2, 0.3, 0.4, 0.5]", str(distortion)))
    assert load_lens(path)[1].distortion == read


def test_a_rational_distortion_is_told_to_be_rectified(tmp_path: Path) -> None:
    path = tmp_path / "camera.toml"
    path.write_text(CAMERA.replace("0.5]", "0.5, 0.6, 0.7, 0.8]"))
    with pytest.raises(RecordingError, match="rectify"):
        load_lens(path)
    path.write_text(CAMERA.replace("width", "widht"))
    with pytest.raises(RecordingError, match="Did you mean 'width'"):
        load_lens(path)


@pytest.mark.parametrize("kind", READERS)
@pytest.mark.parametrize("number", ["1" + "0" * 400, "1" + "0" * 5000, "nan", "-inf", "true", "1e400"])
def test_absurd_numbers_are_refused_by_every_reader(kind: str, number: str, model_text: str, tmp_path: Path) -> None:
    text, read = READERS[kind]
    path = tmp_path / "a.toml"
    # The first number, and the last one.
    for pattern in (r"(?s)^(.*?= )[0-9.]+\n", r"(?s)^(.*= )[0-9.]+\n"):
        path.write_text(re.sub(pattern, rf"\g<1>{number}\n", text or model_text, count=1))
        with pytest.raises(DipacError) as refused:
            read(path)
        assert "\n" not in str(refused.value)
