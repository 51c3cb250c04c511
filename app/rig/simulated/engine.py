"""MuJoCo, whose compiled module declares no types: named `Any` once, here."""

from typing import Any

import mujoco as _mujoco

mujoco: Any = _mujoco
