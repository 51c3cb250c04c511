"""Bad input is named by index and value; a simulation that breaks is dissected, and its dump replays it bit by bit."""

import json
import re
from dataclasses import replace
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from app.core.errors import ParameterError, RecordingError, SimulationError, UsageError
from app.sim.diagnosis.checked import with_checks
from app.sim.diagnosis.dump import Dump, leave_dump, load_dump, save_dump
from app.sim.diagnosis.failure_diagnosis import MpmCase, dissect, single
from app.sim.diagnosis.faults import KEPT
from app.sim.effects.base import Effect
from app.sim.materials.base import Law, Material
from app.sim.materials.cloth import ClothMaterial
from app.sim.materials.elastic import Elastic
from app.sim.materials.granular import Granular
from app.sim.materials.liquid import LiquidMaterial
from app.sim.model.registry import known_materials, known_tools
from app.sim.model.scene import Body
from app.sim.runtime.checks import Setup, require_inputs
from app.sim.runtime.rollout import make_rollout
from app.sim.state import Setting, State
from app.sim.tools.box import BoxCollider, GripperCollider
from tests.sim.broken import BESIDE, SETUP, STEPS, flung, problem
from tests.sim.scenes import PARTICLES, SCENE

GRIPPER = Setup(scene=replace(SCENE, tools=(GripperCollider(),)), counts=(PARTICLES,), effects=())
ROLLOUT = make_rollout(SCENE, particle_count=PARTICLES, effects=())


def simulated(*arrays: np.ndarray | State | Setting) -> State:
    return ROLLOUT(*jax.tree.map(jnp.asarray, arrays))


def refused(phi: np.ndarray, state: State, tool: np.ndarray, setting: Setting, setup: Setup = SETUP) -> str:
    with pytest.raises(ParameterError) as error:
        require_inputs(setup, phi, state, tool, setting)
    return str(error.value)


def jumping() -> MpmCase:
    """A case in which the finger jumps into the rope and through it."""
    tool = BESIDE.copy()
    tool[20:, 1] += 0.5
    tool[21::2, 1] -= 0.497
    phi, state, path, setting = problem(tool)
    return single(SETUP, phi, state, path, setting)


def first_bad_substep(case: MpmCase) -> int | None:
    """First substep that is not finite, by brute force: the ordinary simulator, a substep at a time."""
    state = case.state
    for substep in range(1, case.substeps + 1):
        state = simulated(case.phi, state, case.tool[:, substep - 1 : substep + 1], case.setting)
        if not np.isfinite(state.x).all():
            return substep
    return None


def test_sound_input_is_accepted() -> None:
    require_inputs(SETUP, *problem())


@pytest.mark.parametrize(
    ("name", "index", "said"),
    [
        ("x", (1, 17, 2), "state.x is nan for candidate 1, particle 17, component z"),
        ("v", (0, 3, 0), "state.v is nan for candidate 0, particle 3, component x"),
        ("C", (1, 59, 0, 2), "state.C is nan for candidate 1, particle 59, component xz"),
        ("F", (0, 0, 2, 1), "state.F is nan for candidate 0, particle 0, component zy"),
    ],
)
def test_a_state_that_is_not_finite_is_named_by_array_candidate_particle_and_component(
    name: str, index: tuple[int, ...], said: str
) -> None:
    phi, state, tool, setting = problem()
    getattr(state, name)[index] = np.nan
    assert refused(phi, state, tool, setting).startswith(said)


def test_a_tool_path_phi_or_setting_that_is_not_finite_is_named() -> None:
    phi, state, tool, setting = problem()
    tool[1, 7, 1] = np.inf
    assert "tool is inf for candidate 1, path point 7, component tool 0 y" in refused(phi, state, tool, setting)
    phi, state, tool, setting = problem()
    phi[1, 1] = np.nan
    assert "phi is nan for candidate 1, component table_friction" in refused(phi, state, tool, setting)
    phi, state, tool, setting = problem()
    setting.label[0, 5, 3] = -np.inf
    assert "setting.label is -inf for candidate 0, particle 5, component 3" in refused(phi, state, tool, setting)


def test_a_particle_off_the_grid_is_named_with_its_place_and_the_grid_s_bounds() -> None:
    phi, state, tool, setting = problem()
    state.x[1, 12] = (0.51, 0.2, 0.01)
    said = refused(phi, state, tool, setting)
    assert said.startswith("Particle 12 of candidate 1 is at (0.51, 0.2, 0.01) m")
    assert "(0.425, -0.095, -0.015) to (0.595, 0.095, 0.065) m; move it, or widen" in said


def test_the_bounds_are_those_of_the_kernels() -> None:
    """Input that the checks accept stays finite for a substep, and input that they refuse does not."""
    phi, state, tool, setting = problem(BESIDE[:2])
    for y, sound in ((0.0949, True), (0.0951, False)):
        state.x[:, 0, 1] = y
        assert sound == bool(np.isfinite(np.asarray(simulated(phi, state, tool, setting).x)).all())
        if sound:
            require_inputs(SETUP, phi, state, tool, setting)
        else:
            assert "Particle 0" in refused(phi, state, tool, setting)


def test_phi_outside_its_range_is_named_with_range_and_unit() -> None:
    phi, state, tool, setting = problem()
    phi[1, 0] = 2e6
    said = refused(phi, state, tool, setting)
    assert said == "Candidate 1: stiffness = 2e+06 is outside its range 1000 to 100000 (unit Pa)."


@pytest.mark.parametrize("volume", [0.0, -1.5])
def test_volume_that_is_not_positive_is_named(volume: float) -> None:
    phi, state, tool, setting = problem()
    state.F[0, 9] = np.diag([1.0, 1.0, volume])
    assert f"Particle 9 of candidate 0 has the relative volume det F = {volume:g};" in refused(
        phi, state, tool, setting
    )


def test_a_particle_that_crosses_a_cell_in_a_substep_is_named_with_the_time_step_it_needs() -> None:
    phi, state, tool, setting = problem()
    state.v[1, 4] = (0.0, 0.0, 40.0)
    said = refused(phi, state, tool, setting)
    assert said.startswith("Particle 4 of candidate 1 moves at 40 m/s, 2 cells of 0.01 m a substep")
    assert "dt_s below 0.00025 s" in said


def test_a_tool_that_jumps_is_named_with_the_substep() -> None:
    tool = BESIDE.copy()
    tool[21:, 1] += 0.05
    assert re.search(
        r"Tool 0 of candidate 0: its position goes from .* to .* m in substep 20, 5.01 cells", refused(*problem(tool))
    )


def test_a_quaternion_that_stretches_and_an_opening_that_jumps_are_named() -> None:
    pose = np.concatenate([BESIDE, np.tile(np.float32([1, 0, 0, 0, 0.02]), (len(BESIDE), 1))], axis=1)
    require_inputs(GRIPPER, *problem(pose))
    bent = pose.copy()
    bent[3, 3] = 1.1
    assert "the quaternion of path point 3 has the length 1.1;" in refused(*problem(bent), setup=GRIPPER)
    torn = pose.copy()
    torn[9:, 7] += 0.03
    assert "its opening goes from (0.02) to (0.05) m in substep 8" in refused(*problem(torn), setup=GRIPPER)


def test_a_scene_without_moving_tools_takes_a_path_without_coordinates() -> None:
    scene = replace(SCENE, tools=(BoxCollider(half_m=(0.01, 0.01, 0.01), place_m=(0.45, 0.05, 0.01)),))
    require_inputs(Setup(scene=scene, counts=(PARTICLES,), effects=()), *problem(np.zeros((5, 0), np.float32)))


@pytest.mark.parametrize(
    ("counts", "said"),
    [((), "0 numbers; give one for each of the scene's 1"), ((3, 4), "2 numbers"), ((0,), "of body 0 is 0")],
)
def test_numbers_of_particles_that_do_not_fit_the_bodies_are_refused(counts: tuple[int, ...], said: str) -> None:
    with pytest.raises(ParameterError, match=said):
        make_rollout(SCENE, particle_count=counts, effects=())


@pytest.mark.parametrize("material", ["elastic", GripperCollider()])
def test_what_is_no_material_is_refused_with_the_known_ones(material: object) -> None:
    with pytest.raises(ParameterError, match=r"Unknown material .* Known: cloth\.Cloth, elastic\.Elastic"):
        Body(volume_m3=1e-5, density_kg_m3=1e3, material=material)  # pyright: ignore[reportArgumentType]


def test_every_material_and_tool_of_the_folders_is_known() -> None:
    assert {"elastic.Elastic", "liquid.Liquid"} <= known_materials().keys()
    assert {"finger.Finger", "box.Gripper"} <= known_tools().keys()


def test_a_rope_that_flies_off_the_grid_is_dissected_to_the_substep_and_its_particles() -> None:
    case = flung()
    found = dissect(case)
    assert found.failed == first_bad_substep(case)
    assert found.objection is None
    kinds = {fault.kind: fault for fault in found.faults}
    assert kinds["outside"].step + 1 == kinds["not finite"].step == found.failed
    assert kinds["outside"].index == kinds["not finite"].index
    assert found.trace.outside[-1] > 0
    assert not found.trace.outside[:-1].any()
    assert "widen the scene" in found.verdict()


def test_a_tool_that_jumps_is_the_first_thing_that_the_autopsy_says() -> None:
    found = dissect(jumping())
    assert found.objection is not None
    assert "in substep 19" in found.objection
    assert found.failed == first_bad_substep(jumping())
    assert "The input is wrong: Tool 0" in found.verdict()


def test_what_is_turned_inside_out_or_too_fast_is_named_before_it_is_not_finite() -> None:
    phi, state, tool, setting = problem()
    state.C[0, 7] = -3000 * np.eye(3)
    state.v[0, 11] = (1e25, 0.0, 0.0)
    case = single(SETUP, phi, state, tool, setting)
    found = dissect(case)
    assert found.failed == first_bad_substep(case) == 1
    assert [(fault.kind, fault.step, fault.index) for fault in found.faults] == [
        ("too fast", 0, 11),
        ("not finite", 1, 11),
    ]
    state.v[0, 11] = 0.0
    squeezed = {fault.kind: fault for fault in dissect(single(SETUP, phi, state, tool, setting)).faults}
    assert squeezed["turned inside out"].step == 1
    assert squeezed["turned inside out"].index == 7
    assert "det F = -0.1" in squeezed["turned inside out"].words


@pytest.mark.parametrize("material", [LiquidMaterial(), Granular(), ClothMaterial()])
def test_no_material_makes_a_particle_finite_again(material: Material) -> None:
    body = replace(SCENE.bodies[0], material=material)
    rollout = make_rollout(replace(SCENE, bodies=(body,)), particle_count=PARTICLES, effects=())
    for name in State._fields:
        phi, state, tool, setting = problem(BESIDE[:6])
        getattr(state, name)[0, 5] = np.nan
        end = rollout(*jax.tree.map(jnp.asarray, (phi, state, tool, setting)))
        assert np.isnan(end.x[0]).all(), name
        assert np.isfinite(end.x[1]).all(), name


@pytest.mark.parametrize("piece", [1, 7])
def test_an_autopsy_in_pieces_finds_the_same(piece: int, monkeypatch: pytest.MonkeyPatch) -> None:
    whole = dissect(flung())
    monkeypatch.setattr("app.sim.diagnosis.failure_diagnosis.PIECE", piece)
    parts = dissect(flung())
    assert (parts.failed, parts.until) == (whole.failed, whole.until)
    assert [fault.kind for fault in parts.faults] == [fault.kind for fault in whole.faults]
    np.testing.assert_allclose(parts.trace.speed_m_s, whole.trace.speed_m_s, rtol=1e-4)
    np.testing.assert_allclose(parts.last.x, whole.last.x, atol=1e-6)


def test_the_last_states_are_those_of_the_simulator() -> None:
    case = flung()
    found = dissect(case)
    assert len(found.last.x) == KEPT
    for back in (1, 3):
        substep = found.until + 1 - back
        end = simulated(case.phi, case.state, case.tool[:, : substep + 1], case.setting)
        np.testing.assert_allclose(found.last.x[-back], end.x[0], atol=1e-6)


def test_a_sound_simulation_is_said_to_be_finite_throughout() -> None:
    found = dissect(single(SETUP, *problem()))
    assert (found.failed, found.faults, found.until) == (None, (), STEPS)
    assert found.verdict() == f"Finite throughout ({STEPS} substeps)."


def test_input_that_is_not_finite_fails_before_the_first_substep() -> None:
    phi, state, tool, setting = problem()
    state.v[0, 2] = np.nan
    found = dissect(single(SETUP, phi, state, tool, setting))
    assert found.failed == 0
    assert "particle 2 has no finite v" in found.verdict()
    tool[1] = np.nan
    assert dissect(single(SETUP, phi, state, tool, setting, candidate=1)).failed == 0


def test_a_checked_simulator_names_the_particle_and_leaves_a_dump(tmp_path: Path) -> None:
    simulate = with_checks(SETUP, tmp_path, ROLLOUT)
    phi, state, tool, setting = problem()
    assert np.isfinite(np.asarray(simulate(*jax.tree.map(jnp.asarray, (phi, state, tool, setting))).x)).all()
    state.v[1, 30:, 1] = 8.0
    with pytest.raises(SimulationError, match=r"^Candidate 1 of 2: Not finite from substep \d+ on") as error:
        simulate(*jax.tree.map(jnp.asarray, (phi, state, tool, setting)))
    (path,) = tmp_path.iterdir()
    assert f"`dipac replay {path}` shows it." in str(error.value)
    state.v[1, 30:, 1] = 80.0
    with pytest.raises(ParameterError, match="Particle 30 of candidate 1 moves at 80 m/s"):
        simulate(*jax.tree.map(jnp.asarray, (phi, state, tool, setting)))


def test_a_dump_comes_back_bit_by_bit(tmp_path: Path) -> None:
    case = flung()
    save_dump(tmp_path / "case.npz", Dump(case=case, about="a test"))
    loaded = load_dump(tmp_path / "case.npz")
    assert loaded.about == "a test"
    assert loaded.case.setup == case.setup
    for name in ("phi", "state", "tool", "setting"):
        jax.tree.map(np.testing.assert_array_equal, getattr(loaded.case, name), getattr(case, name))
    assert [path.name for path in tmp_path.iterdir()] == ["case.npz"]


def test_a_dump_that_names_no_engine_is_of_material_points(tmp_path: Path) -> None:
    case, path = flung(), tmp_path / "case.npz"
    save_dump(path, Dump(case=case, about="a test"))
    with np.load(path) as arrays:
        entries = dict(arrays)
    header = json.loads(str(entries["header"]))
    assert header.pop("engine") == "mpm"
    np.savez(path, **(entries | {"header": np.array(json.dumps(header))}))
    loaded = load_dump(path).case
    assert isinstance(loaded, MpmCase)
    assert loaded.setup == case.setup


def test_scenes_of_every_tool_and_material_come_back(tmp_path: Path) -> None:
    numbers = {
        "plastic.Plastic": {"yield_pa": 100.0},
        "rope.Rope": {"fibre_pa": 5e5, "core_m": 0.004, "yield_strain": 0.1},
    }
    bodies = tuple(
        Body(volume_m3=np.pi * 1e-5, density_kg_m3=900.0, material=kind(**numbers.get(name, {})), stiffness=0.1)
        for name, kind in known_materials().items()
    )
    scene = replace(SCENE, bodies=bodies, tools=(*GRIPPER.scene.tools, *SCENE.tools))
    phi, state, _, setting = problem()
    counts = tuple([PARTICLES // len(bodies)] * len(bodies))
    case = single(Setup(scene=scene, counts=counts, effects=()), phi, state, np.zeros((2, 3, 11), np.float32), setting)
    path = leave_dump(tmp_path / "new", Dump(case=case, about="many"))
    assert load_dump(path).case.setup == case.setup
    assert leave_dump(tmp_path / "new", Dump(case=case, about="many")) == path


def test_what_is_not_of_the_package_is_not_dumped(tmp_path: Path) -> None:
    case = flung()
    own = Law(name="own", make=Elastic().law.make)
    body = replace(SCENE.bodies[0], material=Elastic(law=own))
    with pytest.raises(UsageError, match="a law of its own"):
        save_dump(tmp_path / "a.npz", Dump(case=with_setup(case, scene=replace(SCENE, bodies=(body,))), about=""))
    with pytest.raises(UsageError, match="only those can be dumped"):
        save_dump(tmp_path / "a.npz", Dump(case=with_setup(case, effects=(Effect(parameters=()),)), about=""))
    assert not list(tmp_path.iterdir())


def with_setup(case: MpmCase, **changed: object) -> MpmCase:
    return replace(case, setup=replace(case.setup, **changed))


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda header: header.update(format="other"), "is not a dump of a simulation"),
        (lambda header: header.update(schema=99), "schema 99.*replay it with the version that wrote it"),
        (lambda header: header["scene"]["tools"][0].update({"class": "os.system"}), "Unknown tool 'os.system'"),
        (lambda header: header["scene"]["bodies"][0]["material"].update({"class": "x"}), "Unknown material 'x'"),
        (lambda header: header["scene"].update(colour="red"), "unexpected keyword argument 'colour'"),
        (lambda header: header.update(effects=["magic"]), "Unknown effect 'magic'"),
        (lambda header: header.update(parameters=["stiffness"]), "its parameters are"),
        (lambda header: header.update(counts=[7]), "state.x has shape"),
    ],
)
def test_a_dump_that_this_version_cannot_replay_is_refused(change, said: str, tmp_path: Path) -> None:
    path = tmp_path / "case.npz"
    save_dump(path, Dump(case=flung(), about="a test"))
    with np.load(path) as arrays:
        entries = dict(arrays)
    header = json.loads(str(entries["header"]))
    change(header)
    np.savez(path, **(entries | {"header": np.array(json.dumps(header))}))
    with pytest.raises(RecordingError, match=said):
        load_dump(path)


@pytest.mark.parametrize("content", [b"", b"not a zip", b"PK\x03\x04 cut off"])
def test_foreign_files_are_refused(content: bytes, tmp_path: Path) -> None:
    path = tmp_path / "foreign.npz"
    path.write_bytes(content)
    with pytest.raises(RecordingError, match="is not a dump of a simulation"):
        load_dump(path)
    np.save(tmp_path / "one.npy", np.zeros(3))
    with pytest.raises(RecordingError, match="is not a dump"):
        load_dump(tmp_path / "one.npy")
    with pytest.raises(UsageError, match="Cannot read the dump"):
        load_dump(tmp_path / "none.npz")
