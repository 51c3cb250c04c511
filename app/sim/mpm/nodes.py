"""The grid operation: momentum of a node to its velocity, with gravity, effects and contact; and the adjoint."""

# Warp reads its types at run time; as static types, its vectors, arrays and structs have no operators.
# pyright: reportGeneralTypeIssues=false, reportIndexIssue=false, reportOperatorIssue=false, reportArgumentType=false
# pyright: reportCallIssue=false, reportInvalidTypeForm=false, reportUntypedFunctionDecorator=false
# pyright: reportAttributeAccessIssue=false, reportConstantRedefinition=false, reportOptionalCall=false

import warp as wp

from app.sim.codegen.inputs import Place, Types
from app.sim.constants import BLOCK_NODES, Constants
from app.sim.effects.base import NodeContext, WarpFunction
from app.sim.mpm.memory import Grid, GridBars
from app.sim.mpm.simd_layout import load_node, store_node
from app.sim.mpm.sparse_grid_blocks import node_position

LEAST_MASS = wp.constant(1.0e-8)
"""Nodes with less than this share of a particle's mass do not move: the square of their mass would underflow."""


@wp.func
def active_node(n: int, listing: int, grid: Grid) -> int:
    """The place in memory of node number `n` of the active blocks."""
    return grid.active[listing, n // BLOCK_NODES] * BLOCK_NODES + n % BLOCK_NODES


@wp.func
def clear(i: int, slot: int, stamp: int, grid: Grid):
    """Node `i` is as if it had never been given anything."""
    store_node(grid.mass, slot, i, wp.vec4())
    if grid.felt[slot, i // BLOCK_NODES] == stamp:
        store_node(grid.touch, slot, i, wp.vec4())
        store_node(grid.aim, slot, i, wp.vec4())


@wp.func
def clear_both(i: int, slot: int, stamp: int, grid: Grid, grid_bars: GridBars):
    """Nor its cotangents."""
    here = load_node(grid.mass, slot, i)
    if here[3] != 0.0:
        clear(i, slot, stamp, grid)
        store_node(grid_bars.node, slot, i, wp.vec4())


@wp.func
def _seen(k: Constants, i: int, time: float, every: int) -> NodeContext:
    """Node `i` as effects see it, as far as it is known."""
    node = NodeContext()
    node.x = node_position(k, i)
    node.dt = k.dt
    node.gravity = k.gravity
    node.time = time
    node.every = every
    return node


def node_of(velocity: WarpFunction, types: Types) -> WarpFunction:
    """`node(k, a, w, i, grid)`, given `node_function`: an idle node stays as it is."""
    Inputs = types.Inputs

    @wp.func
    def node(k: Constants, a: Inputs, w: Place, i: int, grid: Grid):
        here = load_node(grid.mass, w.slot, i)
        if here[3] != 0.0:
            v = wp.vec3()
            if here[3] > LEAST_MASS * k.least_mass:
                touch = wp.vec4()
                aim = wp.vec4()
                if grid.felt[w.slot, i // BLOCK_NODES] == w.stamp:
                    touch = load_node(grid.touch, w.slot, i)
                    aim = load_node(grid.aim, w.slot, i)
                v = velocity(k, a.phi_node[w.b], here, _seen(k, i, a.time[w.b], a.every), touch, aim)
            store_node(grid.velocity, w.slot, i, wp.vec4(v[0], v[1], v[2], 0.0))

    return node


def node_adjoint_of(work: WarpFunction, types: Types) -> WarpFunction:
    """`node_adjoint(k, a, w, i, grid, grid_bars) -> phi_bar`, given `node_work`.

    The cotangent of its velocity becomes that of its momentum and mass, in place; those of touch and aim are set.
    """
    Inputs, PhiNode = types.Inputs, types.PhiNode

    @wp.func
    def node_adjoint(k: Constants, a: Inputs, w: Place, i: int, grid: Grid, grid_bars: GridBars):
        phi_bar = PhiNode()
        here = load_node(grid.mass, w.slot, i)
        if here[3] != 0.0:
            node_bar = wp.vec4()
            touch = wp.vec4()
            aim = wp.vec4()
            touch_bar = wp.vec4()
            aim_bar = wp.vec4()
            felt = grid.felt[w.slot, i // BLOCK_NODES] == w.stamp
            if here[3] > LEAST_MASS * k.least_mass:
                if felt:
                    touch = load_node(grid.touch, w.slot, i)
                    aim = load_node(grid.aim, w.slot, i)
                u = load_node(grid_bars.node, w.slot, i)
                v_bar = wp.vec3(u[0], u[1], u[2])
                _k, phi_bar, node_bar, _seen_bar, touch_bar, aim_bar, _v = wp.grad(work)(
                    k, a.phi_node[w.b], here, _seen(k, i, a.time[w.b], a.every), touch, aim, v_bar
                )
            store_node(grid_bars.node, w.slot, i, node_bar)
            if felt:
                store_node(grid_bars.touch, w.slot, i, touch_bar)
                store_node(grid_bars.aim, w.slot, i, aim_bar)
        return phi_bar

    return node_adjoint
