"""Native code that the transfers between particles and grid share: vectors of four, the 27 nodes around a particle.

Notation: q the position in cells from the node (0, 0, 0), f = q minus the first of the three nodes along each axis.
"""

import re

from app.sim.constants import BLOCK_SHIFT

ABREAST = 10
"""Particles of a warp whose threads share them: number 10 i + p of its 32 has plane i of particle p; two are idle."""


def in_blocks(code: str) -> str:
    """Native code with the shape of a block filled in: its shifts SX SY SZ and masks MX MY MZ."""
    for axis, shift in zip("XYZ", BLOCK_SHIFT, strict=True):
        code = code.replace(f"S{axis}", str(shift)).replace(f"M{axis}", str(2**shift - 1))
    return code


def one_thread(code: str) -> str:
    """Native code of a thread that has all nodes around a particle.

    `code` is of plane i of the three planes of nodes across x: EACH_PLANE(step) is the loop over them,
    ADD_PLANES(out, n) comes after it, and RUN_BEGINS says which threads of a warp begin a run in any case.
    """
    code = re.sub(r"EACH_PLANE\(\)", '_Pragma("unroll") for (int i = 0; i < 3; i++)', code)
    code = re.sub(r"EACH_PLANE\((.+?)\)", r'_Pragma("unroll") for (int i = 0; i < 3; i++, \1)', code)
    return re.sub(r"ADD_PLANES\(.+?\);", "", code).replace("RUN_BEGINS", "lane == 0")


def three_threads(code: str) -> str:
    """The same of three threads of a warp, one a plane, each of which returns what all three have found."""
    one = "for (int i = plane, once = 1; once; once = 0)"
    code = re.sub(r"EACH_PLANE\(\)", one, code)
    code = re.sub(r"EACH_PLANE\((\w+) \+= (\w+)\)", rf"\1 += \2 * (float)plane; {one}", code)
    code = re.sub(r"\b([wos]x)\[i\]", r"(plane == 0 ? \1[0] : plane == 1 ? \1[1] : \1[2])", code)
    return _PLANES + code.replace("RUN_BEGINS", f"lane % {ABREAST} == 0")


_PLANES = f"""
#if defined(__CUDA_ARCH__)
    const int plane = (threadIdx.x & 31) / {ABREAST}, abreast = (threadIdx.x & 31) % {ABREAST};
    const unsigned three = (1u | 1u << {ABREAST} | 1u << {2 * ABREAST}) << abreast;
    #define ADD_PLANES(out, n) do {{ _Pragma("unroll") for (int _c = 0; _c < (n); _c++) \\
        (out)[_c] = __shfl_sync(three, (out)[_c], abreast) + __shfl_sync(three, (out)[_c], abreast + {ABREAST}) \\
            + __shfl_sync(three, (out)[_c], abreast + {2 * ABREAST}); }} while (0)
#else
    const int plane = 0;
    #define ADD_PLANES(out, n)
#endif
"""


VECTOR = """
#if defined(__CUDA_ARCH__)
    struct __align__(16) f4 {
        float c[4];
        CUDA_CALLABLE f4 operator+(const f4& o) const { return {c[0]+o.c[0], c[1]+o.c[1], c[2]+o.c[2], c[3]+o.c[3]}; }
        CUDA_CALLABLE f4 operator-(const f4& o) const { return {c[0]-o.c[0], c[1]-o.c[1], c[2]-o.c[2], c[3]-o.c[3]}; }
        CUDA_CALLABLE f4 operator*(const f4& o) const { return {c[0]*o.c[0], c[1]*o.c[1], c[2]*o.c[2], c[3]*o.c[3]}; }
        CUDA_CALLABLE f4 operator*(float s) const { return {c[0]*s, c[1]*s, c[2]*s, c[3]*s}; }
        CUDA_CALLABLE f4& operator+=(const f4& o) { *this = *this + o; return *this; }
        CUDA_CALLABLE float operator[](int i) const { return c[i]; }
    };
#else
    typedef float f4 __attribute__((vector_size(16), aligned(16)));
#endif
#if defined(__CUDA_ARCH__) && __CUDA_ARCH__ >= 900
    #define ADD_TO(node, value) do { const f4 _a = (value); asm volatile("red.global.add.v4.f32 [%0], {%1,%2,%3,%4};" \\
        :: "l"(&(node)), "f"(_a[0]), "f"(_a[1]), "f"(_a[2]), "f"(_a[3]) : "memory"); } while (0)
#elif defined(__CUDA_ARCH__)
    #define ADD_TO(node, value) do { const f4 _a = (value); float* _n = (float*)&(node); \\
        for (int _c = 0; _c < 4; _c++) atomicAdd(_n + _c, _a[_c]); } while (0)
#else
    #define ADD_TO(node, value) (node) += (value)
#endif
    #define NODES(array) ((f4*)(array).data + (long long)slot * (array).shape[1])
    #define SUM(a) ((a)[0] + (a)[1] + (a)[2] + (a)[3])
"""
"""Four floats, their sum over nodes, and the nodes of a slot."""

RUNS = """
#if defined(__CUDA_ARCH__)
    const unsigned here = __activemask(), lane = threadIdx.x & 31;
    const int cell = i0 << 20 | j0 << 10 | k0, cell_before = __shfl_up_sync(here, cell, 1);
    const bool first = RUN_BEGINS || !(here >> (lane - 1) & 1) || cell_before != cell;
    const unsigned after = (__ballot_sync(here, first) | ~here) & ~((2u << lane) - 1u);
    const int left = (after ? __ffs(after) - 1 : 32) - (int)lane;
    const int longest = __reduce_max_sync(here, left);
    #define ADD_ROW(row, one, two, three) do { \\
        f4 _s[3] = {one, two, three}; \\
        for (int _step = 1; _step < longest; _step *= 2) { \\
            f4 _o[3]; \\
            _Pragma("unroll") for (int _n = 0; _n < 3; _n++) \\
                _Pragma("unroll") for (int _c = 0; _c < 4; _c++) \\
                    _o[_n].c[_c] = __shfl_down_sync(here, _s[_n].c[_c], _step); \\
            if (_step < left) { _s[0] += _o[0]; _s[1] += _o[1]; _s[2] += _o[2]; } \\
        } \\
        if (first) { ADD_TO((row)[oz[0]], _s[0]); ADD_TO((row)[oz[1]], _s[1]); ADD_TO((row)[oz[2]], _s[2]); } \\
    } while (0)
#else
    #define ADD_ROW(row, one, two, three) do { \\
        ADD_TO((row)[oz[0]], one); ADD_TO((row)[oz[1]], two); ADD_TO((row)[oz[2]], three); } while (0)
#endif
"""
"""Additions to a row of nodes by a whole run of a warp's threads at once: those in a row whose particles share a cell.

A GPU's second-level cache adds one number at a time; particles that are sorted by place (`order`) need a fraction of
the additions. `left` counts the threads of the run from this one on.
"""

STENCIL = in_blocks(
    """
    const int i0 = (int)(q[0] - 0.5f), j0 = (int)(q[1] - 0.5f), k0 = (int)(q[2] - 0.5f);
    const float fx = q[0] - i0, fy = q[1] - j0, fz = q[2] - k0;
    const float wx[3] = {0.5f*(1.5f-fx)*(1.5f-fx), 0.75f-(fx-1.0f)*(fx-1.0f), 0.5f*(fx-0.5f)*(fx-0.5f)};
    const float wy[3] = {0.5f*(1.5f-fy)*(1.5f-fy), 0.75f-(fy-1.0f)*(fy-1.0f), 0.5f*(fy-0.5f)*(fy-0.5f)};
    const float wz[3] = {0.5f*(1.5f-fz)*(1.5f-fz), 0.75f-(fz-1.0f)*(fz-1.0f), 0.5f*(fz-0.5f)*(fz-0.5f)};
    int ox[3], oy[3], oz[3];
    #pragma unroll
    for (int n = 0; n < 3; n++) {
        ox[n] = (((i0 + n) >> SX) * blocks_y * blocks_z << (SX + SY + SZ)) + (((i0 + n) & MX) << (SY + SZ));
        oy[n] = (((j0 + n) >> SY) * blocks_z << (SX + SY + SZ)) + (((j0 + n) & MY) << SZ);
        oz[n] = (((k0 + n) >> SZ) << (SX + SY + SZ)) + ((k0 + n) & MZ);
    }
"""
)
"""Weights and places of the nodes along each axis: node (i, j, k) of the 27 lies at ox[i] + oy[j] + oz[k]."""

SLOPES = """
    const float sx[3] = {fx - 1.5f, -2.0f * (fx - 1.0f), fx - 0.5f};
    const float sy[3] = {fy - 1.5f, -2.0f * (fy - 1.0f), fy - 0.5f};
    const float sz[3] = {fz - 1.5f, -2.0f * (fz - 1.0f), fz - 0.5f};
"""
"""Derivatives of the weights with respect to f."""


NEARBY = in_blocks(
    """
    const int i0 = (int)(q[0] - 0.5f), j0 = (int)(q[1] - 0.5f), k0 = (int)(q[2] - 0.5f);
    const int i1 = (i0 + 2) >> SX, j1 = (j0 + 2) >> SY, k1 = (k0 + 2) >> SZ;
    int blocks[8];
    bool own[8];
    #pragma unroll
    for (int n = 0; n < 8; n++) {
        const int i = (n & 4) ? i1 : i0 >> SX, j = (n & 2) ? j1 : j0 >> SY, k = (n & 1) ? k1 : k0 >> SZ;
        blocks[n] = (i * blocks_y + j) * blocks_z + k;
        own[n] = !((n & 4) && i1 == (i0 >> SX)) && !((n & 2) && j1 == (j0 >> SY)) && !((n & 1) && k1 == (k0 >> SZ));
    }
"""
)
"""The blocks around a particle: those of the eight that are `own` are one to eight different ones."""
