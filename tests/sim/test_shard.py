"""Candidates divided among devices and hosts: the same results as on one.

How many devices a CPU has is said before JAX starts, so these simulations run in processes of their own.
"""

import os
import socket
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

ROOT = Path(__file__).parents[2]

DIVIDED = """
import sys
import jax, jax.numpy as jnp, numpy as np
jax.config.update("jax_platforms", "cpu")
host, hosts, port, out = int(sys.argv[1]), int(sys.argv[2]), sys.argv[3], sys.argv[4]
if hosts > 1:
    jax.config.update("jax_cpu_collectives_implementation", "gloo")
    jax.distributed.initialize(f"127.0.0.1:{port}", hosts, host)
from jax.experimental import multihost_utils
from app.sim.model.params import nominal_phi
from app.sim.runtime.rollout import make_rollout
from app.sim.runtime.shard import mesh_of, over_devices, sharding
from app.sim.state import State
from tests.sim.scenes import PARTICLES, SCENE, rope, straight_tool

CANDIDATES, STEPS = int(sys.argv[5]), 40
phi = np.tile(nominal_phi()[:2], (CANDIDATES, 1)) * np.linspace(0.8, 1.2, CANDIDATES, dtype=np.float32)[:, None]
x = np.tile(rope(), (CANDIDATES, 1, 1))
tool = np.stack([straight_tool((0.49 + 0.01 * b, -0.022, 0.005), (0, 0.3, 0), STEPS) for b in range(CANDIDATES)])
simulate = make_rollout(SCENE, particle_count=PARTICLES, effects=())

def value(simulate, phi, state, tool):
    return (simulate(phi, state, tool).x[..., 1] ** 2).sum()

def both(simulate, arguments):
    end = jax.jit(simulate)(*arguments)
    slopes = jax.jit(jax.grad(lambda *a: value(simulate, *a), argnums=(0, 1, 2)))(*arguments)
    return jax.tree.leaves((end, slopes))

mesh = mesh_of()
assert mesh.devices.size == hosts * int(sys.argv[6]), mesh
arguments = (phi, State(*(np.asarray(leaf) for leaf in State.at_rest(jnp.asarray(x)))), tool)
if CANDIDATES % mesh.devices.size == 0:
    arguments = jax.tree.map(
        lambda leaf: jax.make_array_from_callback(leaf.shape, sharding(mesh), lambda index: leaf[index]), arguments
    )
divided = both(over_devices(simulate, mesh), arguments)
leaves = [multihost_utils.process_allgather(leaf, tiled=True) if hosts > 1 else np.asarray(leaf) for leaf in divided]
if hosts == 1:
    for ours, theirs in zip(leaves, both(simulate, jax.tree.map(np.asarray, arguments)), strict=True):
        np.testing.assert_allclose(ours, theirs, rtol=0, atol=1e-6 * np.abs(theirs).max())
    assert all(len(leaf.sharding.device_set) == mesh.devices.size for leaf in divided) or CANDIDATES % mesh.devices.size
if host == 0:
    np.savez(out, *leaves)
"""


def run(out: Path, *, hosts: int, devices: int, candidates: int) -> list[np.ndarray]:
    """The end state and the gradients of some pushes, as `hosts` processes with `devices` each compute them."""
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    environment = os.environ | {
        "XLA_FLAGS": f"--xla_force_host_platform_device_count={devices}",
        "PYTHONPATH": str(ROOT),
        "JAX_PLATFORMS": "cpu",
    }
    processes = [
        subprocess.Popen(
            [sys.executable, "-c", DIVIDED, *map(str, (host, hosts, port, out, candidates, devices))],
            cwd=ROOT,
            env=environment,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
        )
        for host in range(hosts)
    ]
    for process in processes:
        said, _ = process.communicate(timeout=240)
        assert process.returncode == 0, said
    with np.load(out) as found:
        return [found[name] for name in found.files]


@pytest.mark.serial
@pytest.mark.parametrize("candidates", [4, 5])
def test_two_devices_find_what_one_finds(tmp_path: Path, candidates: int):
    leaves = run(tmp_path / "two.npz", hosts=1, devices=2, candidates=candidates)
    assert leaves[0].shape[0] == candidates
    assert all(np.isfinite(leaf).all() for leaf in leaves)
    assert np.abs(leaves[0][1] - leaves[0][0]).max() > 1e-5  # Candidates differ.


@pytest.mark.serial
def test_two_hosts_find_what_one_finds(tmp_path: Path):
    one = run(tmp_path / "one.npz", hosts=1, devices=1, candidates=4)
    two = run(tmp_path / "hosts.npz", hosts=2, devices=1, candidates=4)
    for ours, theirs in zip(two, one, strict=True):
        np.testing.assert_allclose(ours, theirs, rtol=0, atol=1e-6 * np.abs(theirs).max())
