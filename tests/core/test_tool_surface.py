"""A tool's size and middle are found from whichever side it is seen."""

import numpy as np
import pytest

from app.core.geometry.tool_surface import ToolView, fit_tool, middle_of

NOISE_M = 1e-3


def views(radius_m: float, seen_rad: float, beside_m: tuple[float, float] = (0.0, 0.0)) -> list[ToolView]:
    """Twelve of a round tool elsewhere each time, from one side."""
    rng, made = np.random.default_rng(0), list[ToolView]()
    for _ in range(12):
        tip, angle = np.array([*rng.uniform(-3, 3, 2), 0.006]), rng.uniform(0, seen_rad, 80)
        side = np.column_stack([radius_m * np.cos(angle), radius_m * np.sin(angle), rng.uniform(0.01, 0.04, 80)])
        points = tip + side + [*beside_m, 0.0] + rng.normal(0, NOISE_M, (80, 3))
        made.append(ToolView(points=points.astype(np.float32), tip=tip))
    return made


@pytest.mark.parametrize("radius_m", [0.005, 0.009, 0.012])
@pytest.mark.parametrize("seen_rad", [2 * np.pi, np.pi, 2 * np.pi / 3])
def test_the_radius_is_found_from_a_third_of_the_circle(radius_m: float, seen_rad: float) -> None:
    found = fit_tool(views(radius_m, seen_rad))
    assert found is not None
    assert not found.flat
    assert found.radius_m == pytest.approx(radius_m, abs=4e-4)


@pytest.mark.parametrize("seen_rad", [2 * np.pi, np.pi])
def test_the_middle_is_found_and_not_the_mean_of_what_is_seen(seen_rad: float) -> None:
    beside = (0.003, -0.002)
    seen = views(0.009, seen_rad, beside)
    middles = [found - view.tip[:2] for view in seen if (found := middle_of(view, 0.009)) is not None]
    assert len(middles) == len(seen)
    assert np.mean(middles, 0) == pytest.approx(beside, abs=5e-4)
    fit = fit_tool(seen)
    assert fit is not None
    assert fit.beside_m == pytest.approx(beside, abs=7e-4)


@pytest.mark.parametrize("flat", [None, False, True])
def test_points_about_the_tip_are_no_surface(flat: bool | None) -> None:
    rng = np.random.default_rng(0)
    points = rng.normal(0, NOISE_M, (60, 3)).astype(np.float32)
    assert fit_tool([ToolView(points=points, tip=np.zeros(3))] * 6, flat=flat) is None


def test_one_face_alone_does_not_say_how_thick_a_tool_is() -> None:
    rng = np.random.default_rng(0)
    face = np.column_stack([rng.uniform(-0.02, 0.02, 80), np.full(80, -0.006), rng.uniform(0.01, 0.04, 80)])
    seen = [
        ToolView(points=(face + rng.normal(0, NOISE_M, face.shape)).astype(np.float32), tip=np.zeros(3))
        for _ in range(10)
    ]
    found = fit_tool(seen)
    assert found is None or found.radius_m is None


def test_too_few_points_say_nothing() -> None:
    few = ToolView(points=np.zeros((3, 3), np.float32), tip=np.zeros(3))
    assert fit_tool([few]) is None
    assert fit_tool([]) is None
    assert middle_of(few, 0.009) is None
