// The adjoint of a time step: from the cotangents of what follows to those of what was, by the chain rule, by hand.
#pragma once
#include "rod.h"

namespace rods {

constexpr int BAR_ROWS = 29;
static_assert(ROWS + BAR_ROWS <= MOST_ROWS && TRAITS * SUMS + FINGER <= MOST_SUMS);

// Rows of n lanes each: a bar is a cotangent. The first STATE of them are turned in place from the end of a step to its
// beginning. After the rows stand those of traits, in SUMS of all steps, and of the finger in this one.
struct Bars {
    Lanes* base;
    int n;

    ROD_HERE Lanes* row(int number) const { return base + number * n; }
    ROD_HERE Lanes* x(int c) const { return row(c); }
    ROD_HERE Lanes* v(int c) const { return row(2 + c); }
    ROD_HERE Lanes* z(int c) const { return row(4 + c); }
    ROD_HERE Lanes* s() const { return row(6); }
    ROD_HERE Lanes* p() const { return row(7); }
    ROD_HERE Lanes* mass() const { return row(8); }             // sums over all steps
    ROD_HERE Lanes* bending() const { return row(9); }
    ROD_HERE Lanes* curved() const { return row(10); }
    ROD_HERE Lanes* g(int c) const { return row(11 + c); }      // of the change of velocity
    ROD_HERE Lanes* f(int c) const { return row(13 + c); }      // of the force on a node, and of its weight
    ROD_HERE Lanes* weight() const { return row(15); }
    ROD_HERE Lanes* t(int c) const { return row(16 + c); }
    ROD_HERE Lanes* length() const { return row(18); }
    ROD_HERE Lanes* spin() const { return row(19); }
    ROD_HERE Lanes* moment() const { return row(20); }
    ROD_HERE Lanes* first(int c) const { return row(21 + c); }  // of positions: what a segment gives to its nodes
    ROD_HERE Lanes* second(int c) const { return row(23 + c); }
    ROD_HERE Lanes* vfirst(int c) const { return row(25 + c); } // of velocities likewise
    ROD_HERE Lanes* vsecond(int c) const { return row(27 + c); }
    ROD_HERE Lanes* traits() const { return row(BAR_ROWS); }
    ROD_HERE Lanes* finger() const { return traits() + TRAITS * SUMS; }
};

// From the change of velocity after the laws of effects to the one before; `r` holds the latter.
ROD_CALL void velocities_adjoint(const Rod& r, const Bars& o, const Numbers& k, const Traits& c, Traits& sum) {
    if constexpr (Acting::has<OfVelocity>()) {
        EACH(i, 0, r.n) {
            const Lanes given[] = {r.x(0)[i], r.x(1)[i]};
            const Lanes v[] = {r.v(0)[i] + r.g(0)[i], r.v(1)[i] + r.g(1)[i]};
            Lanes v_bar[] = {o.g(0)[i], o.g(1)[i]}, x_bar[2] = {};
            Acting::apply_adjoint<OfVelocity>(k, c.law(), given, v, v_bar, x_bar, sum.law());
            for (int a = 0; a < 2; a++) {
                o.v(a)[i] += v_bar[a] - o.g(a)[i];
                o.x(a)[i] += x_bar[a];
                o.g(a)[i] = v_bar[a];
            }
        }
        TOGETHER();
    }
}

// From the coefficient under node i to the table's own, to where the node is and how it moves.
ROD_CALL void friction_adjoint(const Rod& r, int i, const Bars& o, const Numbers& k, const Traits& c, Lanes bar, Traits& sum) {
    if constexpr (Acting::has<OfFriction>()) {
        const Lanes given[] = {r.x(0)[i], r.x(1)[i], r.v(0)[i], r.v(1)[i]};
        Lanes given_bar[4] = {};
        Acting::apply_adjoint<OfFriction>(k, c.law(), given, &c.table_friction, &bar, given_bar, sum.law());
        for (int a = 0; a < 2; a++) { o.x(a)[i] += given_bar[a]; o.v(a)[i] += given_bar[2 + a]; }
    }
    sum.table_friction += bar;
}

ROD_CALL void nodes_adjoint(const Rod& r, const Bars& o, const Numbers& k, const Traits& c, Traits& sum) {
    EACH(i, 0, r.n) {
        const Load l = load_of(r, i, k);
        const Lanes vx = r.v(0)[i], vy = r.v(1)[i], speed = root(vx * vx + vy * vy + c.creep * c.creep + 1e-12f);
        const Lanes mu = friction_at(r, i, k, c), limit = mu * l.weight + 1e-9f;
        const Lanes relaxed = 1.0f / (1.0f + k.dt * k.table * speed / limit);
        const Lanes rate = (k.table_damping / k.dt) * relaxed, gain = k.dt / r.mass()[i];
        const Lanes fx = o.g(0)[i] * gain, fy = o.g(1)[i] * gain;
        const Lanes zx = o.z(0)[i] - fx * (k.table + rate), zy = o.z(1)[i] - fy * (k.table + rate);
        const Lanes damped = fx * (r.zn(0)[i] - r.z(0)[i]) + fy * (r.zn(1)[i] - r.z(1)[i]);
        const Lanes slower = (rate * damped - zx * r.zn(0)[i] - zy * r.zn(1)[i]) * relaxed;
        const Lanes of_speed = slower * (k.dt * k.table) / (limit * speed);
        const Lanes of_limit = -slower * (k.dt * k.table) * speed / (limit * limit);
        o.z(0)[i] = fx * rate + zx * relaxed;
        o.z(1)[i] = fy * rate + zy * relaxed;
        o.v(0)[i] += k.dt * zx * relaxed + of_speed * vx;
        o.v(1)[i] += k.dt * zy * relaxed + of_speed * vy;
        sum.creep += of_speed * c.creep;
        const Lanes weight = of_limit * mu;
        friction_adjoint(r, i, o, k, c, of_limit * l.weight, sum);
        o.f(0)[i] = fx; o.f(1)[i] = fy; o.weight()[i] = weight;
        o.mass()[i] += weight * k.gravity - (o.g(0)[i] * r.g(0)[i] + o.g(1)[i] * r.g(1)[i]) / r.mass()[i];
    }
    TOGETHER();
}

// From what of a flat finger's core segment j meets to the segment's nodes, the finger's middle and its half vector; of
// a round finger it is the middle, whose bar has it already.
template <bool IS_FLAT>
ROD_CALL void met_adjoint(
    const Rod& r, int j, const Bars& o, const Numbers& k, const CoreTraits<IS_FLAT>& c, const Finger& u, Met bar,
    CoreTraits<IS_FLAT>& sum
) {
    if constexpr (IS_FLAT) {
        const CorePlace m = core_place(r, j, k, u, c.half_x, c.half_y);
        const Lanes zero = {}, length = r.length()[j], end = 0.5f * length, tx = r.t(0)[j], ty = r.t(1)[j];
        const Mask inside = (m.free_place > -1.0f) & (m.free_place < 1.0f);
        const Mask between = (m.free_along > -end) & (m.free_along < end);
        const Lanes place = either(inside, (bar.x * c.half_x + bar.y * c.half_y) / m.square, zero), along = place * m.te;
        const Lanes quotient = either(between, along / m.denominator, zero), denominator = -quotient * m.free_along;
        const Lanes share = m.te / m.square;
        const Lanes re = place + quotient * share;
        const Lanes te = place * m.along + quotient * m.re / m.square - 2.0f * denominator * share;
        const Lanes square = -place * m.free_place - quotient * share * m.re / m.square + denominator * share * share;
        sum.half_x += m.place * bar.x + te * tx + re * m.rx + 2.0f * square * c.half_x;
        sum.half_y += m.place * bar.y + te * ty + re * m.ry + 2.0f * square * c.half_y;
        const Lanes rx = re * c.half_x - quotient * tx, ry = re * c.half_y - quotient * ty;
        // Of the tangent and, where the place along it is at an end, of the length.
        const Lanes of_tx = te * c.half_x - quotient * m.rx, of_ty = te * c.half_y - quotient * m.ry;
        const Lanes of_end = either(between, zero, 0.5f * either(m.free_along > 0.0f, along, -along));
        const Lanes of_length = of_end - (of_tx * tx + of_ty * ty) / length;
        const Lanes ex = of_tx / length + of_length * tx, ey = of_ty / length + of_length * ty;
        add_to(o.x(0)[j], 0.5f * rx - ex); add_to(o.x(1)[j], 0.5f * ry - ey);
        add_to(o.x(0)[j + 1], 0.5f * rx + ex); add_to(o.x(1)[j + 1], 0.5f * ry + ey);
        add_to(o.finger()[0], -rx); add_to(o.finger()[1], -ry);
    }
}

// The contact of segment j with the finger; adds to the bars of its nodes and of the finger.
ROD_CALL void meeting_adjoint(
    const Rod& r, int j, const Bars& o, const Numbers& k, const Traits& c, const Finger& u, Lanes hop, Traits& sum
) {
    const Meeting m = meet(r, j, k, c, u, hop);
    const Lanes next_s = o.s()[j];
    o.s()[j] = Lanes{};
    if (!any(m.touching)) return;
    const Lanes zero = {}, rest = 1.0f - m.share, s = r.sn()[j], E = 1.0f + k.dt * k.finger * m.any_slip / m.drag;
    const Lanes px = o.f(0)[j] * rest + o.f(0)[j + 1] * m.share, py = o.f(1)[j] * rest + o.f(1)[j + 1] * m.share;
    const Lanes pressed = o.weight()[j] * rest + o.weight()[j + 1] * m.share;
    Lanes share = r.push(0)[j] * (o.f(0)[j + 1] - o.f(0)[j]) + r.push(1)[j] * (o.f(1)[j + 1] - o.f(1)[j]) +
                  r.press()[j] * (o.weight()[j + 1] - o.weight()[j]);
    // push = o normal - side finger s, side = (-oy, ox)
    const Lanes ks = k.finger * s;
    Lanes ox = px * m.normal - py * ks, oy = py * m.normal + px * ks;
    Lanes normal = px * m.ox + py * m.oy;
    const Lanes bristle = next_s + k.finger * (px * m.oy - py * m.ox);
    Lanes total = pressed * (u.sine + m.up * m.cosine), up = pressed * m.total * m.cosine;
    Lanes sine = pressed * m.total, cosine = pressed * m.total * m.up;
    const Lanes relaxed = bristle / E, slower = -relaxed * s;
    Lanes slip = k.dt * relaxed, any_slip = slower * (k.dt * k.finger) / m.drag;
    const Lanes drag = -slower * (k.dt * k.finger) * m.any_slip / (m.drag * m.drag);
    total += drag * c.finger_friction;
    const Lanes den = m.cosine - m.up * u.sine, of_den = -total * m.total / den;
    normal += total / den;
    cosine += of_den; up -= of_den * u.sine; sine -= of_den * m.up;
    sine -= cosine * u.sine / m.cosine;
    const Lanes friction = drag * m.total + up * hop / m.any_slip;
    any_slip -= up * m.up / m.any_slip;
    slip += any_slip * m.slip / m.any_slip;
    const Lanes hopped = up * c.finger_friction / m.any_slip + any_slip * hop / m.any_slip;
    // slip = my ox - mx oy
    Lanes mx = -slip * m.oy, my = slip * m.ox;
    ox += slip * m.my; oy -= slip * m.mx;
    normal = either(m.inside, normal, zero);
    const Mask shallow = m.depth < k.onset;
    Lanes depth = normal * (k.finger - either(shallow, k.finger_damping * m.approach / k.onset, zero));
    const Lanes approach = -normal * k.finger_damping * m.ramp;
    mx += approach * m.ox; my += approach * m.oy;
    ox += approach * m.mx; oy += approach * m.my;
    const Lanes dx = r.v(0)[j + 1] - r.v(0)[j], dy = r.v(1)[j + 1] - r.v(1)[j];
    share += mx * dx + my * dy;
    const Lanes distance = -depth + (ox * m.gx + oy * m.gy) / (m.distance * m.distance);
    const Lanes gx = -ox / m.distance + distance * m.gx / m.distance, gy = -oy / m.distance + distance * m.gy / m.distance;
    const Lanes length = r.length()[j], ex = r.t(0)[j] * length, ey = r.t(1)[j] * length;
    share -= gx * ex + gy * ey;
    const Mask within = (m.along > 0.0f) & (m.along < 1.0f);
    const Lanes w = either(within, share / (length * length), zero);
    const Met q = met_by(r, j, k, c, u);
    const Lanes awx = q.x - r.x(0)[j], awy = q.y - r.x(1)[j];
    Lanes ax = gx + w * ex, ay = gy + w * ey;
    // along = aw . e / |e|^2, and |e| is a function of e: the two together.
    Lanes bx = w * awx - m.share * gx - 2.0f * w * m.along * ex, by = w * awy - m.share * gy - 2.0f * w * m.along * ey;
    const auto kept = [&](Lanes a) { return either(m.touching, a, zero); };
    ax = kept(ax); ay = kept(ay); bx = kept(bx); by = kept(by); mx = kept(mx); my = kept(my);
    add_to(o.x(0)[j], -ax - bx); add_to(o.x(1)[j], -ay - by);
    add_to(o.x(0)[j + 1], bx); add_to(o.x(1)[j + 1], by);
    add_to(o.v(0)[j], mx * rest); add_to(o.v(1)[j], my * rest);
    add_to(o.v(0)[j + 1], mx * m.share); add_to(o.v(1)[j + 1], my * m.share);
    o.s()[j] = kept(relaxed);
    sum.finger_friction += kept(friction);
    sum.climb += kept(hopped) * hop / larger(c.climb, all_of(1e-12f));
    const Lanes quick = kept(hopped) * c.climb * c.climb / larger(hop, all_of(1e-12f));
    const Lanes of_finger[] = {ax, ay, quick * u.vx - mx, quick * u.vy - my, kept(depth), kept(sine)};
    for (int a = 0; a < FINGER; a++) add_to(o.finger()[a], of_finger[a]);
    met_adjoint(r, j, o, k, c, u, {ax, ay}, sum);
}

ROD_CALL void finger_adjoint(const Rod& r, const Bars& o, const Numbers& k, const Traits& c, const Finger& u, Traits& sum) {
    const Lanes hop = hop_of(c, u);
    EACH(j, 0, r.n - 1) meeting_adjoint(r, j, o, k, c, u, hop, sum);
}

// What segments give to their nodes stands in rows of its own.
ROD_CALL void elastic_adjoint(const Rod& r, const Bars& o, const Numbers& k, const Traits& c, Traits& sum) {
    const int n = r.n;
    EACH(i, 0, n) o.moment()[i] = Lanes{};
    EACH(j, 0, n - 1) {
        // f = normal q - t tension, with normal = (-ty, tx)
        const Lanes fx = o.f(0)[j + 1] - o.f(0)[j], fy = o.f(1)[j + 1] - o.f(1)[j];
        const Lanes length = r.length()[j], q = (r.moment()[j + 1] - r.moment()[j]) / length, tx = r.t(0)[j], ty = r.t(1)[j];
        const Lanes of_q = tx * fy - ty * fx, pull = -(tx * fx + ty * fy);
        const Lanes dx = r.v(0)[j + 1] - r.v(0)[j], dy = r.v(1)[j + 1] - r.v(1)[j];
        o.spin()[j] = of_q / length;  // For the moments; turned into that of the rate of turning below.
        o.t(0)[j] = q * fy - r.tension()[j] * fx + pull * k.stretch_damping * dx;
        o.t(1)[j] = -q * fx - r.tension()[j] * fy + pull * k.stretch_damping * dy;
        o.length()[j] = pull * (stretch_of(r, j, k) / k.rest) - of_q * q / length;
        if constexpr (UNEVEN) o.g(1)[j] = pull * (length / k.rest - 1.0f);  // Of EA; see the end.
        const Lanes vx = pull * k.stretch_damping * tx, vy = pull * k.stretch_damping * ty;
        o.vfirst(0)[j] = -vx; o.vfirst(1)[j] = -vy;
        o.vsecond(0)[j] = vx; o.vsecond(1)[j] = vy;
    }
    TOGETHER();
    EACH(i, 1, n - 1) o.moment()[i] = o.spin()[i - 1] - o.spin()[i];
    TOGETHER();
    // moment = bending (kept + springback next p) + damping (spin - spin before)
    EACH(j, 0, n - 1) {
        const Lanes turning = (o.moment()[j] - o.moment()[j + 1]) * c.bending_damping;
        const Lanes dx = r.v(0)[j + 1] - r.v(0)[j], dy = r.v(1)[j + 1] - r.v(1)[j], length = r.length()[j];
        // spin = (tx dy - ty dx) / length
        const Lanes w = turning / length;
        o.t(0)[j] += w * dy; o.t(1)[j] -= w * dx;
        o.length()[j] -= w * r.spin()[j];
        o.vfirst(0)[j] += w * r.t(1)[j]; o.vfirst(1)[j] -= w * r.t(0)[j];
        o.vsecond(0)[j] -= w * r.t(1)[j]; o.vsecond(1)[j] += w * r.t(0)[j];
    }
    TOGETHER();
    EACH(i, 1, n - 1) {
        const Lanes ax = r.t(0)[i - 1], ay = r.t(1)[i - 1], bx = r.t(0)[i], by = r.t(1)[i];
        const Lanes dot = 1.0f + ax * bx + ay * by, d = larger(dot, all_of(0.1f));
        const Lanes angle = 2.0f * (ax * by - ay * bx) / d, a2 = angle * angle;
        const Lanes turned = angle * (1.0f - a2 * (1.0f / 12 - a2 / 80.0f)), e = turned - r.curved()[i] - r.p()[i];
        const Mask elastic = (e < c.yield_angle) & (e > -c.yield_angle);
        const Lanes borne = clipped(e, -c.yield_angle, c.yield_angle), kept = kept_bend(borne, k, c);
        const Lanes bent = o.moment()[i] * r.bending()[i], next_p = o.p()[i] + bent * c.springback;
        Lanes of_kept = bent - next_p;
        o.bending()[i] += o.moment()[i] * (kept + c.springback * r.pn()[i]);
        sum.springback += bent * r.pn()[i];
        if constexpr (Acting::has<OfBend>())
            Acting::apply_adjoint<OfBend>(k, c.law(), nullptr, &borne, &of_kept, nullptr, sum.law());
        sum.bending_damping += o.moment()[i] * (r.spin()[i] - r.spin()[i - 1]);
        const Lanes of_e = next_p + either(elastic, of_kept, Lanes{});
        sum.yield_angle += either(elastic, Lanes{}, either(e > 0.0f, of_kept, -of_kept));
        o.p()[i] = next_p - of_e;
        o.curved()[i] -= of_e;
        const Mask tight = (turned > k.tightest) | (turned < -k.tightest);
        const Lanes of_angle = of_e + either(tight, o.moment()[i] * k.stop, Lanes{});
        const Lanes u1 = of_angle * (1.0f - a2 * (0.25f - a2 / 16.0f));
        const Lanes cross = 2.0f * u1 / d, of_d = either(dot > 0.1f, -u1 * angle / d, Lanes{});
        // Kept for both of its segments, each of which adds its own part.
        o.moment()[i] = cross; o.g(0)[i] = of_d;
    }
    TOGETHER();
    EACH(j, 0, n - 1) {
        Lanes tx = o.t(0)[j], ty = o.t(1)[j];
        if (j < n - 2) {
            const Lanes bx = r.t(0)[j + 1], by = r.t(1)[j + 1], cross = o.moment()[j + 1], d = o.g(0)[j + 1];
            tx += cross * by + d * bx; ty += d * by - cross * bx;
        }
        if (j > 0) {
            const Lanes ax = r.t(0)[j - 1], ay = r.t(1)[j - 1], cross = o.moment()[j], d = o.g(0)[j];
            tx += d * ax - cross * ay; ty += cross * ax + d * ay;
        }
        const Lanes length = r.length()[j], of_length = o.length()[j] - (tx * r.t(0)[j] + ty * r.t(1)[j]) / length;
        const Lanes ex = tx / length + of_length * r.t(0)[j], ey = ty / length + of_length * r.t(1)[j];
        o.first(0)[j] = -ex; o.first(1)[j] = -ey;
        o.second(0)[j] = ex; o.second(1)[j] = ey;
    }
}

// To each node what its two segments have for it.
ROD_CALL void gather_adjoint(const Rod& r, const Bars& o, const Numbers& k) {
    const int n = r.n;
    EACH(i, 0, n) {
        if constexpr (UNEVEN) {
            if (i < n - 1) o.mass()[i] += o.g(1)[i] * stretch_by_mass(r, i, i + 1, k);
            if (i > 0) o.mass()[i] += o.g(1)[i - 1] * stretch_by_mass(r, i, i - 1, k);
        }
        Lanes x[] = {o.x(0)[i], o.x(1)[i]}, v[] = {o.v(0)[i], o.v(1)[i]};
        for (int a = 0; a < 2; a++) {
            if (i < n - 1) { x[a] += o.first(a)[i]; v[a] += o.vfirst(a)[i]; }
            if (i > 0) { x[a] += o.second(a)[i - 1]; v[a] += o.vsecond(a)[i - 1]; }
        }
        for (int a = 0; a < 2; a++) { o.x(a)[i] = x[a]; o.v(a)[i] = v[a]; }
    }
    TOGETHER();
}

}  // namespace rods
