"""Tasks with other beans than the file's: as many, as heavy, and simulated from there."""

from itertools import product

import jax.numpy as jnp
import numpy as np
import pytest

from app.core.errors import ParameterError, UsageError
from app.core.geometry.object_description import BEAN_SIZES
from app.core.geometry.scene_description import Beans
from app.jobs.jit_cache import advance, nominal_model, phi_of
from app.tasks import load

COUNT = 300


def test_the_number_and_the_mass_are_those_of_the_name_and_one_bean_stays_as_heavy() -> None:
    task, fewer = load("bean_sweep(count=40,mass_kg=0.03)"), load("bean_sweep(count=40)")
    for each, mass_kg in ((task, 0.03), (fewer, 0.04)):
        assert isinstance(each.stage.body, Beans)
        assert (each.stage.body.count, each.stage.body.mass_kg) == (40, pytest.approx(mass_kg))
        (body,) = each.scene.bodies
        assert body.volume_m3 * body.density_kg_m3 == pytest.approx(mass_kg)
        assert len(each.start(0)) == 80
        usual = load("bean_sweep")
        assert each.scene.dt_s * each.actions.substeps == pytest.approx(
            usual.scene.dt_s * usual.actions.substeps, rel=0.01
        )
    assert load("bean_sweep").name == "bean_sweep"
    assert task.recorded_name == "bean_sweep(count=40,mass_kg=0.03)"


@pytest.mark.parametrize(("count", "mass_kg"), list(product(*BEAN_SIZES.values())))
def test_beans_at_the_ends_of_the_ranges_fit_and_stay_finite_in_a_sweep(count: float, mass_kg: float) -> None:
    task = load(f"bean_sweep(count={count:g},mass_kg={mass_kg:g})")
    x = task.particles(task.start(1), COUNT)
    through = x[np.argmin(np.linalg.norm(x[:, :2] - x[:, :2].mean(0), axis=1)), :2]
    ahead = np.array([0.06, 0.0])
    action = jnp.asarray([[*(through - ahead), *(through + ahead)]], jnp.float32)
    path = task.actions.tool_path(action, jnp.zeros((1, 8)))
    phi = jnp.asarray(phi_of(nominal_model(task.name)))[None]
    after = np.asarray(advance(task.name, COUNT)(phi, jnp.asarray(x)[None], path))[0]
    assert np.isfinite(after).all()
    moved = np.linalg.norm(after - x, axis=1)
    assert 0.02 < moved.max() < 0.25
    assert np.median(moved) < 0.02


@pytest.mark.parametrize(
    ("name", "said", "error"),
    [
        ("bean_sweep(count=40.5)", "no whole number", UsageError),
        ("bean_sweep(count=500)", "count", ParameterError),
        ("bean_sweep(radius_m=0.004)", "radius_m", UsageError),
    ],
)
def test_sizes_that_beans_cannot_have_are_refused(name: str, said: str, error: type[Exception]) -> None:
    with pytest.raises(error, match=said):
        load(name)
