"""Objects as files: what is written is read back, and what nothing reads is refused with what to write instead."""

import json
from dataclasses import replace
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from app.core.colours import ColourRange
from app.core.errors import ParameterError, RecordingError, UsageError
from app.core.geometry.object_description import KEY, SIZES, SIZES_OF, ObjectDescription, recorded_object
from app.core.messages import Parameter
from app.recording.exchange.object_file import load_object, save_object

FRICTION = Parameter(name="table_friction", value=0.3, unit="1", low=0.2, high=0.5)
WHOLE = ObjectDescription(
    kind="rope",
    name="climbing cord",
    sizes={"length_m": 0.32, "radius_m": 0.005, "mass_kg": 0.03},
    colour=(0.1, 0.5, 0.2),
    colours=ColourRange.of((350.0, 20.0), (0.4, 1.0), (0.1, 0.9)),
    priors=(FRICTION,),
)
TEXT = """
kind = "rope"
name = "climbing cord"
colour = "#1a8033"
length_m = 0.32
radius_m = 0.005
mass_kg = 0.03
[colours]
hue_deg = [350, 20]
saturation = [0.4, 1.0]
value = [0.1, 0.9]
[priors.table_friction]
value = 0.3
low = 0.2
high = 0.5
"""


def read(folder: Path, text: str) -> ObjectDescription:
    path = folder / "object.toml"
    path.write_text(text)
    return load_object(path)


def test_what_is_written_is_read_back_and_so_is_what_a_recording_says(tmp_path: Path) -> None:
    for description in (WHOLE, ObjectDescription(), replace(WHOLE, colours=None), replace(WHOLE, priors=(), name="")):
        save_object(tmp_path / "object.toml", description)
        assert load_object(tmp_path / "object.toml") == description
        assert recorded_object(json.dumps({KEY: description.as_json})) == description
    assert recorded_object(json.dumps({"options": {"object": "a.toml"}})) is None
    assert recorded_object("none") is None
    with pytest.raises(RecordingError, match="object"):
        recorded_object(json.dumps({KEY: {"kind": "stone"}}))


def test_a_file_by_hand_is_read(tmp_path: Path) -> None:
    found = read(tmp_path, TEXT)
    assert (found.kind, found.name, found.sizes) == ("rope", "climbing cord", WHOLE.sizes)
    assert found.colour == pytest.approx((0.102, 0.502, 0.2), abs=1e-3)
    assert found.colours == WHOLE.colours
    assert found.priors == (replace(FRICTION, unit=""),)


@given(st.data())
def test_every_kind_within_its_ranges_is_read_back(
    tmp_path_factory: pytest.TempPathFactory, data: st.DataObject
) -> None:
    kind = data.draw(st.sampled_from(list(SIZES_OF)))
    sizes = {name: data.draw(st.floats(*limits)) for name, limits in SIZES_OF[kind].items() if data.draw(st.booleans())}
    path = tmp_path_factory.mktemp("object") / "object.toml"
    save_object(path, ObjectDescription(kind=kind, sizes=sizes))
    assert load_object(path).sizes == sizes


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ('"rope"', '"ropes"', "Did you mean 'rope'"),
        ('"rope"', "1", "no kind of object"),
        ("length_m = 0.32", "lenght_m = 0.32", "Did you mean 'length_m'"),
        ("length_m = 0.32", "length_mm = 320", "write length_m = 0.32"),
        ("length_m = 0.32", "length_cm = 32", "write length_m = 0.32"),
        ("mass_kg = 0.03", "mass_g = 30", "write mass_kg = 0.03"),
        ("length_m = 0.32", "length_mm = 'long'", "write length_m"),
        ("length_m = 0.32", f"length_mm = 1{400 * '0'}", "no finite number"),
        ("length_m = 0.32", "length_mm = nan", "no finite number"),
        ("length_m = 0.32", "length_m = nan", "no finite number"),
        ("length_m = 0.32", "length_m = '0.32'", "no number"),
        ("length_m = 0.32", "count = 40", "not known"),
        ('"climbing cord"', "3", "no word"),
        ('"#1a8033"', '"green"', "no colour"),
        ('"#1a8033"', "[26, 128, 51]", "not from 0 to 1"),
        ('"#1a8033"', "[0.1, 0.5]", "red, green and blue"),
        ("hue_deg", "hue", "Did you mean 'hue_deg'"),
        ("value = [0.1, 0.9]", "", "lacks 'value'"),
        ("[0.4, 1.0]", "0.4", "lower and its upper bound"),
        ("low = 0.2", "low = 0.6", "not below high"),
        ("value = 0.3", "value = 0.6", "outside of its own interval"),
        ("low = 0.2", "", "lacks 'low'"),
        ("low = 0.2", "lo = 0.2", "Did you mean 'low'"),
        ("[priors.table_friction]", "[priors]", "no table"),
        ("[colours]", "[[colours]]", "no table"),
    ],
)
def test_what_says_nothing_or_something_else_than_is_meant_is_refused(
    old: str, new: str, said: str, tmp_path: Path
) -> None:
    assert old in TEXT
    with pytest.raises(UsageError, match=said) as refused:
        read(tmp_path, TEXT.replace(old, new, 1))
    assert "\n" not in str(refused.value)
    assert "object.toml" in str(refused.value)


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("length_m = 0.32", "length_m = 320", "millimetres. Then write length_m = 0.32"),
        ("length_m = 0.32", "length_m = 32", "centimetres. Then write length_m = 0.32"),
        ("mass_kg = 0.03", "mass_kg = 30", "grams. Then write mass_kg = 0.03"),
        ("length_m = 0.32", "length_m = -1", "outside its range"),
        ("[0.4, 1.0]", "[0.9, 0.4]", "saturation_high"),
    ],
)
def test_numbers_out_of_their_ranges_are_refused_with_the_likeliest_unit(
    old: str, new: str, said: str, tmp_path: Path
) -> None:
    with pytest.raises(ParameterError, match=said.replace(". ", r".? ")):
        read(tmp_path, TEXT.replace(old, new, 1))


def test_an_object_as_grey_as_a_table_needs_the_colours_that_cameras_find_it_by(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="nearly grey"):
        read(tmp_path, 'kind = "rope"\ncolour = "#808080"\n')
    assert read(tmp_path, TEXT.replace("#1a8033", "#808080")).seen_colours == WHOLE.colours


def test_a_file_of_sizes_alone_is_of_any_kind(tmp_path: Path) -> None:
    assert read(tmp_path, "count = 40\n").kind is None
    with pytest.raises(UsageError, match="Known"):
        read(tmp_path, "x = 1\n")
    assert set(SIZES) <= {name for sizes in SIZES_OF.values() for name in sizes}


def test_a_place_that_cannot_be_written_is_said(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="another place"):
        save_object(tmp_path / "none" / "object.toml", WHOLE)


@pytest.mark.parametrize("name", [f"{300 * 'a'}.toml", "a/../../none/object.toml"])
def test_a_name_that_no_file_can_have_is_said(name: str, tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="another place"):
        save_object(tmp_path / name, WHOLE)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (
            'kind = "rope"\nlength_m = 5.0\n',
            "out of its range is there, and stays: .*object.toml: length_m = 5 is outside its range",
        ),
        ("x = 1\n", "cannot be read as the file of an object; choose another name"),
    ],
)
def test_of_a_file_that_is_there_and_stays_the_truth_is_said(text: str, said: str, tmp_path: Path) -> None:
    path = tmp_path / "object.toml"
    path.write_text(text)
    with pytest.raises(UsageError, match=said):
        save_object(path, WHOLE)
    assert path.read_text() == text
