"""Archives of arrays (.npz) of other programs, read in full; nothing in them is executed."""

import zipfile
from pathlib import Path
from typing import IO, Final

import numpy as np

_ENCRYPTED = 0x1
"""Flag of an encrypted entry (PKWARE's APPNOTE.TXT, 4.4.4)."""

_FOREIGN: Final = {
    b"PAR1": "an Apache Parquet file, as of a LeRobot dataset",
    b"\x89HDF\r\n\x1a\n": "an HDF5 file",
    b"\x89MCAP0\r\n": "an MCAP file (a recording of dipac needs no import, one of ROS 2 has to be converted)",
    b"SQLite format 3\0": "an SQLite file, as of a ROS 2 bag",
    b"#ROSBAG": "a ROS 1 bag",
    b"ply": "a PLY file of one cloud",
    b"\x80": "a Python pickle, which could run anything if it were loaded",
}
"""First bytes of files that are taken for archives of arrays, and what they are."""


def read_arrays(path: Path) -> dict[str, np.ndarray]:
    """Every array in the file, by name. Raises OSError where it cannot be read, ValueError where it is no archive."""
    with path.open("rb") as stream:
        head = stream.read(max(map(len, (np.lib.format.MAGIC_PREFIX, *_FOREIGN))))
        stream.seek(0)
        return _read(stream, head)


def _read(stream: IO[bytes], head: bytes) -> dict[str, np.ndarray]:
    if head.startswith(np.lib.format.MAGIC_PREFIX):
        raise ValueError("it is one array without a name (.npy); write named ones with numpy.savez")
    if not head.startswith(b"PK"):
        kind = next((f"{kind}, " for magic, kind in _FOREIGN.items() if head.startswith(magic)), "")
        raise ValueError(f"it is {kind}no .npz archive; write one with numpy.savez")
    try:
        with zipfile.ZipFile(stream) as archive:
            if any(entry.flag_bits & _ENCRYPTED for entry in archive.infolist()):
                raise ValueError("it is encrypted; pack it without a password")
        stream.seek(0)
        with np.load(stream, allow_pickle=False) as arrays:
            return {name: np.asarray(arrays[name]) for name in arrays.files}
    except ValueError as error:
        if "allow_pickle" in str(error):
            raise ValueError("it holds Python objects; write plain numbers and strings, without objects") from None
        raise
    except Exception as error:  # The file is untrusted, and its readers raise any error.
        raise ValueError(str(error) or type(error).__name__) from None
