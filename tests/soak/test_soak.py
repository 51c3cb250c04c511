"""Ten minutes of the whole application on the rehearsal: it neither grows nor loses anything, its arm is on time."""

from pathlib import Path

import anyio
import numpy as np
import pytest

from bench.soak import growth, soak, total

MINUTES = 10.0


@pytest.mark.slow
@pytest.mark.timeout(1200)
def test_the_application_runs_for_long(tmp_path: Path) -> None:
    soaked, said, kept = anyio.run(soak, MINUTES, "rehearsal", tmp_path)
    assert soaked.motions > 10
    assert soaked.faults == []
    # The recording begins with what it is of, which nobody said.
    assert kept == said + 1
    assert growth(total(soaked)) < 0.05
    assert np.percentile(np.concatenate(soaked.periods_s), 99) <= 0.030
