// Contact of the rope with itself: nodes against segments that are not their neighbours.
#pragma once
#include "adjoint.h"

namespace rods {

constexpr int APART = 5;   // Segments nearer along the rope than this one do not touch.
constexpr int PIECE = 8;   // Nodes of a piece: pieces that are far from one another are passed over as a whole.

// How node i and segment j meet.
struct Touch {
    Lanes along, share, gx, gy, distance, ox, oy, depth, mx, my, approach, ramp, normal, slip, bound, fade, rub;
    Mask inside, touching;
};

// Strands that are seen nearer than they can be do not spring apart: the distance at the start is enough.
ROD_CALL Lanes room_of(const Rod& r, int i, int j, float thickness) {
    const Lanes ex = r.x0(0)[j + 1] - r.x0(0)[j], ey = r.x0(1)[j + 1] - r.x0(1)[j];
    const Lanes ax = r.x0(0)[i] - r.x0(0)[j], ay = r.x0(1)[i] - r.x0(1)[j];
    const Lanes share = clipped((ax * ex + ay * ey) / (ex * ex + ey * ey), Lanes{}, all_of(1.0f));
    const Lanes gx = ax - ex * share, gy = ay - ey * share;
    return smaller(all_of(thickness), root(gx * gx + gy * gy));
}

ROD_CALL bool find_touch(const Rod& r, int i, int j, const Numbers& k, const Traits& c, Touch& m) {
    const Lanes ex = r.x(0)[j + 1] - r.x(0)[j], ey = r.x(1)[j + 1] - r.x(1)[j];
    const Lanes ax = r.x(0)[i] - r.x(0)[j], ay = r.x(1)[i] - r.x(1)[j];
    m.along = (ax * ex + ay * ey) / (ex * ex + ey * ey);
    m.share = clipped(m.along, Lanes{}, all_of(1.0f));
    m.gx = ax - ex * m.share; m.gy = ay - ey * m.share;
    const Lanes square = m.gx * m.gx + m.gy * m.gy;
    if (!any(square < k.thickness * k.thickness)) return false;
    m.distance = root(square + 1e-12f);
    m.depth = room_of(r, i, j, k.thickness) - m.distance;
    m.touching = m.depth > 0.0f;
    if (!any(m.touching)) return false;
    m.ox = m.gx / m.distance; m.oy = m.gy / m.distance;
    m.mx = r.v(0)[i] - r.v(0)[j] - (r.v(0)[j + 1] - r.v(0)[j]) * m.share;
    m.my = r.v(1)[i] - r.v(1)[j] - (r.v(1)[j + 1] - r.v(1)[j]) * m.share;
    m.approach = m.mx * m.ox + m.my * m.oy;
    m.ramp = smaller(m.depth / k.onset, all_of(1.0f));
    const Lanes pushed = k.own * m.depth - k.own_damping * m.approach * m.ramp;
    m.inside = m.touching & (pushed > 0.0f);
    m.normal = either(m.inside, pushed, Lanes{});
    m.slip = m.my * m.ox - m.mx * m.oy;
    // Friction that grows with slip up to the bound of Coulomb.
    m.bound = c.table_friction * m.normal + 1e-9f;
    const Lanes wanted = k.own_damping * root(m.slip * m.slip + 1e-12f);
    m.fade = m.bound / (m.bound + wanted);
    m.rub = k.own_damping * m.slip * m.fade;
    return true;
}

#if !defined(__CUDA_ARCH__)
// Whether any node is near one that is `lag` nodes farther, or near the `beside` before and after that.
ROD_CALL bool is_near(const Rod& r, int lag, float beside, const Numbers& k) {
    const float reach = k.thickness + beside * k.rest;
    Mask near = {};
    EACH(i, 0, r.n - lag) {
        const Lanes x = r.x(0)[i + lag] - r.x(0)[i], y = r.x(1)[i + lag] - r.x(1)[i];
        near |= x * x + y * y < reach * reach;
    }
    return any(near);
}
#endif

// Calls `each(i, j)` for nodes i and segments j that may touch.
template <typename Each>
ROD_CALL void near_pairs(const Rod& r, const Numbers& k, Each each) {
    const int n = r.n;
#if defined(__CUDA_ARCH__)
    // Threads of a warp are nodes, its turns are segments; that none is near is found without waiting for each.
    const float reach = k.thickness + 1.5f * k.rest, square = reach * reach;
    const auto is_near = [&](int i, int j) {
        const float x = r.x(0)[i] - r.x(0)[j], y = r.x(1)[i] - r.x(1)[j];
        return (x * x + y * y < square) & ((i > j ? i - 1 - j : j - i) >= APART);
    };
    const int warp = place_in_team() / WARP, warps = team_size() / WARP;
    for (int i = threadIdx.x % WARP; i < n; i += WARP) {
        bool near = false;
#pragma unroll 6
        for (int j = warp; j < n - 1; j += warps) near |= is_near(i, j);
        if (near)
            for (int j = warp; j < n - 1; j += warps)
                if (is_near(i, j)) each(i, j);
    }
#else
    const int pieces = (n + PIECE - 1) / PIECE;
    const float reach = k.thickness + 1.1f * PIECE * k.rest;
    const bool unfolded = !is_near(r, 7, 2.2f, k) && !is_near(r, 13, 3.3f, k);  // So pieces do not meet their neighbours.
    for (int a = 0; a < pieces; a++)
        for (int b = 0; b < pieces; b++) {
            const int gap = a > b ? a - b : b - a;
            if (gap < 2 && unfolded) continue;
            if (gap > 1) {
                const int ca = a * PIECE + PIECE / 2 < n ? a * PIECE + PIECE / 2 : n - 1;
                const int cb = b * PIECE + PIECE / 2 < n ? b * PIECE + PIECE / 2 : n - 1;
                const Lanes x = r.x(0)[ca] - r.x(0)[cb], y = r.x(1)[ca] - r.x(1)[cb];
                if (!any(x * x + y * y < reach * reach)) continue;
            }
            for (int i = a * PIECE; i < (a + 1) * PIECE && i < n; i++)
                for (int j = b * PIECE; j < (b + 1) * PIECE && j < n - 1; j++)
                    if ((i > j ? i - 1 - j : j - i) >= APART) each(i, j);
        }
#endif
}

ROD_CALL void find_own_forces(const Rod& r, const Numbers& k, const Traits& c) {
    EACH(i, 0, r.n) r.around(0)[i] = r.around(1)[i] = Lanes{};
    TOGETHER();
    near_pairs(r, k, [&](int i, int j) {
        Touch m;
        if (!find_touch(r, i, j, k, c, m)) return;
        const Lanes fx = m.ox * m.normal + m.oy * m.rub, fy = m.oy * m.normal - m.ox * m.rub, rest = 1.0f - m.share;
        add_to(r.around(0)[i], fx); add_to(r.around(1)[i], fy);
        add_to(r.around(0)[j], -fx * rest); add_to(r.around(1)[j], -fy * rest);
        add_to(r.around(0)[j + 1], -fx * m.share); add_to(r.around(1)[j + 1], -fy * m.share);
    });
    TOGETHER();
}

ROD_CALL void own_adjoint(const Rod& r, const Bars& o, const Numbers& k, const Traits& c, Traits& sum) {
    near_pairs(r, k, [&](int i, int j) {
        Touch m;
        if (!find_touch(r, i, j, k, c, m)) return;
        const Lanes zero = {}, rest = 1.0f - m.share;
        const Lanes px = o.f(0)[i] - o.f(0)[j] * rest - o.f(0)[j + 1] * m.share;
        const Lanes py = o.f(1)[i] - o.f(1)[j] * rest - o.f(1)[j + 1] * m.share;
        const Lanes fx = m.ox * m.normal + m.oy * m.rub, fy = m.oy * m.normal - m.ox * m.rub;
        Lanes share = fx * (o.f(0)[j] - o.f(0)[j + 1]) + fy * (o.f(1)[j] - o.f(1)[j + 1]);
        Lanes ox = px * m.normal - py * m.rub, oy = py * m.normal + px * m.rub;
        Lanes normal = px * m.ox + py * m.oy;
        const Lanes rub = px * m.oy - py * m.ox;
        const Lanes slip = rub * k.own_damping * m.fade * m.fade;
        const Lanes bound = rub * k.own_damping * m.slip * (1.0f - m.fade) * m.fade / m.bound;
        normal += bound * c.table_friction;
        sum.table_friction += either(m.inside, bound * m.normal, zero);
        normal = either(m.inside, normal, zero);
        Lanes mx = -slip * m.oy, my = slip * m.ox;
        ox += slip * m.my; oy -= slip * m.mx;
        const Mask shallow = m.depth < k.onset;
        const Lanes depth = normal * (k.own - either(shallow, k.own_damping * m.approach / k.onset, zero));
        const Lanes approach = -normal * k.own_damping * m.ramp;
        mx += approach * m.ox; my += approach * m.oy;
        ox += approach * m.mx; oy += approach * m.my;
        share -= mx * (r.v(0)[j + 1] - r.v(0)[j]) + my * (r.v(1)[j + 1] - r.v(1)[j]);
        const Lanes distance = -depth - (ox * m.gx + oy * m.gy) / (m.distance * m.distance);
        const Lanes gx = ox / m.distance + distance * m.gx / m.distance, gy = oy / m.distance + distance * m.gy / m.distance;
        const Lanes ex = r.x(0)[j + 1] - r.x(0)[j], ey = r.x(1)[j + 1] - r.x(1)[j];
        share -= gx * ex + gy * ey;
        const Mask within = (m.along > 0.0f) & (m.along < 1.0f);
        const Lanes w = either(within, share / (ex * ex + ey * ey), zero);
        const Lanes awx = r.x(0)[i] - r.x(0)[j], awy = r.x(1)[i] - r.x(1)[j];
        const auto kept = [&](Lanes a) { return either(m.inside, a, zero); };
        const Lanes ax = kept(gx + w * ex), ay = kept(gy + w * ey);
        const Lanes bx = kept(w * awx - m.share * gx - 2.0f * w * m.along * ex);
        const Lanes by = kept(w * awy - m.share * gy - 2.0f * w * m.along * ey);
        mx = kept(mx); my = kept(my);
        add_to(o.x(0)[i], ax); add_to(o.x(1)[i], ay);
        add_to(o.x(0)[j], -ax - bx); add_to(o.x(1)[j], -ay - by);
        add_to(o.x(0)[j + 1], bx); add_to(o.x(1)[j + 1], by);
        add_to(o.v(0)[i], mx); add_to(o.v(1)[i], my);
        add_to(o.v(0)[j], -mx * rest); add_to(o.v(1)[j], -my * rest);
        add_to(o.v(0)[j + 1], -mx * m.share); add_to(o.v(1)[j + 1], -my * m.share);
    });
    TOGETHER();
}

}  // namespace rods
