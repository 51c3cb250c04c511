"""Effects hidden in beans: they vanish at their null, act as they say, and those of other objects are refused."""

import dataclasses

import numpy as np
import pytest

from app.core.errors import ParameterError, UsageError
from app.core.geometry.scene_description import Beans
from app.rig.simulated.bodies.loose_beans import LooseBeans
from app.rig.simulated.effect_sampling import InjectionRequest, draw, injectable_effects
from app.rig.simulated.injected_effects.base import InjectedEffect, Moment
from app.rig.simulated.worlds.beans_world import BeansWorld
from app.rig.simulated.worlds.effect_injector import Intrusion
from app.rig.simulated.worlds.physics import BEAN_WORLD, RollingPhysics, WorldPhysics
from app.tasks.bean_sweep import BEANS, PADDLE
from tests.rig.hidden.moments import injected
from tests.rig.test_beans_world import bed, middles, pose, sweep, wait

ICE = WorldPhysics(table_friction=1e-4, rolling=RollingPhysics(rolling_m=1e-9, spin_m=1e-9))
OF_BEANS = [name for name, effect in injectable_effects().items() if Beans in effect.bodies]
OF_OTHERS = [name for name in injectable_effects() if name not in OF_BEANS]
IN_WORLD = [name for name in OF_BEANS if injectable_effects()[name].in_world]


def table(*hidden: InjectedEffect, nodes: np.ndarray | None = None, physics: WorldPhysics = BEAN_WORLD) -> BeansWorld:
    nodes = bed(4, 6) if nodes is None else nodes
    beans = dataclasses.replace(BEANS, count=len(nodes) // 2, mass_kg=0.001 * len(nodes) / 2)
    return BeansWorld(beans, PADDLE, nodes, physics=physics, intrusion=Intrusion(hidden))


def one_bean(x: float = 0.5, y: float = 0.0) -> np.ndarray:
    """Nodes of a bean along y."""
    return bed(1, 1, (x, y))


def swept(beans: BeansWorld) -> np.ndarray:
    """The beans after a sweep through them, and a little later."""
    beans.intrusion.session = -0.5
    wait(beans, 0.2)
    sweep(beans, (0.46, -0.02), (0.58, 0.03), 0.2)
    beans.place(pose(0.3, 0.0, 0.3))
    return wait(beans, 0.4)


@pytest.fixture(scope="module")
def plain() -> np.ndarray:
    return swept(table())


@pytest.mark.parametrize("name", IN_WORLD)
def test_at_its_null_an_effect_leaves_the_beans_as_they_are_to_the_last_bit(name: str, plain: np.ndarray) -> None:
    effect = injectable_effects()[name]
    nothing = InjectedEffect(name=name, effect=effect, values=np.array([each.null for each in effect.quantities]))
    assert np.array_equal(swept(table(nothing)), plain)


@pytest.mark.parametrize("name", IN_WORLD)
def test_at_its_typical_size_an_effect_moves_the_beans_otherwise_and_leaves_them_on_the_table(
    name: str, plain: np.ndarray
) -> None:
    (here,) = draw([InjectionRequest(name, None)], 0, Beans)
    instead = {"_x": 0.55, "_y": 0.02, "step_time": -0.1}
    values = [
        next((at for end, at in instead.items() if quantity.name.endswith(end) and quantity.typical is None), value)
        for quantity, value in zip(here.effect.quantities, here.values, strict=True)
    ]
    moved = swept(table(dataclasses.replace(here, values=np.array(values))))
    assert 1e-5 < np.abs(moved - plain).max() < 0.25


@pytest.mark.parametrize("name", OF_OTHERS)
def test_an_effect_of_ropes_is_refused_with_what_beans_can_have(name: str) -> None:
    with pytest.raises(UsageError, match=f"{name} is nothing that Beans can have.*friction_map"):
        draw([InjectionRequest(name, None)], 0, Beans)
    effect = injectable_effects()[name]
    typical = np.array([each.typical for each in effect.quantities], float)
    with pytest.raises(ValueError, match="world of Beans"):
        table(InjectedEffect(name=name, effect=effect, values=typical))


def test_arm_cameras_and_what_lies_on_a_table_can_be_hidden_in_beans_and_nothing_along_an_object() -> None:
    seen = {name for name, effect in injectable_effects().items() if effect.family == "sensing"}
    assert seen - {"fill_level"} < set(OF_BEANS)  # Beans fill no bowl.
    assert len(OF_BEANS) == 30
    assert not [name for name in OF_BEANS if "heterogeneity" in name or "curvature" in name]


def test_beans_bear_less_of_a_swirl_than_ropes_do() -> None:
    (beans,), (rope,) = (draw([InjectionRequest("swirl", None)], 0, *body) for body in ((Beans,), ()))
    assert beans.values[0] == pytest.approx(0.2 * rope.values[0])
    with pytest.raises(ParameterError, match=r"outside 0 to 4 1/s\^2 \(swirl; 1.6 is typical\)"):
        draw([InjectionRequest("swirl", 5.0)], 0, Beans)


def test_on_a_tilted_table_without_friction_beans_drift_with_g_sin_a() -> None:
    beans = table(injected("table_tilt", 0.0, 2.0), physics=ICE)
    before = middles(beans.nodes())
    moved = middles(wait(beans, 0.4)) - before
    assert moved[:, 0] == pytest.approx(9.81 * np.sin(np.radians(2.0)) * 0.4**2 / 2, rel=0.03)
    assert np.abs(moved[:, 1]).max() < 1e-5


def test_a_tilt_that_rolling_resistance_bears_moves_nothing_and_a_steeper_one_rolls_beans_away() -> None:
    held, rolling = (
        np.abs(wait(table(injected("table_tilt", 0.0, 3.0), physics=physics), 0.5) - bed(4, 6)).max()
        for physics in (BEAN_WORLD, dataclasses.replace(BEAN_WORLD, rolling=RollingPhysics(rolling_m=1e-4)))
    )
    assert held < 3e-4
    assert rolling > 0.01


def test_forces_pull_where_they_say() -> None:
    """Nothing resists on ice."""

    def moved(*hidden: InjectedEffect) -> np.ndarray:
        beans = table(*hidden, nodes=one_bean(0.5, 0.05), physics=ICE)
        before = middles(beans.nodes())[0]
        return ((middles(wait(beans, 0.2))[0] - before) / (0.2**2 / 2))[:2]

    strength = 0.1 * 9.81
    assert moved(injected("point_attraction", 0.1, 0.55, 0.05)) == pytest.approx([strength, 0.0], rel=0.1, abs=0.01)
    assert moved(injected("point_attraction", -0.1, 0.55, 0.05)) == pytest.approx([-strength, 0.0], rel=0.1, abs=0.01)
    exposed = (0.005**2 + 0.005**2 / 4) / 0.02**2
    assert moved(injected("draught", 0.0, 0.4)) == pytest.approx([0.0, 0.4 * exposed * 9.81], rel=0.05, abs=0.01)
    assert moved(injected("swirl", 4.0, 0.5, 0.0)) == pytest.approx([-4.0 * 0.05, 0.0], rel=0.1, abs=0.02)


def run_out_m(y: float, *hidden: InjectedEffect) -> float:
    """Way of a bean along x, beyond the place where a paddle that took it along stops."""
    beans = table(*hidden, nodes=one_bean(0.5, y))
    wait(beans, 0.1)
    sweep(beans, (0.48, y), (0.55, y), 0.3)
    stopped = beans.tool[0] + PADDLE.half_m[1]
    return float(middles(wait(beans, 2.5))[0, 0]) - stopped


def test_a_hidden_friction_map_changes_the_run_out_by_the_factor() -> None:
    rough, smooth = (run_out_m(y, injected("friction_map", 0.0, 2.5)) for y in (0.12, -0.12))
    usual = run_out_m(0.12)
    assert usual == pytest.approx(run_out_m(-0.12), rel=0.02)
    assert usual / rough == pytest.approx(1.3, rel=0.1)
    assert usual / smooth == pytest.approx(0.7, rel=0.1)


def test_beans_roll_farther_away_from_the_paddle_where_their_resistance_is_a_share() -> None:
    usual, farther = run_out_m(0.0), run_out_m(0.0, injected("rolling_resistance", 0.5))
    # Half of it would be twice as far, were not the first three millimetres, on which beans still slide, as touched.
    assert 0.5 < usual / farther < 0.65


def attached(*, rubbed: bool = True, nodes: np.ndarray | None = None) -> tuple[BeansWorld, LooseBeans]:
    """A world, and its beans as effects see them."""
    beans = table(*([injected("stribeck", 0.0, 0.06)] if rubbed else [injected("viscous_film", 0.0)]), nodes=nodes)
    (bodies,) = (each for each in vars(beans.intrusion).values() if isinstance(each, LooseBeans))
    return beans, bodies


def test_effects_see_where_each_bean_is_how_it_moves_and_how_far_the_paddle_is() -> None:
    beans, bodies = attached(nodes=np.concatenate([one_bean(0.5, 0.0), one_bean(0.5, 0.2)]))
    beans.place(pose(0.45, 0.0, yaw=-np.pi / 2))
    seen: Moment = bodies.moment(0.25)
    assert (seen.session, seen.length_m, seen.radius_m) == (0.25, BEANS.length_m, BEANS.radius_m)
    assert seen.x == pytest.approx(middles(beans.nodes()))
    assert seen.mass == pytest.approx([1e-3, 1e-3])
    # The paddle goes along x: its face is half its thickness before its middle, and 5 cm wide to either side.
    assert seen.toward[0] == pytest.approx([-1.0, 0.0, 0.0])
    assert seen.gap_m[0] == pytest.approx(0.05 - PADDLE.half_m[1] - BEANS.radius_m)
    end = np.array([0.045, 0.2 - 0.003 - PADDLE.half_m[0]])
    assert seen.gap_m[1] == pytest.approx(np.linalg.norm(end) - BEANS.radius_m)
    sweep(beans, (0.47, 0.0), (0.52, 0.0), 0.1)
    seen = bodies.moment(0.0)
    assert seen.v[0, 0] == pytest.approx(0.1, rel=0.3)
    assert np.abs(seen.v[1]).max() < 1e-3
    assert seen.tool_v[:2] == pytest.approx([0.1, 0.0], abs=1e-3)


def test_the_tables_friction_changes_under_one_bean_and_not_that_between_beans() -> None:
    beans, bodies = attached()
    model = vars(bodies)["_model"]
    between, factor = model.geom_friction.copy(), np.ones(24)
    factor[3] = 0.5
    bodies.rub(factor)
    changed = model.pair_friction[3] / model.pair_friction[4]
    assert changed == pytest.approx(0.5)
    assert np.array_equal(model.geom_friction, between)
    assert len(beans.nodes()) == 48


def test_a_steady_force_that_friction_holds_lets_beans_sleep_and_a_stronger_one_wakes_them() -> None:
    held, driven = (table(injected("draught", 0.0, share), nodes=one_bean()) for share in (0.3, 0.5))
    for beans in (held, driven):
        wait(beans, 0.6)
    assert np.abs(held.nodes() - one_bean()).max() < 3e-4
    assert np.abs(driven.nodes() - one_bean()).max() < 3e-4
    strong = table(injected("point_attraction", 0.5, 0.5, 0.05), nodes=one_bean())
    assert middles(wait(strong, 0.6))[0, 1] > 0.01


def test_a_hidden_post_holds_what_runs_into_it_and_lets_the_paddle_pass() -> None:
    post = injected("hidden_obstacle", 2000.0, 0.59, 0.0)
    assert run_out_m(0.0, post) < 0.8 * run_out_m(0.0)
    beans = table(post, nodes=one_bean(0.4, 0.2))
    sweep(beans, (0.50, 0.0), (0.65, 0.0), 0.2)
    assert beans.tool[:2] == pytest.approx([0.65, 0.0], abs=1e-6)


def test_a_compliant_paddle_stays_behind_by_no_more_than_its_load_bends_it_and_turns_with_its_springs() -> None:
    beans = table(injected("tool_compliance", 0.02))
    sweep(beans, (0.46, -0.02), (0.56, 0.04))
    behind = (beans.tool - beans.paddle)[:2]
    ahead = np.array([0.10, 0.06]) / np.hypot(0.10, 0.06)
    assert 2e-4 < behind @ ahead < 0.02 * 2 * 0.4 * 0.024 * 9.81
    assert beans.snapshot().tool == pytest.approx(beans.paddle)
    beans.place(pose(0.3, 0.0, 0.3))
    wait(beans, 0.5)
    assert beans.paddle == pytest.approx(beans.tool, abs=1e-6)
