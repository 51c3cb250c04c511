"""Recordings in Rerun: its own reader takes every message, and images, clouds, poses, frames and log lines as such.

Rerun (170 MB) is no dependency: `pip install rerun-sdk` in an environment of its own, and its `bin` on the path.
"""

import re
import shutil
import subprocess
from collections import Counter
from pathlib import Path

import pytest
from mcap.reader import make_reader

from tests.recording.samples import Recording

pytestmark = [
    pytest.mark.serial,
    pytest.mark.skipif(shutil.which("rerun") is None, reason="The program `rerun` is missing; install rerun-sdk."),
]
TIMEOUT_S = 120
CHUNK = re.compile(r"Chunk\(\w+\) with (\d+) rows \(.*?\) - (/\S*) - data columns: \[(.*)\]")
COLUMN = re.compile(r"@([\w.]+):")
READ_AS = {
    "foxglove.CameraCalibration": "Pinhole",
    "foxglove.CompressedImage": "EncodedImage",
    "foxglove.FrameTransforms": "Transform3D",
    "foxglove.Log": "TextLog",
    "foxglove.PointCloud": "Points3D",
    "foxglove.PoseInFrame": "InstancePoses3D",
    "foxglove.RawImage": "Image",
    "foxglove.SceneUpdate": "foxglove.SceneUpdate",  # As plain fields: Rerun draws no lines of this schema.
}
"""Archetype of Rerun for each schema of Foxglove."""


def rerun(*arguments: str | Path) -> str:
    """Output of Rerun's command line."""
    ran = subprocess.run(
        ["rerun", *map(str, arguments)], capture_output=True, text=True, check=False, timeout=TIMEOUT_S
    )
    assert ran.returncode == 0, ran.stderr
    return ran.stdout


@pytest.fixture(scope="module")
def rows(recording: Recording, tmp_path_factory: pytest.TempPathFactory) -> Counter[tuple[str, str]]:
    """Rows that Rerun makes of a recording with all kinds of messages, by channel and archetype."""
    file = tmp_path_factory.mktemp("rerun") / "recording.rrd"
    rerun("mcap", "convert", recording.path, "-o", file)
    rerun("rrd", "verify", file)
    found = Counter[tuple[str, str]]()
    for line in rerun("rrd", "print", "-v", file).splitlines():
        if match := CHUNK.match(line):
            for archetype in set(COLUMN.findall(match[3])):
                found[match[2], archetype] += int(match[1])
    return found


def test_rerun_finds_nothing_wrong_with_a_recording(recording: Recording) -> None:
    rerun("mcap", "check", recording.path)


def test_rerun_reads_every_message(recording: Recording, rows: Counter[tuple[str, str]]) -> None:
    with recording.path.open("rb") as stream:
        summary = make_reader(stream).get_summary()
    assert summary is not None
    assert summary.statistics is not None
    for identity, channel in summary.channels.items():
        schema, count = summary.schemas[channel.schema_id].name, summary.statistics.channel_message_counts[identity]
        archetype = "McapMessage" if schema.startswith("dipac.") else READ_AS[schema]
        assert rows[channel.topic, archetype] == count, channel.topic
