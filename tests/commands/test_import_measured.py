"""Imported ropes are simulated as the data say: object, tool, table and place."""

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from app.commands.import_ import import_
from app.core.errors import RecordingError
from app.core.geometry.shapes.tools import Finger
from app.discovery.checks.limits import limits_of
from app.discovery.checks.placement import centre, reach_m
from app.discovery.dataset.model_under_test import Catalogue, Subject, catalogue
from app.discovery.dataset.study import Study
from app.discovery.residuals.direct_measurements import direct_rows, row_of
from app.discovery.residuals.displacement_field import Basis, register
from app.discovery.residuals.predict import Predictor
from app.discovery.residuals.sensitivity import Step
from app.discovery.residuals.simulation_batch import SimulationBatch, prepare
from app.discovery.results.verdict import estimates_of
from app.jobs.discovery_subject import subject_of
from app.services.study import read_study
from app.tasks import load
from tests.discovery.exact import exact_model
from tests.measured_data import Place, measured_arrays, recorded, said
from tests.plain_data import saved

THIN, THICK = 1, 0
"""Seeds: ropes of 4.3 and 7.1 mm radius."""
PLACES = {
    "at home": Place(),
    "at the origin": Place(at_m=(0.0, 0.0, 0.0)),
    "far away": Place(at_m=(3.0, -1.5, 0.0)),
    "high and tilted": Place(at_m=(0.2, 0.1, 0.4), tilt_deg=1.0),
}


def imported(folder: Path, arrays: dict[str, Any], name: str = "measured") -> Study:
    path = folder / f"{name}.mcap"
    import_(saved(folder, arrays), output=path)
    return read_study([path])


def ready(study: Study) -> tuple[Predictor, SimulationBatch, Subject]:
    """Predictor, trials and model under test, as at the start of a discovery."""
    subject = subject_of(load(f"{study.task}@rods"), study.setup)
    here = centre(study, subject)
    known = catalogue(subject.rods, origin_m=here.origin_m, reach_m=reach_m(here, subject))
    return Predictor(subject, known), prepare(here, subject), subject


def errors_mm(study: Study) -> np.ndarray:
    """Errors of the nominal model by pushes: residuals of the cloud after each."""
    predictor, trials, subject = ready(study)
    after = predictor(trials, [predictor.catalogue.nominal(subject)]).after[0]
    fields = [
        register(predicted, observed, Basis.along(predicted, labels[:, 0]))
        for predicted, observed, labels in zip(after, trials.observed.after, trials.labels, strict=True)
    ]
    return 1e3 * np.linalg.norm(fields, axis=1)


def changes_m(study: Study, values: Mapping[str, float]) -> np.ndarray:
    """Shift of the object's middle after each push by a model with these values against the nominal one."""
    predictor, trials, subject = ready(study)
    nominal = predictor.catalogue.nominal(subject)
    theta = nominal.copy()
    for name, value in values.items():
        theta[predictor.catalogue.column(name)] = value
    after = predictor(trials, [nominal, theta]).after
    return (after[1] - after[0])[:, :, :2].mean(1).astype(np.float64)


@pytest.mark.parametrize("seed", [THIN, THICK])
@pytest.mark.parametrize("place", [*PLACES, "turned"])
def test_sizes_and_table_are_found_wherever_the_table_lies(seed: int, place: str, tmp_path: Path) -> None:
    task, study = recorded(seed)
    where = PLACES.get(place, Place(at_m=(0.0, 0.0, 0.0), turn_deg=100.0))
    setup = imported(tmp_path, measured_arrays(study, task.finger, place=where)).setup
    assert setup is not None
    sizes = {size.name: size for size in setup.sizes}
    assert sizes["length_m"].value == pytest.approx(task.rope.length_m, abs=3 * sizes["length_m"].sd)
    assert sizes["radius_m"].value == pytest.approx(task.rope.radius_m, rel=0.05)
    assert sizes["finger_radius_m"].value == pytest.approx(task.finger.radius_m, abs=3e-4)
    assert {setup.source(name) for name in ("length_m", "radius_m", "finger_radius_m")} == {"data"}
    assert setup.source("mass_kg") == "task"
    assert setup.table.height_m == pytest.approx(where.at_m[2], abs=1e-3)
    assert setup.table.tilt_deg == pytest.approx(where.tilt_deg, abs=0.1)
    assert setup.table.taken_out == (where.at_m[2] > 0)


def test_a_model_errs_alike_wherever_the_table_lies(tmp_path: Path) -> None:
    task, study = recorded(THICK)
    found = {
        name: errors_mm(imported(tmp_path, measured_arrays(study, task.finger, place=place, about=said(task)), str(n)))
        for n, (name, place) in enumerate(PLACES.items())
    }
    for errors in found.values():
        np.testing.assert_allclose(errors, found["at home"], atol=0.1)


def test_a_model_errs_alike_however_the_table_is_turned(tmp_path: Path) -> None:
    task, study = recorded(THICK)
    turned = Place(at_m=(0.0, 0.0, 0.0), turn_deg=100.0)
    home, there = (
        errors_mm(imported(tmp_path, measured_arrays(study, task.finger, place=place, about=said(task)), str(n)))
        for n, place in enumerate((Place(), turned))
    )
    np.testing.assert_allclose(there, home, atol=1.0)


@pytest.mark.parametrize(
    ("x", "y", "size"),
    [("tilt_x", "tilt_y", 2.0), ("draught_x", "draught_y", 0.3), ("friction_slope_x", "friction_slope_y", 2.0)],
)
def test_directions_are_those_of_the_datas_frame(x: str, y: str, size: float, tmp_path: Path) -> None:
    task, study = recorded(THICK)
    turned = Place(at_m=(-2.0, 1.0, 0.0), turn_deg=100.0)
    c, s = np.cos(np.radians(100.0)), np.sin(np.radians(100.0))
    home = changes_m(
        imported(tmp_path, measured_arrays(study, task.finger, about=said(task), place=PLACES["far away"]), "home"),
        {x: size},
    )
    there = changes_m(
        imported(tmp_path, measured_arrays(study, task.finger, about=said(task), place=turned), "there"),
        {x: size * c, y: size * s},
    )
    back = there @ np.array([[c, -s], [s, c]])
    assert np.corrcoef(home.ravel(), back.ravel())[0, 1] > 0.9
    assert np.linalg.norm(back) == pytest.approx(np.linalg.norm(home), rel=0.25)


def test_places_are_told_where_they_are_in_the_data(tmp_path: Path) -> None:
    task, study = recorded(THICK)
    found = imported(tmp_path, measured_arrays(study, task.finger, about=said(task), place=PLACES["far away"]))
    predictor, trials, subject = ready(found)
    known = predictor.catalogue
    middle = np.concatenate([view.points for push in found.pushes for view in (push.before,)]).mean(0)
    here = np.concatenate([push.before.points for push in trials.study.pushes]).mean(0)
    np.testing.assert_allclose(here[:2] + known.origin_m, middle[:2], atol=1e-5)
    model = exact_model(subject, known, ("point_attraction",), {"attraction_x": 0.6, "attraction_y": 0.1})
    told = {
        it.name: it
        for it in estimates_of(known, subject, replace(model, steps=placed_steps(known), own=2), "point_attraction")
    }
    assert told["attraction_x"].value == pytest.approx(0.6 + known.origin_m[0])
    assert told["attraction_y"].null == pytest.approx(0.0 + known.origin_m[1])
    assert (
        f"from ({0.55 + known.origin_m[0]:g}, {known.origin_m[1]:g}) m"
        in known.specs[known.column("friction_slope_x")].about
    )


def placed_steps(known: Catalogue) -> tuple[Step, ...]:
    """A step along each axis of where something attracts."""
    columns = known.cause("point_attraction").columns[1:]
    return tuple(Step(cause="point_attraction", column=column, size=0.01, sides=2) for column in columns)


def test_what_about_says_is_simulated_and_what_it_leaves_out_has_a_wider_prior(tmp_path: Path) -> None:
    task, study = recorded(THIN)
    told = imported(tmp_path, measured_arrays(study, task.finger, about=said(task)), "told")
    untold = imported(tmp_path, measured_arrays(study, task.finger), "untold")
    (_, _, known), (_, _, unknown) = ready(told), ready(untold)
    assert (known.length_m, known.mass_kg) == pytest.approx((task.rope.length_m, task.rope.mass_kg), rel=1e-4)
    assert not known.unsaid & {"length_m", "radius_m", "mass_kg", "finger_radius_m"}
    assert unknown.unsaid >= {"length_m", "radius_m", "mass_kg", "finger_radius_m"}
    assert known.rods is not None
    assert unknown.rods is not None
    narrow, wide = (dict(rods.unknowns)["rope_mass"].step for rods in (known.rods, unknown.rods))
    assert wide == pytest.approx(3 * narrow)


def test_one_side_of_a_finger_is_no_offset_of_it(tmp_path: Path) -> None:
    task, study = recorded(THICK)
    predictor, trials, subject = ready(imported(tmp_path, measured_arrays(study, task.finger)))
    rows = direct_rows(predictor, trials, predictor.catalogue.nominal(subject), [])
    finger = rows.r[:, row_of("finger")]
    seen = rows.known[:, row_of("finger")]
    assert seen[:, :2].all()
    assert not seen[:, 2].any()  # How low the tip is faces away.
    assert np.abs(finger[:, :2].mean(0)).max() < 6e-4
    assert task.finger.radius_m > 5e-3  # The mean of what is seen would be 4 mm beside.


def test_a_flat_gripper_is_found_with_its_width_and_yaw(tmp_path: Path) -> None:
    _, study = recorded(THICK)
    flat = Finger(radius_m=0.006, push_height_m=0.006, half_width_m=0.0125, yaw_rad=0.4)
    level = replace(study, pushes=tuple(replace(p, command=_unturned(p.command), measured=None) for p in study.pushes))
    found = load(imported(tmp_path, measured_arrays(level, flat)).task).finger
    assert found.radius_m == pytest.approx(flat.radius_m, abs=5e-4)
    assert found.half_width_m + found.radius_m == pytest.approx(0.0185, abs=2e-3)
    assert found.yaw_rad == pytest.approx(flat.yaw_rad, abs=0.05)


def test_a_box_in_about_is_turned_as_the_poses_are(tmp_path: Path) -> None:
    task, study = recorded(THICK)
    level = replace(study, pushes=tuple(replace(p, command=_unturned(p.command), measured=None) for p in study.pushes))
    about = {"tool": {"shape": "box", "half_m": [0.005, 0.02]}}
    arrays = measured_arrays(level, task.finger, about=about, place=Place(turn_deg=30.0))
    del arrays["tool_points"], arrays["tool_offsets"]
    finger = load(imported(tmp_path, arrays).task).finger
    assert (finger.radius_m, finger.half_width_m) == pytest.approx((0.005, 0.015))
    assert finger.yaw_rad == pytest.approx(np.radians(30.0 - 90.0), abs=1e-4)


def _unturned(track: Any) -> Any:
    """A tool that points down and is never turned."""
    return replace(
        track, poses=np.concatenate([track.poses[:, :3], np.tile([0.0, 1.0, 0.0, 0.0], (len(track.poses), 1))], 1)
    )


def fatal(study: Study) -> list[str]:
    subject = subject_of(load(f"{study.task}@rods"), study.setup)
    return [limit.text for limit in limits_of(study, subject) if limit.fatal]


def test_clouds_in_the_cameras_frame_are_refused(tmp_path: Path) -> None:
    task, study = recorded(THICK)
    arrays = measured_arrays(study, task.finger, table=False)
    arrays["cloud_points"] = arrays["cloud_points"] * np.array([1, -1, -1], np.float32) + np.array(
        [0, 0, 0.9], np.float32
    )
    with pytest.raises(RecordingError, match="camera's frame"):
        imported(tmp_path, arrays)
    steep = measured_arrays(study, task.finger, place=Place(tilt_deg=50.0))
    with pytest.raises(RecordingError, match="tilted by 50 degrees"):
        imported(tmp_path, steep)
    assert [path.suffix for path in tmp_path.iterdir()] == [".npz"]


def test_a_bowed_table_carries_no_name(tmp_path: Path) -> None:
    task, study = recorded(THICK)
    arrays = measured_arrays(study, task.finger)
    points = arrays["table_points"]
    points[:, 2] += 0.5 * (points[:, 0] - 0.55) ** 2
    found = imported(tmp_path, arrays)
    assert any(text.startswith("The table is not flat") for text in fatal(found))


@pytest.mark.parametrize(
    ("about", "said_so"),
    [
        ({"object": {"length_m": 1.5}}, "what is simulated truly is from 0.18 to 0.8"),
        ({"tool": {"shape": "sphere"}}, "known are cylinder, box"),
        ({"tool": {"half_m": [0.01]}}, "give half of its sides"),
        ({"camera_m": [0.5, 0.9]}, "give x, y, z in metres"),
    ],
)
def test_what_nobody_simulates_is_refused(about: Mapping[str, Any], said_so: str, tmp_path: Path) -> None:
    task, study = recorded(THICK)
    with pytest.raises(RecordingError, match=said_so):
        imported(tmp_path, measured_arrays(study, task.finger, about=about))


def test_sizes_that_the_data_contradict_carry_no_name(tmp_path: Path) -> None:
    task, study = recorded(THICK)
    about = {"object": {"length_m": 1.6 * task.rope.length_m}}
    assert any(
        "About says that the object is" in text
        for text in fatal(imported(tmp_path, measured_arrays(study, task.finger, about=about)))
    )


def test_a_copy_of_an_episode_is_noticed(tmp_path: Path) -> None:
    task, study = recorded(THICK)
    paths = list[Path]()
    for name in ("one", "copy"):
        imported(tmp_path, measured_arrays(study, task.finger, about=said(task)), name)
        paths.append(tmp_path / f"{name}.mcap")
    assert "Episodes 1 and 3 hold the same motion." in fatal(read_study(paths))


def cut(view: Any) -> Any:
    """The view of an object of which a third is missing."""
    kept = view.points[np.argsort(np.linalg.norm(view.points - view.points[0], axis=1))[: 2 * len(view.points) // 3]]
    return replace(view, points=np.concatenate([kept, kept[: len(view.points) - len(kept)]]))


def test_an_object_that_seems_shorter_after_most_pushes_of_an_episode_is_no_other_one(tmp_path: Path) -> None:
    task, study = recorded(THICK)
    found = imported(tmp_path, measured_arrays(study, task.finger, about=said(task)))
    number = found.pushes[-1].episode
    own = [push for push in found.pushes if push.episode == number]
    short = {id(view) for push in own for view in (push.before, push.after)} - {id(own[0].before)}
    pushes = tuple(
        replace(p, **{name: cut(view) for name in ("before", "after") if id(view := getattr(p, name)) in short})
        for p in found.pushes
    )
    assert not any("long in episode" in text for text in fatal(replace(found, pushes=pushes)))


def test_an_object_that_is_another_one_in_an_episode_is_noticed(tmp_path: Path) -> None:
    task, study = recorded(THICK)
    found = imported(tmp_path, measured_arrays(study, task.finger, about=said(task)))
    assert not fatal(found)
    pushes = tuple(replace(p, before=cut(p.before), after=cut(p.after)) if p.episode else p for p in found.pushes)
    assert any("long in episode" in text for text in fatal(replace(found, pushes=pushes)))


def test_pushes_that_never_came_near_are_counted(tmp_path: Path) -> None:
    task, study = recorded(THICK)
    found = imported(tmp_path, measured_arrays(study, task.finger, about=said(task)))
    away = np.array([1.0, 0.0, 0.0])
    first = replace(
        found.pushes[0],
        command=found.pushes[0].command.with_positions(found.pushes[0].command.positions + away),
        measured=None,
    )
    some = replace(found, pushes=(first, *found.pushes[1:]))
    subject = subject_of(load(f"{found.task}@rods"), found.setup)
    assert "The tool came near the object in 5 of 6 pushes." in {limit.text for limit in limits_of(some, subject)}


def test_the_head_of_a_report_says_who_says_what(tmp_path: Path) -> None:
    task, study = recorded(THIN)
    about = {"object": {"mass_kg": 0.03}}
    setup = imported(tmp_path, measured_arrays(study, task.finger, about=about, place=PLACES["high and tilted"])).setup
    assert setup is not None
    of_object, of_tool, of_table = setup.words
    assert "from the data, known to" in of_object
    assert "30 g (from about)" in of_object
    assert of_tool.startswith("Tool: round, of 9.6 mm radius (from the data")
    assert of_table.startswith("Table: it was 0.400 m high and tilted by 1.0 degrees in the data (from its points)")
