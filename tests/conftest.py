"""Rules for all tests: declared shapes and types are checked, and the event loop is never blocked."""

import gc
import os
from collections.abc import Generator, Iterator
from pathlib import Path

import jax
import pytest
import warp
from blockbuster import blockbuster_ctx
from hypothesis import settings
from threadpoolctl import threadpool_limits

from app.core.system.gc_control import spared_collection
from tests.needs import FIXTURES, VIRTUAL, undeclared
from tests.shapes import check_calls

ROOT = Path(__file__).parent.parent

# Until all tests are collected, and nothing of them is garbage.
gc.disable()


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    for item in items:
        fixtures = getattr(item, "fixturenames", ())
        if VIRTUAL not in fixtures and not FIXTURES.isdisjoint(fixtures):
            item.add_marker("serial")


@pytest.hookimpl(wrapper=True)
def pytest_runtestloop() -> Generator[None, object, object]:
    """A million objects of tests and libraries are left out of collections: each stopped every thread for 0.4 s."""
    gc.enable()
    with spared_collection():
        return (yield)


def modules_without_kernels() -> list[str]:
    """Every module of `app` whose annotations are Python's: those of Warp kernels are read by Warp alone."""
    files = [file for file in ROOT.glob("app/**/*.py") if file.name != "__init__.py"]
    return [
        ".".join(file.relative_to(ROOT).with_suffix("").parts)
        for file in files
        if "import warp" not in file.read_text(encoding="utf-8")
    ]


# An example may take as long as it takes: how long that is depends on what else runs. A run tries the same ones as the
# one before, so that it fails by a change alone; `--hypothesis-profile=search` tries others.
settings.register_profile("dipac", deadline=None, derandomize=True)
settings.register_profile("search", deadline=None)
settings.load_profile("dipac")

# What one test had compiled, those after it, their processes and the next run take from beside the checkout.
os.environ["WARP_CACHE_PATH"] = str(ROOT / ".pytest_cache" / "warp")
os.environ["JAX_COMPILATION_CACHE_DIR"] = str(ROOT / ".pytest_cache" / "compiled")
os.environ["JAX_PERSISTENT_CACHE_MIN_COMPILE_TIME_SECS"] = "0"  # Most are small: thousands, each faster read than made.
jax.config.update("jax_compilation_cache_dir", os.environ["JAX_COMPILATION_CACHE_DIR"])
jax.config.update("jax_persistent_cache_min_compile_time_secs", 0)

# Algebra of tests is so small that threads of BLAS make it up to forty times slower where both cores are busy.
os.environ["OPENBLAS_NUM_THREADS"] = "1"
_BLAS = threadpool_limits(limits=1, user_api="blas")

# A program that a test compiles runs a few times: XLA spends less on making it fast, a third less without its MLIR
# emitters and wide vectors. In the application's own processes it spends what it does.
_QUICK_TO_COMPILE = "--xla_backend_optimization_level=0 --xla_cpu_max_isa=AVX"
if jax.__version_info__ < (0, 11):  # Later versions know no other emitters, and end at a flag that they do not know.
    _QUICK_TO_COMPILE += " --xla_cpu_use_fusion_emitters=false"
with pytest.MonkeyPatch.context() as _environment:
    _environment.setenv("XLA_FLAGS", f"{os.environ.get('XLA_FLAGS', '')} {_QUICK_TO_COMPILE}")
    jax.devices()

# Warp looks for a driver in a process of its own at its first use, which is no test's.
warp.config.log_level = warp.LOG_WARNING
warp.init()

# Calls in these modules are checked at run time against their declared shapes and types.
check_calls(modules_without_kernels())


MOST_MAPS = 40_000
"""Memory maps of a process: three a compiled program. Linux allows 65,530."""


@pytest.fixture(scope="session")
def anyio_backend() -> str:
    return "asyncio"


def _alone(item: pytest.Item) -> Generator[None]:
    """A test that is not serial needs a core alone: whatever else it used would fail or slow others now and then."""
    if any(item.get_closest_marker(mark) is not None for mark in ("serial", "slow")):  # Slow ones run one by one.
        yield
        return
    with undeclared() as used:
        yield
    if used:
        pytest.fail(f"This test uses {' and '.join(sorted(used))}; mark it `serial`.", pytrace=False)


@pytest.hookimpl(wrapper=True)
def pytest_runtest_setup(item: pytest.Item) -> Generator[None]:
    """With the fixtures of its module, too."""
    yield from _alone(item)


@pytest.hookimpl(wrapper=True)
def pytest_runtest_call(item: pytest.Item) -> Generator[None]:
    """The test itself."""
    yield from _alone(item)


@pytest.fixture(scope="module", autouse=True)
def compiled_programs_leave_room() -> Iterator[None]:
    """XLA's programs are dropped before a process has as many memory maps as the system allows, which ends it."""
    yield
    maps = Path("/proc/self/maps")
    if maps.exists() and maps.read_bytes().count(b"\n") > MOST_MAPS:
        jax.clear_caches()
        gc.collect()


@pytest.fixture(autouse=True)
def loop_is_never_blocked(request: pytest.FixtureRequest) -> Iterator[None]:
    """A call from `app` that blocks the event loop (a file, a sleep, a socket, a lock) raises BlockingError.

    Only tests marked `anyio` are watched; the others have no loop to block.
    """
    if request.node.get_closest_marker("anyio") is None:
        yield
        return
    with blockbuster_ctx("app") as watch:
        for function in watch.functions.values():
            # A worker process may take its milliseconds to start, and a module its own to be found and imported.
            function.can_block_in("multiprocessing/process.py", "start")
            function.can_block_in("<frozen importlib._bootstrap>", "_find_and_load")
            function.can_block_in("pkgutil.py", "_iter_file_finder_modules")
        yield
