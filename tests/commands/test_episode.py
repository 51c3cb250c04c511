"""What is wrong with an order is said before a process, a file or the cell is started."""

import pytest

from app.__main__ import main
from app.core.errors import UsageError


@pytest.mark.parametrize("option", ["--seed", "--pushes"])
def test_a_negative_number_is_refused_by_its_options_name(option, capsys, tmp_path):
    recordings = tmp_path / "recordings"
    assert main(["run", "rope_push", option, "-1", "--recordings", str(recordings)]) == UsageError.exit_code
    assert f"{option} -1 must not be negative" in capsys.readouterr().err
    assert not recordings.exists()
