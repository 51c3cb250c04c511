// A whole time step forth and back, and what moves between candidates in memory and lanes.
#pragma once
#include "own.h"

namespace rods {

#if defined(__CUDA_ARCH__)
// Both rows of g times the dense S, by all teams: four threads a number.
ROD_CALL void smooth(const float* S, const Lanes* g, Lanes* out, int n) {
    const int quarter = threadIdx.x % 4;
    for (int first = 0; first < 2 * n; first += THREADS / 4) {
        const int e = first + threadIdx.x / 4, row = e < n ? 0 : n, i = e - row;
        float sum = 0.0f;
        if (e < 2 * n) {
#pragma unroll 4
            for (int m = quarter; m < n; m += 4) sum += S[m * n + i] * g[row + m];
        }
        sum += __shfl_xor_sync(0xffffffffu, sum, 1);
        sum += __shfl_xor_sync(0xffffffffu, sum, 2);
        if (quarter == 0 && e < 2 * n) out[e] = sum;
    }
    ALL_TOGETHER();
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
    AS(0) { find_edges(r); find_elastic_forces(r, k, c); }
    AS_TOO(1) find_edges(r);  // The same, sooner than they would be waited for.
    AS(1) find_finger_forces(r, k, c, u);
    AS(2) find_own_forces(r, k, c);
    ALL_TOGETHER();
}

// From the forces to the next state.
ROD_CALL void advance(const Rod& r, const Numbers& k, const Traits& c, const float* smoother) {
    AS(0) { find_changes(r, k, c); change_velocities(r, k, c); }
    ALL_TOGETHER();
    smooth(smoother, r.g(0), r.f(0), r.n);  // The forces have been used.
    AS(0) EACH(i, 0, r.n) {
        for (int a = 0; a < 2; a++) {
            const Lanes v = r.v(a)[i] + r.f(a)[i];
            r.v(a)[i] = v;
            r.x(a)[i] += k.dt * v;
            r.z(a)[i] = r.zn(a)[i];
        }
        r.s()[i] = r.sn()[i]; r.p()[i] = r.pn()[i];
    }
    ALL_TOGETHER();
}

// Each thread's numbers to sums: threads of the first team have one each, the others, most of them without any, share.
ROD_CALL void add_sums(Lanes* sums, const Lanes* each, int count) {
    for (int m = 0; m < count; m++) {
#if defined(__CUDA_ARCH__)
        float* const of = sums + m * SUMS;
        if (team() == 0) of[threadIdx.x] += each[m];
        else if (each[m] != 0.0f) atomicAdd(of + SUMS - 1, each[m]);
#else
        sums[m] += each[m];
#endif
    }
}

ROD_CALL Lanes sum_of(const Lanes* sums, int number) {
    Lanes a = {};
    for (int w = 0; w < SUMS; w++) a += sums[number * SUMS + w];
    return a;
}

// Bars of the state at the end of a step to those at its beginning, and of traits and finger besides; `r` holds the
// beginning and what `find_changes` found.
ROD_CALL void step_adjoint(const Rod& r, const Bars& o, const Numbers& k, const Traits& c, const Finger& u, const float* smoother) {
    Traits sum = {};
    AS(0) EACH(i, 0, r.n) for (int a = 0; a < 2; a++) o.v(a)[i] += k.dt * o.x(a)[i];
    ALL_TOGETHER();
    smooth(smoother, o.v(0), o.g(0), r.n);
    AS(0) { velocities_adjoint(r, o, k, c, sum); nodes_adjoint(r, o, k, c, sum); }
    ALL_TOGETHER();
    AS(0) elastic_adjoint(r, o, k, c, sum);
    AS(1) finger_adjoint(r, o, k, c, u, sum);
    AS(2) own_adjoint(r, o, k, c, sum);
    ALL_TOGETHER();
    AS(0) gather_adjoint(r, o, k);
    add_sums(o.traits(), (const Lanes*)&sum, TRAITS);
    ALL_TOGETHER();
}

#if defined(__CUDA_ARCH__)
ROD_CALL Lanes gather(const float* from, int first, int, int stride) { return from[(long long)first * stride]; }
ROD_CALL void scatter(float* to, int first, int, int stride, Lanes a) { to[(long long)first * stride] = a; }
#else
ROD_CALL Lanes gather(const float* from, int first, int last, int stride) {
    Lanes a;
    for (int w = 0; w < WIDTH; w++) a[w] = from[(long long)(first + w < last ? first + w : last) * stride];
    return a;
}
ROD_CALL void scatter(float* to, int first, int last, int stride, Lanes a) {
    for (int w = 0; w < WIDTH && first + w <= last; w++) to[(long long)(first + w) * stride] = a[w];
}
#endif

}  // namespace rods
