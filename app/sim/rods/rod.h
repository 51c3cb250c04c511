// One time step of a planar elasto-plastic rod that a finger pushes over a table, and its adjoint.
//
// Nodes i = 0 .. n - 1, segments j = 0 .. n - 2 from node j to j + 1. Notation follows docs/rods.md.
#pragma once
#include "acting.h"

namespace rods {

// Of each candidate, the same for all steps.
struct OwnTraits {
    Lanes table_friction, finger_friction, bending_damping, yield_angle, climb, creep, springback;
};

// Seen from above, a flat finger is all within its radius of a core: a line through its middle, half as long as this
// vector [m]. A round one's is a point.
template <bool IS_FLAT> struct CoreTraits { Lanes half_x, half_y; };
template <> struct CoreTraits<false> {};

// And numbers of the laws of effects.
struct Traits : OwnTraits, CoreTraits<FLAT>, LawNumbers<Acting::NUMBERS> {};

// The finger during a step: its place at the end [m], velocity [m/s], the distance at which it meets the centreline [m]
// (0: it is above the rope), and sine of the angle from above at which it does.
struct Finger {
    Lanes x, y, vx, vy, reach, sine;
};

constexpr int STATE = 8, TRAITS = 7 + 2 * FLAT + Acting::NUMBERS, FINGER = 6;
constexpr int ROWS = 33;

// Rows of n lanes each; the first STATE of them are the state.
struct Rod {
    Lanes* base;
    int n;

    ROD_HERE Lanes* row(int number) const { return base + number * n; }
    ROD_HERE Lanes* x(int c) const { return row(c); }           // positions
    ROD_HERE Lanes* v(int c) const { return row(2 + c); }       // velocities
    ROD_HERE Lanes* z(int c) const { return row(4 + c); }       // bristles of the table
    ROD_HERE Lanes* s() const { return row(6); }                // bristle of the finger
    ROD_HERE Lanes* p() const { return row(7); }                // bends about which yield is centred
    ROD_HERE Lanes* mass() const { return row(8); }             // of each node [kg]
    ROD_HERE Lanes* bending() const { return row(9); }          // [N m/rad]
    ROD_HERE Lanes* curved() const { return row(10); }          // rest angle [rad]
    ROD_HERE Lanes* t(int c) const { return row(11 + c); }      // tangents of segments
    ROD_HERE Lanes* length() const { return row(13); }
    ROD_HERE Lanes* spin() const { return row(14); }            // rates of turning
    ROD_HERE Lanes* tension() const { return row(15); }
    ROD_HERE Lanes* moment() const { return row(16); }          // at nodes
    ROD_HERE Lanes* f(int c) const { return row(17 + c); }      // force of a segment on its second node
    ROD_HERE Lanes* push(int c) const { return row(19 + c); }   // force of the finger on a segment
    ROD_HERE Lanes* share() const { return row(21); }           // of it that the second node takes
    ROD_HERE Lanes* press() const { return row(22); }           // of the finger on the table
    ROD_HERE Lanes* zn(int c) const { return row(23 + c); }     // what follows z, s and p
    ROD_HERE Lanes* sn() const { return row(25); }
    ROD_HERE Lanes* pn() const { return row(26); }
    ROD_HERE Lanes* g(int c) const { return row(27 + c); }      // change of velocity before it is smoothed
    ROD_HERE Lanes* around(int c) const { return row(29 + c); } // forces from contacts with itself
    ROD_HERE Lanes* x0(int c) const { return row(31 + c); }     // positions at the start
};

ROD_CALL Lanes angle_between(Lanes ax, Lanes ay, Lanes bx, Lanes by) {
    Lanes u = 2.0f * (ax * by - ay * bx) / larger(1.0f + ax * bx + ay * by, all_of(0.1f)), u2 = u * u;
    return u * (1.0f - u2 * (1.0f / 12 - u2 / 80.0f));
}

ROD_CALL void find_edges(const Rod& r) {
    EACH(j, 0, r.n - 1) {
        const Lanes ex = r.x(0)[j + 1] - r.x(0)[j], ey = r.x(1)[j + 1] - r.x(1)[j];
        const Lanes length = root(ex * ex + ey * ey);
        r.length()[j] = length; r.t(0)[j] = ex / length; r.t(1)[j] = ey / length;
    }
    TOGETHER();
}

// The elastic bend [rad] that the laws of effects leave.
ROD_CALL Lanes kept_bend(Lanes e, const Numbers& k, const Traits& c) {
    if constexpr (Acting::has<OfBend>()) Acting::apply<OfBend>(k, c.law(), nullptr, &e);
    return e;
}

// The mass of an inner node beside which there would be one as heavy as node i.
ROD_CALL Lanes whole_mass(const Rod& r, int i) { return r.mass()[i] * (i == 0 || i == r.n - 1 ? 2.0f : 1.0f); }

// EA of a segment: less where nodes are lighter than the scene's, as explicit steps ask for. The rope hardly stretches.
ROD_CALL auto stretch_of(const Rod& r, int j, const Numbers& k) {
    if constexpr (UNEVEN) {
        const Lanes lighter = smaller(whole_mass(r, j), whole_mass(r, j + 1));
        const Lanes share = smaller(lighter / k.node_mass, all_of(1.0f));
        return k.stretch * share * share;
    } else {
        return k.stretch;
    }
}

// Its derivative by the mass of node i, which is beside node `other` there.
ROD_CALL Lanes stretch_by_mass(const Rod& r, int i, int other, const Numbers& k) {
    const Lanes own = whole_mass(r, i);
    const Mask counts = (own < whole_mass(r, other)) & (own < k.node_mass);
    return either(counts, 2.0f * k.stretch * own * own / (k.node_mass * k.node_mass * r.mass()[i]), Lanes{});
}

// Stretch, and bending with yield (return mapping), whose bend springs back by a share: kinematic hardening.
ROD_CALL void find_elastic_forces(const Rod& r, const Numbers& k, const Traits& c) {
    const int n = r.n;
    EACH(j, 0, n - 1) {
        const Lanes dx = r.v(0)[j + 1] - r.v(0)[j], dy = r.v(1)[j + 1] - r.v(1)[j];
        r.spin()[j] = (r.t(0)[j] * dy - r.t(1)[j] * dx) / r.length()[j];
        r.tension()[j] = stretch_of(r, j, k) * (r.length()[j] / k.rest - 1.0f) + k.stretch_damping * (r.t(0)[j] * dx + r.t(1)[j] * dy);
    }
    TOGETHER();
    EACH(i, 0, n) {
        if (i == 0 || i == n - 1) { r.moment()[i] = Lanes{}; r.pn()[i] = Lanes{}; continue; }
        const Lanes angle = angle_between(r.t(0)[i - 1], r.t(1)[i - 1], r.t(0)[i], r.t(1)[i]);
        const Lanes e = angle - r.curved()[i] - r.p()[i], kept = kept_bend(clipped(e, -c.yield_angle, c.yield_angle), k, c);
        r.pn()[i] = r.p()[i] + e - kept;
        const Lanes beyond = angle - clipped(angle, all_of(-k.tightest), all_of(k.tightest));
        r.moment()[i] = r.bending()[i] * (kept + c.springback * r.pn()[i]) + c.bending_damping * (r.spin()[i] - r.spin()[i - 1]) + k.stop * beyond;
    }
    TOGETHER();
    EACH(j, 0, n - 1) {
        const Lanes q = (r.moment()[j + 1] - r.moment()[j]) / r.length()[j];
        r.f(0)[j] = -r.t(1)[j] * q - r.t(0)[j] * r.tension()[j];
        r.f(1)[j] = r.t(0)[j] * q - r.t(1)[j] * r.tension()[j];
    }
}

// Where a segment meets a flat finger's core: its nearest place there, smooth in how they lie to one another but where
// either ends. Of a segment parallel to the core all is as near, and of one that is nearly parallel an end is nearest; so
// that the place does not jump with it, it is pulled to the segment's middle. `place` is in half vectors from the core's
// middle, `along` in metres from the segment's; `free` ones may be beyond an end.
struct CorePlace {
    Lanes rx, ry, square, te, re, denominator, free_along, along, free_place, place;
};

ROD_CALL CorePlace core_place(const Rod& r, int j, const Numbers& k, const Finger& u, Lanes half_x, Lanes half_y) {
    CorePlace o;
    const Lanes tx = r.t(0)[j], ty = r.t(1)[j], end = 0.5f * r.length()[j];
    o.rx = 0.5f * (r.x(0)[j] + r.x(0)[j + 1]) - u.x;
    o.ry = 0.5f * (r.x(1)[j] + r.x(1)[j + 1]) - u.y;
    o.square = half_x * half_x + half_y * half_y + 1e-12f;
    o.te = tx * half_x + ty * half_y;
    o.re = o.rx * half_x + o.ry * half_y;
    // The least |r + along t - place half|^2 + centring along^2 (Ericson 2005, "Real-Time Collision Detection", 5.1.9).
    o.denominator = 1.0f + k.centring - o.te * o.te / o.square;
    o.free_along = (o.te * o.re / o.square - (tx * o.rx + ty * o.ry)) / o.denominator;
    o.along = clipped(o.free_along, -end, end);
    o.free_place = (o.re + o.along * o.te) / o.square;
    o.place = clipped(o.free_place, all_of(-1.0f), all_of(1.0f));
    return o;
}

// What of the finger's core segment j meets.
struct Met { Lanes x, y; };

template <bool IS_FLAT>
ROD_CALL Met met_by(const Rod& r, int j, const Numbers& k, const CoreTraits<IS_FLAT>& c, const Finger& u) {
    if constexpr (IS_FLAT) {
        const Lanes place = core_place(r, j, k, u, c.half_x, c.half_y).place;
        return {u.x + place * c.half_x, u.y + place * c.half_y};
    } else {
        return {u.x, u.y};
    }
}

// How one segment and the finger meet.
struct Meeting {
    Lanes along, share, gx, gy, distance, ox, oy, depth, mx, my, approach, ramp, normal, slip, any_slip, up, cosine, total, drag;
    Mask inside, touching;
};

ROD_CALL Meeting meet(const Rod& r, int j, const Numbers& k, const Traits& c, const Finger& u, Lanes hop) {
    Meeting m;
    const Met q = met_by(r, j, k, c, u);
    const Lanes ax = q.x - r.x(0)[j], ay = q.y - r.x(1)[j];
    m.along = (ax * r.t(0)[j] + ay * r.t(1)[j]) / r.length()[j];
    m.share = clipped(m.along, Lanes{}, all_of(1.0f));
    m.gx = ax - r.t(0)[j] * (m.share * r.length()[j]);
    m.gy = ay - r.t(1)[j] * (m.share * r.length()[j]);
    m.distance = root(m.gx * m.gx + m.gy * m.gy + 1e-12f);
    m.depth = u.reach - m.distance;
    m.touching = m.depth > 0.0f;
    if (!any(m.touching)) return m;
    m.ox = -m.gx / m.distance; m.oy = -m.gy / m.distance;
    m.mx = r.v(0)[j] + (r.v(0)[j + 1] - r.v(0)[j]) * m.share - u.vx;
    m.my = r.v(1)[j] + (r.v(1)[j + 1] - r.v(1)[j]) * m.share - u.vy;
    m.approach = m.mx * m.ox + m.my * m.oy;
    m.ramp = smaller(m.depth / k.onset, all_of(1.0f));
    const Lanes pushed = k.finger * m.depth - k.finger_damping * m.approach * m.ramp;
    m.inside = pushed > 0.0f;
    m.normal = either(m.touching, larger(pushed, Lanes{}), Lanes{});
    m.slip = m.my * m.ox - m.mx * m.oy;
    m.any_slip = root(m.slip * m.slip + hop * hop + 1e-12f);
    m.up = c.finger_friction * hop / m.any_slip;
    m.cosine = root(1.0f - u.sine * u.sine);
    m.total = m.normal / (m.cosine - m.up * u.sine);
    m.drag = c.finger_friction * m.total + 1e-6f;
    return m;
}

// What hops over the table as it slides slips up and down the finger besides, which takes its share of the friction.
ROD_CALL Lanes hop_of(const Traits& c, const Finger& u) {
    return c.climb * root(u.vx * u.vx + u.vy * u.vy + 1e-12f);
}

ROD_CALL void find_finger_forces(const Rod& r, const Numbers& k, const Traits& c, const Finger& u) {
    const Lanes hop = hop_of(c, u);
    EACH(j, 0, r.n - 1) {
        const Meeting m = meet(r, j, k, c, u, hop);
        r.push(0)[j] = r.push(1)[j] = r.share()[j] = r.press()[j] = r.sn()[j] = Lanes{};
        if (!any(m.touching)) continue;
        // A bristle that relaxes as it slides (Dahl): its force goes to the finger's friction along the slip, smoothly.
        const Lanes bristle = (r.s()[j] + k.dt * m.slip) / (1.0f + k.dt * k.finger * m.any_slip / m.drag);
        const Lanes s = either(m.touching, bristle, Lanes{});
        r.sn()[j] = s;
        r.push(0)[j] = m.ox * m.normal + m.oy * (k.finger * s);
        r.push(1)[j] = m.oy * m.normal - m.ox * (k.finger * s);
        r.share()[j] = m.share;
        r.press()[j] = m.total * (u.sine + m.up * m.cosine);
    }
}

// The forces on node i, and the weight that it puts on the table.
struct Load { Lanes fx, fy, weight; };

ROD_CALL Load load_of(const Rod& r, int i, const Numbers& k) {
    Load o = {r.around(0)[i], r.around(1)[i], r.mass()[i] * k.gravity};
    if (i > 0) {
        o.fx += r.f(0)[i - 1] + r.push(0)[i - 1] * r.share()[i - 1];
        o.fy += r.f(1)[i - 1] + r.push(1)[i - 1] * r.share()[i - 1];
        o.weight += r.press()[i - 1] * r.share()[i - 1];
    }
    if (i < r.n - 1) {
        const Lanes rest = 1.0f - r.share()[i];
        o.fx += r.push(0)[i] * rest - r.f(0)[i];
        o.fy += r.push(1)[i] * rest - r.f(1)[i];
        o.weight += r.press()[i] * rest;
    }
    return o;
}

// The table's Coulomb coefficient under node i.
ROD_CALL Lanes friction_at(const Rod& r, int i, const Numbers& k, const Traits& c) {
    Lanes mu = c.table_friction;
    if constexpr (Acting::has<OfFriction>()) {
        const Lanes given[] = {r.x(0)[i], r.x(1)[i], r.v(0)[i], r.v(1)[i]};
        Acting::apply<OfFriction>(k, c.law(), given, &mu);
    }
    return mu;
}

// Friction of the table (a relaxing bristle, too), and the change of velocity of each node by itself.
ROD_CALL void find_changes(const Rod& r, const Numbers& k, const Traits& c) {
    EACH(i, 0, r.n) {
        const Load o = load_of(r, i, k);
        const Lanes vx = r.v(0)[i], vy = r.v(1)[i], speed = root(vx * vx + vy * vy + c.creep * c.creep + 1e-12f);
        const Lanes limit = friction_at(r, i, k, c) * o.weight + 1e-9f;
        const Lanes relaxed = 1.0f / (1.0f + k.dt * k.table * speed / limit);
        const Lanes zx = (r.z(0)[i] + k.dt * vx) * relaxed, zy = (r.z(1)[i] + k.dt * vy) * relaxed;
        // Damping is for what sticks: what slides would feel more than Coulomb's bound.
        const Lanes rate = (k.table_damping / k.dt) * relaxed, gain = k.dt / r.mass()[i];
        r.zn(0)[i] = zx; r.zn(1)[i] = zy;
        r.g(0)[i] = (o.fx - k.table * zx - rate * (zx - r.z(0)[i])) * gain;
        r.g(1)[i] = (o.fy - k.table * zy - rate * (zy - r.z(1)[i])) * gain;
    }
    TOGETHER();
}

// What the laws of effects make of the velocity that each node would have by itself.
ROD_CALL void change_velocities(const Rod& r, const Numbers& k, const Traits& c) {
    if constexpr (Acting::has<OfVelocity>()) {
        EACH(i, 0, r.n) {
            const Lanes given[] = {r.x(0)[i], r.x(1)[i]};
            const Lanes before[] = {r.v(0)[i] + r.g(0)[i], r.v(1)[i] + r.g(1)[i]};
            Lanes v[] = {before[0], before[1]};
            Acting::apply<OfVelocity>(k, c.law(), given, v);
            for (int a = 0; a < 2; a++) r.g(a)[i] += v[a] - before[a];
        }
        TOGETHER();
    }
}

}  // namespace rods
