"""What all tests share: the asynchronous backend, and an event loop that is never blocked.

The shapes and types that the code declares are checked at run time: `app` is imported through jaxtyping's hook.
"""

from collections.abc import Iterator

import pytest
from blockbuster import blockbuster_ctx
from jaxtyping import install_import_hook

install_import_hook("app", "beartype.beartype")


@pytest.fixture
def anyio_backend() -> str:
    return "asyncio"


@pytest.fixture(autouse=True)
def loop_is_never_blocked(request: pytest.FixtureRequest) -> Iterator[None]:
    """A call from `app` that blocks the event loop (a file, a sleep, a socket, a lock) raises BlockingError.

    Tests without a loop do not pay for it: only those marked `anyio` are watched.
    """
    if request.node.get_closest_marker("anyio") is None:
        yield
        return
    with blockbuster_ctx("app") as watch:
        for function in watch.functions.values():
            # Starting a worker process is allowed to take its milliseconds.
            function.can_block_in("multiprocessing/process.py", "start")
        yield
