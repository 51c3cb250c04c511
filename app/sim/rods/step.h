// A whole time step forth and back, and what moves between candidates in memory and lanes.
#pragma once
#include "own.h"

namespace rods {

#if defined(__CUDA_ARCH__)
// Both rows of g times the dense S: a thread a node.
ROD_CALL void smooth(const float* S, const Lanes* g, Lanes* out, int n) {
    EACH(i, 0, n) {
        float x = 0.0f, y = 0.0f;
#pragma unroll 8
        for (int m = 0; m < n; m++) { const float w = S[m * n + i]; x += w * g[m]; y += w * g[n + m]; }
        out[i] = x; out[n + i] = y;
    }
    TOGETHER();
}
#else
// Both rows of g times S, by the factors L D L^T of its inverse, which has two bands beside its diagonal.
ROD_CALL void smooth(const float* L, const Lanes* g, Lanes* out, int n) {
    const float *d = L, *a = L + n, *b = L + 2 * n;
    Lanes x1 = {}, y1 = {}, x2 = {}, y2 = {};
    for (int i = 0; i < n; i++) {
        const Lanes x = g[i] - a[i] * x1 - b[i] * x2, y = g[n + i] - a[i] * y1 - b[i] * y2;
        out[i] = x; out[n + i] = y;
        x2 = x1; y2 = y1; x1 = x; y1 = y;
    }
    x1 = y1 = x2 = y2 = Lanes{};
    for (int i = n - 1; i >= 0; i--) {
        const float a1 = i + 1 < n ? a[i + 1] : 0.0f, b2 = i + 2 < n ? b[i + 2] : 0.0f;
        const Lanes x = out[i] * d[i] - a1 * x1 - b2 * x2, y = out[n + i] * d[i] - a1 * y1 - b2 * y2;
        out[i] = x; out[n + i] = y;
        x2 = x1; y2 = y1; x1 = x; y1 = y;
    }
}
#endif

ROD_CALL void find_forces(const Rod& r, const Numbers& k, const Traits& c, const Finger& u) {
    find_edges(r);
    find_elastic_forces(r, k, c);
    find_finger_forces(r, k, c, u);
    find_own_forces(r, k, c);
}

// From the changes to the next state.
ROD_CALL void advance(const Rod& r, const Numbers& k, const float* smoother) {
    smooth(smoother, r.g(0), r.f(0), r.n);  // The forces have been used.
    EACH(i, 0, r.n) {
        for (int a = 0; a < 2; a++) {
            const Lanes v = r.v(a)[i] + r.f(a)[i];
            r.v(a)[i] = v;
            r.x(a)[i] += k.dt * v;
            r.z(a)[i] = r.zn(a)[i];
        }
        r.s()[i] = r.sn()[i]; r.p()[i] = r.pn()[i];
    }
    TOGETHER();
}

// Bars of the state at the end of a step to those at its beginning; `r` holds the beginning and what `find_changes`
// found.
ROD_CALL void step_adjoint(const Rod& r, const Bars& o, const Numbers& k, const Traits& c, const Finger& u, const float* smoother, Traits& sum, Finger& bar) {
    EACH(i, 0, r.n) for (int a = 0; a < 2; a++) o.v(a)[i] += k.dt * o.x(a)[i];
    TOGETHER();
    smooth(smoother, o.v(0), o.g(0), r.n);
    velocities_adjoint(r, o, k, c, sum);
    nodes_adjoint(r, o, k, c, sum);
    own_adjoint(r, o, k, c, sum);
    segments_adjoint(r, o, k, c, u, sum, bar);
}

#if defined(__CUDA_ARCH__)
ROD_CALL Lanes gather(const float* from, int first, int, int stride) { return from[(long long)first * stride]; }
ROD_CALL void scatter(float* to, int first, int, int stride, Lanes a) { to[(long long)first * stride] = a; }
// The sum over the threads of a block, for its first one.
ROD_CALL Lanes over_nodes(Lanes a) {
    __shared__ float of_warp[THREADS / 32];
    for (int o = 16; o > 0; o /= 2) a += __shfl_xor_sync(0xffffffffu, a, o);
    if ((threadIdx.x & 31) == 0) of_warp[threadIdx.x / 32] = a;
    __syncthreads();
    a = 0.0f;
    for (int w = 0; w < THREADS / 32; w++) a += of_warp[w];
    __syncthreads();
    return a;
}
#else
ROD_CALL Lanes gather(const float* from, int first, int last, int stride) {
    Lanes a;
    for (int w = 0; w < WIDTH; w++) a[w] = from[(long long)(first + w < last ? first + w : last) * stride];
    return a;
}
ROD_CALL void scatter(float* to, int first, int last, int stride, Lanes a) {
    for (int w = 0; w < WIDTH && first + w <= last; w++) to[(long long)(first + w) * stride] = a[w];
}
ROD_CALL Lanes over_nodes(Lanes a) { return a; }
#endif

}  // namespace rods
