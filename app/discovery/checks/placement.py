"""Placement of data: a study is simulated about the object's mean position, and reported in its own frame.

Effects that have a place, and fields that are linear in it, are about the middle of the tasks' table. A table may lie
anywhere in the frame of its data: those are then moved so that their middle is there, and never turned, so that
directions are the data's. What is concluded is moved back.
"""

from dataclasses import replace
from typing import Final

import numpy as np
from jaxtyping import Float64

from app.core.geometry.track import Track
from app.core.types import Points
from app.discovery.dataset.model_under_test import Subject
from app.discovery.dataset.study import ProjectionView, Push, Study
from app.discovery.results.case import Case, Example, NextPush
from app.sim.effects.base import MIDDLE_M, REACH_M

_MARGIN_M: Final = 0.05
_DIGITS: Final = 2
"""Data are moved by whole centimetres."""

_Shift = Float64[np.ndarray, "3"]


def centre(study: Study, subject: Subject) -> Study:
    """The study, or where it is not within the tasks' table the same about its middle; `origin_m` says where it was."""
    low, high = _extent(study, subject)
    if np.all(np.abs(np.stack([low, high]) - MIDDLE_M) <= REACH_M):
        return study
    middle = np.concatenate([push.before.points[:, :2] for push in study.pushes]).mean(0, dtype=np.float64)
    x, y = (middle - MIDDLE_M).round(_DIGITS).tolist()
    at_x, at_y = study.origin_m
    return replace(_shift_study(study, np.array([-x, -y, 0.0])), origin_m=(at_x + x, at_y + y))


def reach_m(study: Study, subject: Subject) -> tuple[float, float]:
    """Bound on places, along x and y from the middle of the table [m]."""
    low, high = _extent(study, subject)
    needed = np.abs(np.stack([low, high]) - MIDDLE_M).max(0) + _MARGIN_M
    x, y = np.maximum(np.where(needed - _MARGIN_M > REACH_M, needed, 0.0), REACH_M).tolist()
    return x, y


def move_back(case: Case, origin_m: tuple[float, float]) -> Case:
    """The case with all that is drawn where it was; values and words are there already (`Catalogue.origin_m`)."""
    if origin_m == (0.0, 0.0):
        return case
    shift = np.array([*origin_m, 0.0])
    flat = shift[:2].astype(np.float32)
    return replace(
        case,
        arrows=replace(case.arrows, places=case.arrows.places + flat),
        examples=tuple(_example(it, shift) for it in case.examples),
        next_push=None if case.next_push is None else _next_push(case.next_push, shift),
    )


def _extent(study: Study, subject: Subject) -> tuple[Float64[np.ndarray, "2"], Float64[np.ndarray, "2"]]:
    """The box that holds object and tool, while it is low."""
    parts = list[np.ndarray]()
    for push in study.pushes:
        parts += [push.before.points[:, :2], push.after.points[:, :2]]
        parts.append(push.track.positions[push.track.poses[:, 2] < subject.low_m, :2])
    every = np.concatenate(parts)
    return every.min(0).astype(np.float64), every.max(0).astype(np.float64)


def _shift_study(study: Study, shift: _Shift) -> Study:
    unknown = study.setup is not None and study.setup.camera_m is None  # Above the middle, as nobody knows better.
    x, y, z = (np.array(study.camera) + (0.0 if unknown else shift)).tolist()
    return replace(
        study,
        pushes=tuple(_push(push, shift) for push in study.pushes),
        tables={number: _cloud(table, shift) for number, table in study.tables.items()},
        camera=(x, y, z),
    )


def _push(push: Push, shift: _Shift) -> Push:
    return replace(
        push,
        before=_view(push.before, shift),
        during=tuple(_view(view, shift) for view in push.during),
        after=_view(push.after, shift),
        command=_track(push.command, shift),
        measured=None if push.measured is None else _track(push.measured, shift),
    )


def _view(view: ProjectionView, shift: _Shift) -> ProjectionView:
    finger = None if view.finger is None else _cloud(view.finger, shift)
    return replace(view, points=_cloud(view.points, shift), finger=finger)


def _cloud(points: Points, shift: _Shift) -> Points:
    return (points + shift).astype(np.float32)


def _track(track: Track, shift: _Shift) -> Track:
    return track.with_positions(track.positions + shift)


def _example(it: Example, shift: _Shift) -> Example:
    return replace(
        it,
        before=_cloud(it.before, shift),
        observed=_cloud(it.observed, shift),
        nominal=_cloud(it.nominal, shift),
        extended=_cloud(it.extended, shift),
        tool=it.tool + shift,
    )


def _next_push(it: NextPush, shift: _Shift) -> NextPush:
    return replace(
        it,
        track=_track(it.track, shift),
        before=_cloud(it.before, shift),
        ends=tuple(_cloud(end, shift) for end in it.ends),
    )
