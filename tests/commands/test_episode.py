"""Options of an episode are checked before a process, a file or the cell is started."""

import pytest

from app.__main__ import main
from app.commands._episode import RunOptions
from app.commands._options import Options
from app.core.errors import MotionRefused, UsageError
from app.tasks import load


@pytest.mark.parametrize("option", ["--seed", "--pushes"])
def test_a_negative_number_is_refused_by_its_options_name(option, capsys, tmp_path):
    recordings = tmp_path / "recordings"
    assert main(["run", "rope_push", option, "-1", "--recordings", str(recordings)]) == UsageError.exit_code
    assert f"{option} -1 must not be negative" in capsys.readouterr().err
    assert not recordings.exists()


def test_a_world_of_ropes_is_refused_for_a_task_without_one_before_anything_starts(capsys, tmp_path):
    order = ["run", "bean_sweep", "--world", "cable", "--recordings", str(tmp_path / "recordings")]
    assert main(order) == UsageError.exit_code
    assert "--world cable is of tasks with a rope, not with Beans" in capsys.readouterr().err
    assert not (tmp_path / "recordings").exists()


@pytest.mark.parametrize("rig", ["gen3", "replayed"])
def test_a_cell_whose_rope_is_not_simulated_is_in_no_world_of_ropes(rig):
    order = RunOptions(asked="rope_push", options=Options(rig=rig, world="cable"), automatic=False)
    with pytest.raises(UsageError, match=f"{rig} has none"):
        order.stage(load("rope_push"))


@pytest.mark.serial
def test_a_segmenter_that_is_none_is_refused_before_anything_starts(capsys, tmp_path):
    (tmp_path / "none.onnx").write_bytes(b"no network")
    order = [
        "run",
        "rope_push",
        "--segmenter",
        str(tmp_path / "none.onnx"),
        "--recordings",
        str(tmp_path / "recordings"),
    ]
    assert main(order) == UsageError.exit_code
    assert "one input of 32-bit floats, shape (1, 3, H, W)" in capsys.readouterr().err
    assert not (tmp_path / "recordings").exists()


def test_a_liquid_without_depth_is_refused_before_anything_starts(capsys, tmp_path):
    assert main(["run", "pour_water", "--no-depth", "--recordings", str(tmp_path)]) == UsageError.exit_code
    assert "level of the liquid of pour_water cannot be told from its outline" in capsys.readouterr().err


def test_a_run_that_approves_by_itself_is_refused_on_a_real_arm_before_that_is_looked_for(capsys, tmp_path):
    order = ["run", "rope_push", "--rig", "gen3", "--cell", str(tmp_path / "none.toml"), "--recordings", str(tmp_path)]
    assert main(order) == MotionRefused.exit_code
    assert "use `dipac console`" in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []
