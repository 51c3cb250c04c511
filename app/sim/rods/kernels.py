"""The Warp kernels of rods: whole actions, sixteen candidates abreast on a CPU, a block a candidate on a GPU."""

# Warp reads its types at run time; as static types, its vectors, arrays and structs have no operators.
# pyright: reportInvalidTypeForm=false, reportIndexIssue=false, reportOperatorIssue=false, reportArgumentType=false
# pyright: reportCallIssue=false, reportGeneralTypeIssues=false, reportUntypedFunctionDecorator=false
# pyright: reportAttributeAccessIssue=false, reportUndefinedVariable=false

import functools
from dataclasses import dataclass
from hashlib import sha256
from pathlib import Path
from typing import final

import warp as wp

FIELDS, TOOL, FINGER = 3, 4, 6
"""Rows of fields, numbers of the finger in a path, and in a step."""
ROWS, BAR_ROWS = 33, 29
"""Rows of scratch memory for a step, and for its adjoint besides, as in rod.h and adjoint.h."""
EVERY = {True: 1, False: 32}
"""Steps between the states that are kept for the adjoint, which computes those between again, on a GPU and on a CPU."""
THREADS = 384
"""Threads of a block on a GPU, as in lanes.h."""
LANES = {True: 1, False: 16}
"""Candidates in one group, on a GPU and on a CPU."""

_FOLDER = Path(__file__).parent
_INCLUDED = '#include "step.h"'
_HEADERS = ("lanes.h", "numbers.h", "laws.h", "walls.h", "acting.h", "rod.h", "adjoint.h", "own.h", "step.h")


def _options(laws: str) -> wp.ModuleBuildOptions:
    return wp.ModuleBuildOptions(
        extra_cpu_include_dirs=[_FOLDER],
        extra_cuda_include_dirs=[_FOLDER],
        extra_cpu_preamble=laws + _INCLUDED,
        extra_cuda_preamble=laws + _INCLUDED,
        extra_build_dependencies=[_FOLDER / name for name in _HEADERS],
    )


_HERE = """
    using namespace rods;
    const int n = start.shape[2], last = start.shape[0] - 1, first = group * WIDTH;
    const Numbers k = *(const Numbers*)numbers.data;
    Lanes* const base = memory_of((float*)scratch.data, slot, (ROWS + BAR_ROWS) * n + TRAITS * SUMS + FINGER);
    const Rod r = {base, n};
    const auto one = [&](const wp::array_t<float>& a, int row, int i) {
        return (float*)a.data + (long long)row * a.shape[2] + i;
    };
    const auto stride = [&](const wp::array_t<float>& a) { return a.shape[1] * a.shape[2]; };
"""
_TRAITS = """
    Traits c;
    {
        const float* from = (const float*)traits.data;
        Lanes* const each = (Lanes*)&c;
        for (int m = 0; m < TRAITS; m++) each[m] = gather(from + m, first, last, TRAITS);
    }
    const auto finger_at = [&](int s) {
        const float *now = one(tool, s, 0), *then = one(tool, s + 1, 0);
        const int w = stride(tool);
        Finger u;
        u.x = gather(then, first, last, w); u.y = gather(then + 1, first, last, w);
        u.vx = (u.x - gather(now, first, last, w)) / k.dt; u.vy = (u.y - gather(now + 1, first, last, w)) / k.dt;
        u.reach = gather(then + 2, first, last, w); u.sine = gather(then + 3, first, last, w);
        return u;
    };
"""


@wp.func_native(
    _HERE
    + """
    AS(0) EACH(i, 0, n) {
        for (int row = 0; row < STATE; row++)
            base[row * n + i] = gather(one(start, row, i), first, last, stride(start));
        r.mass()[i] = gather(one(fields, 0, i), first, last, stride(fields));
        r.bending()[i] = gather(one(fields, 1, i), first, last, stride(fields));
        r.curved()[i] = gather(one(fields, 2, i), first, last, stride(fields));
        r.x0(0)[i] = r.x(0)[i]; r.x0(1)[i] = r.x(1)[i];
        r.around(0)[i] = r.around(1)[i] = r.sn()[i] = r.share()[i] = r.press()[i] = Lanes{};
    }
    ALL_TOGETHER();
""",
)
def load_start(
    group: int,
    slot: int,
    numbers: wp.array[float],
    start: wp.array3d[float],
    fields: wp.array3d[float],
    scratch: wp.array[float],
):
    """A group's states and fields into its slot."""


@wp.func_native(
    _HERE
    + _TRAITS
    + """
    const Finger u = finger_at(s);
    find_forces(r, k, c, u);
    advance(r, k, c, (const float*)smoother.data);
"""
)
def step(
    group: int,
    slot: int,
    s: int,
    numbers: wp.array[float],
    smoother: wp.array[float],
    start: wp.array3d[float],
    traits: wp.array[float],
    tool: wp.array3d[float],
    scratch: wp.array[float],
):
    """One time step."""


@wp.func_native(
    _HERE
    + """
    Lanes* const to = (Lanes*)kept.data + ((long long)which * rows + row) * STATE * n;
    AS(0) EACH(i, 0, STATE * n) to[i] = base[i];
    ALL_TOGETHER();
"""
)
def keep(
    group: int,
    slot: int,
    which: int,
    rows: int,
    row: int,
    numbers: wp.array[float],
    start: wp.array3d[float],
    scratch: wp.array[float],
    kept: wp.array[float],
):
    """Write the state to a row of the history."""


@wp.func_native(
    _HERE
    + """
    const Lanes* const from = (const Lanes*)kept.data + ((long long)which * rows + row) * STATE * n;
    AS(0) EACH(i, 0, STATE * n) base[i] = from[i];
    ALL_TOGETHER();
"""
)
def restore(
    group: int,
    slot: int,
    which: int,
    rows: int,
    row: int,
    numbers: wp.array[float],
    start: wp.array3d[float],
    scratch: wp.array[float],
    kept: wp.array[float],
):
    """Read the state from a row of the history."""


@wp.func_native(
    _HERE
    + """
    AS(0) EACH(i, 0, n)
        for (int row = 0; row < STATE; row++) scatter(one(end, row, i), first, last, stride(end), base[row * n + i]);
"""
)
def store_end(
    group: int,
    slot: int,
    numbers: wp.array[float],
    start: wp.array3d[float],
    scratch: wp.array[float],
    end: wp.array3d[float],
):
    """A group's states out of its slot."""


@wp.func_native(
    _HERE
    + """
    const Bars o = {base + ROWS * n, n};
    AS(0) EACH(i, 0, n) {
        for (int row = 0; row < BAR_ROWS; row++) o.row(row)[i] = Lanes{};
        for (int row = 0; row < STATE; row++)
            o.row(row)[i] = gather(one(end_bar, row, i), first, last, stride(end_bar));
    }
    AS(0) EACH(m, 0, TRAITS * SUMS + FINGER) o.traits()[m] = Lanes{};
    ALL_TOGETHER();
"""
)
def load_bars(
    group: int,
    slot: int,
    numbers: wp.array[float],
    start: wp.array3d[float],
    scratch: wp.array[float],
    end_bar: wp.array3d[float],
):
    """Cotangents of the last state; those of sums are none so far."""


@wp.func_native(
    _HERE
    + _TRAITS
    + """
    const Bars o = {base + ROWS * n, n};
    const Finger u = finger_at(s);
    find_forces(r, k, c, u);
    AS(0) find_changes(r, k, c);
    step_adjoint(r, o, k, c, u, (const float*)smoother.data);
    // To the finger at the end of the step; and at its beginning, which its velocity depends on.
    AS(1) EACH(m, 0, FINGER) {
        const Lanes* const bar = o.finger();
        const Lanes a = m < 2 ? bar[m] + bar[2 + m] / k.dt : m < 4 ? bar[2 + m] : -bar[m - 2] / k.dt;
        float* const to = m < 4 ? one(tool_bar, s + 1, m) : one(tool_bar, s, m - 4);
        const int w = stride(tool_bar);
        scatter(to, first, last, w, gather(to, first, last, w) + a);
    }
    AS(1) TOGETHER();
    AS(1) EACH(m, 0, FINGER) o.finger()[m] = Lanes{};
"""
)
def step_adjoint(
    group: int,
    slot: int,
    s: int,
    numbers: wp.array[float],
    smoother: wp.array[float],
    start: wp.array3d[float],
    traits: wp.array[float],
    tool: wp.array3d[float],
    scratch: wp.array[float],
    tool_bar: wp.array3d[float],
):
    """The adjoint of a step, from the state at its beginning."""


@wp.func_native(
    _HERE
    + """
    const Bars o = {base + ROWS * n, n};
    AS(0) EACH(i, 0, n) {
        for (int row = 0; row < STATE; row++)
            scatter(one(start_bar, row, i), first, last, stride(start_bar), o.row(row)[i]);
        scatter(one(fields_bar, 0, i), first, last, stride(fields_bar), o.mass()[i]);
        scatter(one(fields_bar, 1, i), first, last, stride(fields_bar), o.bending()[i]);
        scatter(one(fields_bar, 2, i), first, last, stride(fields_bar), o.curved()[i]);
    }
    AS(0) EACH(m, 0, TRAITS) scatter((float*)traits_bar.data + m, first, last, TRAITS, sum_of(o.traits(), m));
"""
)
def store_bars(
    group: int,
    slot: int,
    numbers: wp.array[float],
    start: wp.array3d[float],
    scratch: wp.array[float],
    start_bar: wp.array3d[float],
    fields_bar: wp.array3d[float],
    traits_bar: wp.array[float],
):
    """Cotangents of the first state, of the fields and of the traits."""


@final
@dataclass(frozen=True, kw_only=True)
class RodKernels:
    """Whole actions of one group of candidates."""

    module: wp.Module
    forward: wp.Kernel
    adjoint: wp.Kernel


@functools.cache
def rod_kernels(*, on_gpu: bool, laws: str = "") -> RodKernels:
    """Kernels with these laws of effects (`laws.law_source`). They are compiled at the first launch, or in warm-up."""
    every = EVERY[on_gpu]
    code = f"_{sha256(laws.encode()).hexdigest()[:10]}" if laws else ""
    module = wp.get_module(f"dipac_rods_{'gpu' if on_gpu else 'cpu'}{code}")
    module.options["extra_build_options"] = _options(laws)
    module.options["fast_math"] = on_gpu  # A block waits for its divisions and roots; on a CPU they come in sixteens.

    @wp.kernel(module=module, enable_backward=False, launch_bounds=THREADS)
    def forward(
        first_group: int,
        first_slot: int,
        numbers: wp.array[float],
        smoother: wp.array[float],
        start: wp.array3d[float],
        fields: wp.array3d[float],
        traits: wp.array[float],
        tool: wp.array3d[float],
        spans: wp.array2d[int],
        scratch: wp.array[float],
        kept: wp.array[float],
        rows: int,
        apart: int,
        end: wp.array3d[float],
    ):
        at = wp.tid() // wp.static(THREADS)
        group = first_group + at
        slot = first_slot + at
        load_start(group, slot, numbers, start, fields, scratch)
        for s in range(spans[group, 0], spans[group, 1]):
            if rows > 0 and s % apart == 0:
                keep(group, slot, group, rows, s // apart, numbers, start, scratch, kept)
            step(group, slot, s, numbers, smoother, start, traits, tool, scratch)
        store_end(group, slot, numbers, start, scratch, end)

    @wp.kernel(module=module, enable_backward=False, launch_bounds=THREADS)
    def adjoint(
        first_group: int,
        first_slot: int,
        numbers: wp.array[float],
        smoother: wp.array[float],
        start: wp.array3d[float],
        fields: wp.array3d[float],
        traits: wp.array[float],
        tool: wp.array3d[float],
        scratch: wp.array[float],
        kept: wp.array[float],
        rows: int,
        between: wp.array[float],
        end_bar: wp.array3d[float],
        start_bar: wp.array3d[float],
        fields_bar: wp.array3d[float],
        traits_bar: wp.array[float],
        tool_bar: wp.array3d[float],
    ):
        at = wp.tid() // wp.static(THREADS)
        group = first_group + at
        slot = first_slot + at
        load_start(group, slot, numbers, start, fields, scratch)
        load_bars(group, slot, numbers, start, scratch, end_bar)
        steps = tool.shape[1] - 1
        for later in range(rows):
            row = rows - 1 - later
            begin = row * wp.static(every)
            count = wp.min(wp.static(every), steps - begin)
            restore(group, slot, group, rows, row, numbers, start, scratch, kept)
            if wp.static(every > 1):
                for m in range(count):
                    keep(group, slot, slot, wp.static(every), m, numbers, start, scratch, between)
                    if m < count - 1:
                        step(group, slot, begin + m, numbers, smoother, start, traits, tool, scratch)
            for back in range(count):
                m = count - 1 - back
                if wp.static(every > 1):
                    restore(group, slot, slot, wp.static(every), m, numbers, start, scratch, between)
                step_adjoint(group, slot, begin + m, numbers, smoother, start, traits, tool, scratch, tool_bar)
        store_bars(group, slot, numbers, start, scratch, start_bar, fields_bar, traits_bar)

    return RodKernels(module=module, forward=forward, adjoint=adjoint)
