"""Checks of `doctor`: each is a function that returns findings, and each finding names the command that mends it."""

import os
import platform
import re
import shutil
import socket
import sys
from collections.abc import Callable
from dataclasses import dataclass
from importlib import metadata
from pathlib import Path
from typing import Literal, TypeAlias, final

import psutil

from app import __version__
from app.config import Site
from app.core.system.probe import ProbeResult, probe
from app.core.system.processes import may_run_in_real_time
from app.rig.kinova.client.clients import CLIENTS, DEFAULT
from app.rig.kinova.client.official import INSTALL

State: TypeAlias = Literal["ok", "missing", "optional"]
"""`optional`: not there, and the simulated cell does without it."""

IN_CHECKOUT = (Path(__file__).parents[2] / "Makefile").is_file()
SETUP = "make setup" if IN_CHECKOUT else "install dipac anew: pip install --force-reinstall WHEEL"
DISPLAY = "apt-get install libegl1 libgl1 libx11-6, or what has libEGL, libGL and libX11 on this system; then " + SETUP
"""Remedy where Open3D does not load: it links to what draws windows, although none is opened."""
EXTRAS = {
    "ray": "only `dipac evaluate --workers ray` needs it",
    "lerobot": "only datasets of LeRobot, read or written, need it",
    "ros2": "only `dipac import` of bags of ROS 2 needs it",
}
"""Features that need each extra of pyproject.toml."""
KORTEX = f"not needed, dipac's own client speaks with the arm (docs/kinova.md); to have it all the same, {INSTALL}"


@final
@dataclass(frozen=True, kw_only=True)
class CheckResult:
    """One row: the thing checked, its state, what was found, and the remedy if it is not ok."""

    what: str
    state: State
    found: str
    mend: str = ""


Check: TypeAlias = Callable[[], list[CheckResult]]


def checks(site: Site) -> tuple[Check, ...]:
    """Checks of this installation, in the order of the table."""
    return (
        _machine,
        _priority,
        _libraries,
        _open3d,
        _realsense,
        _opencv,
        _mujoco,
        _jax,
        _warp,
        _kortex,
        _chromium,
        lambda: _recordings(site),
        lambda: _port(site),
    )


def _machine() -> list[CheckResult]:
    version = platform.python_version()
    supported = (3, 11) <= sys.version_info[:2] <= (3, 14)
    memory = psutil.virtual_memory()
    system = " ".join([platform.system(), platform.release(), platform.machine(), *platform.libc_ver()])
    linux = sys.platform == "linux"
    return [
        CheckResult(what="dipac", state="ok", found=__version__),
        CheckResult(
            what="Python",
            state="ok" if supported else "missing",
            found=version,
            mend="" if supported else "make clean setup PYTHON=python3.11",
        ),
        CheckResult(
            what="platform",
            state="ok" if linux else "missing",
            found=system.strip(),
            mend="" if linux else "use Linux; nothing else has been tried",
        ),
        CheckResult(what="cores", state="ok", found=f"{len(os.sched_getaffinity(0))} of {os.cpu_count()}"),
        CheckResult(what="memory", state="ok", found=f"{_size(memory.available)} available of {_size(memory.total)}"),
    ]


def _priority() -> list[CheckResult]:
    """Check that arm and application may take precedence over other programs."""
    if may_run_in_real_time():
        return [CheckResult(what="real-time priority", state="ok", found="allowed")]
    mend = "arms stop beside busy programs: `USER - rtprio 2` in /etc/security/limits.conf, for whoever starts dipac"
    return [CheckResult(what="real-time priority", state="optional", found="not allowed", mend=mend)]


def _libraries() -> list[CheckResult]:
    """Versions of the declared libraries; that the native ones load is for the checks below."""
    try:
        declared = metadata.requires("dipac") or []
    except metadata.PackageNotFoundError:
        return [CheckResult(what="installation", state="missing", found="dipac is not installed", mend=SETUP)]
    return [_library(requirement) for requirement in declared]


def _library(requirement: str) -> CheckResult:
    """`requirement` is as in the metadata: `ray>=2.50; extra == "ray"` is of an extra, which most do without."""
    name = re.split(r"[^\w.-]", requirement)[0]
    extra = re.search(r"extra == ['\"]([\w.-]+)", requirement)
    try:
        return CheckResult(what=name, state="ok", found=metadata.version(name))
    except metadata.PackageNotFoundError:
        if extra:
            named = f'.venv/bin/pip install -e ".[{extra[1]}]"' if IN_CHECKOUT else f'pip install "dipac[{extra[1]}]"'
            mend = f"{EXTRAS[extra[1]]}: {named}"
            return CheckResult(what=name, state="optional", found="not installed", mend=mend)
        return CheckResult(what=name, state="missing", found="not installed", mend=SETUP)


def _open3d() -> list[CheckResult]:
    code = "from app.core.system.shared_libraries import load_open3d; load_open3d()"
    return [_loads("open3d loads", code, mend=DISPLAY)]


def census() -> ProbeResult:
    """Census of the RealSense cameras on the bus, as `app.rig.realsense.sdk.device_enumeration.census` returns it."""
    return probe(
        "from app.rig.realsense.sdk.device_enumeration import census\n"
        "from app.rig.realsense.sdk.sdk import Sdk\nsay(census(Sdk.load()))"
    )


def _realsense() -> list[CheckResult]:
    found = census()
    what = "pyrealsense2 loads"
    if found.failure:
        return [CheckResult(what=what, state="missing", found=found.failure, mend=SETUP)]
    loads = CheckResult(what=what, state="ok", found=f"SDK {found.said['version']}")
    return [loads, _cameras(found.said["cameras"], found.said["warnings"])]


def _cameras(cameras: list[str], warnings: list[str]) -> CheckResult:
    """The RealSense cameras on the bus; one on a slow port works, with smaller images."""
    what = "RealSense cameras"
    if not cameras:
        mend = "plug one into a USB 3 port; not needed for the simulated cell"
        return CheckResult(what=what, state="optional", found="0", mend=mend)
    found = f"{len(cameras)}: {'; '.join(cameras)}"
    return CheckResult(what=what, state="optional" if warnings else "ok", found=found, mend=" ".join(warnings))


def _opencv() -> list[CheckResult]:
    return [_loads("cv2 loads", "import cv2")]


def _mujoco() -> list[CheckResult]:
    return [_loads("mujoco loads", "import mujoco")]


def _jax() -> list[CheckResult]:
    code = "import jax; say(', '.join(f'{d.platform}:{d.id} {d.device_kind}' for d in jax.devices()))"
    return [_loads("JAX devices", code)]


def _warp() -> list[CheckResult]:
    code = (
        "import warp; warp.config.quiet = True; warp.init(); say({'cache': warp.config.kernel_cache_dir, "
        "'devices': ', '.join(f'{d.alias} {d.name}' for d in warp.get_devices())})"
    )
    found = probe(code)
    if found.failure:
        return [CheckResult(what="Warp devices", state="missing", found=found.failure, mend=SETUP)]
    return [
        CheckResult(what="Warp devices", state="ok", found=str(found.said["devices"])),
        _kernels(Path(found.said["cache"])),
    ]


def _kernels(cache: Path) -> CheckResult:
    """Warp names a compiled module's folder after the module: ours contain `dipac` or start with `app`."""
    ours = [folder for folder in cache.glob("wp_*") if re.match(r"wp_(app\.|.*dipac)", folder.name)]
    if not ours:
        mend = "the first run compiles them, in a minute or two"
        return CheckResult(what="compiled kernels", state="optional", found=f"none in {cache}", mend=mend)
    size = sum(file.stat().st_size for folder in ours for file in folder.rglob("*") if file.is_file())
    return CheckResult(what="compiled kernels", state="ok", found=f"{len(ours)} modules, {_size(size)} in {cache}")


def _kortex() -> list[CheckResult]:
    """The client that speaks with a Kinova arm; Kinova's own is not on PyPI."""
    used = CheckResult(what="Kinova client", state="ok", found=f"{DEFAULT} (of {', '.join(CLIENTS)})")
    try:
        return [used, CheckResult(what="kortex_api", state="ok", found=metadata.version("kortex_api"))]
    except metadata.PackageNotFoundError:
        return [used, CheckResult(what="kortex_api", state="optional", found="not installed", mend=KORTEX)]


def _chromium() -> list[CheckResult]:
    path = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)
    mend = "" if path else "apt-get install chromium; only the browser tests need it"
    return [CheckResult(what="Chromium", state="ok" if path else "optional", found=path or "not found", mend=mend)]


def _recordings(site: Site) -> list[CheckResult]:
    folder = site.recordings.absolute()
    there = next(place for place in (folder, *folder.parents) if place.exists())
    writable = there.is_dir() and os.access(there, os.W_OK | os.X_OK)
    free = shutil.disk_usage(there).free
    enough = free >= site.min_free_bytes
    return [
        CheckResult(
            what="recordings",
            state="ok" if writable else "missing",
            found=f"{folder} {'is' if writable else 'is not'} writable",
            mend="" if writable else f"chmod u+w {there}, or choose another folder with --recordings",
        ),
        CheckResult(
            what="free disk",
            state="ok" if enough else "missing",
            found=_size(free),
            mend="" if enough else f"free {_size(site.min_free_bytes - free)} there, or choose another disk",
        ),
    ]


def _port(site: Site) -> list[CheckResult]:
    address = f"{site.console_host}:{site.console_port}"
    with socket.socket() as listening:
        listening.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            listening.bind((site.console_host, site.console_port))
        except OSError as error:
            mend = "end what uses it (ss -ltnp shows it), or choose another with --port"
            return [CheckResult(what="console port", state="missing", found=f"{address}: {error.strerror}", mend=mend)]
    return [CheckResult(what="console port", state="ok", found=f"{address} is free")]


def _loads(what: str, code: str, *, mend: str = SETUP) -> CheckResult:
    found = probe(code)
    if found.failure:
        return CheckResult(what=what, state="missing", found=found.failure, mend=mend)
    return CheckResult(what=what, state="ok", found=str(found.said or "yes"))


def _size(count: int) -> str:
    return f"{count / 1e9:.1f} GB" if count >= 1e9 else f"{count / 1e6:.1f} MB"
