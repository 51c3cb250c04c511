// Fixed walls as laws of velocity: penalty with damping, and friction that grows with slip up to Coulomb's bound.
#pragma once
#include "laws.h"

namespace rods {

// A box from (phi[0], phi[1]) to (phi[2], phi[3]) [m] with the coefficient phi[4], for the round rope about a node.
struct BoxWall {
    static constexpr int NUMBERS = 5;
    static constexpr bool HAS_VELOCITY = true, HAS_FRICTION = false, HAS_BEND = false;

    template <typename T>
    ROD_CALL void velocity(const Numbers& k, const T* phi, const T& x, const T& y, T& vx, T& vy) {
        const T left = phi[0] - x, right = x - phi[2], below = phi[1] - y, above = y - phi[3];
        const T across = larger(left, right), up = larger(below, above), inner = larger(across, up);
        const T dx = x - smaller(larger(x, phi[0]), phi[2]), dy = y - smaller(larger(y, phi[1]), phi[3]);
        const T outer = root(dx * dx + dy * dy + 1e-12f);
        // A node within the box, which only a rope that starts there has, is moved out through the nearest side.
        const Mask inside = inner < all_of(0.0f), sideways = across > up;
        const Lanes one = all_of(1.0f), zero = all_of(0.0f);
        const T nx = either(inside, either(sideways, either(left > right, -one, one), zero), dx / outer);
        const T ny = either(inside, either(sideways, zero, either(below > above, -one, one)), dy / outer);
        const T depth = 0.5f * k.thickness - either(inside, inner, outer);
        const Mask touching = depth > zero;
        if (!any(touching)) return;
        const T approach = vx * nx + vy * ny, ramp = smaller(depth / k.onset, one);
        const T pushed = (k.own * depth - k.own_damping * approach * ramp) * (k.dt / k.node_mass);
        const T push = either(touching, larger(zero, pushed), zero), bound = phi[4] * push;
        const T slip = vy * nx - vx * ny, rub = slip * bound / (root(slip * slip + 1e-12f) + bound);
        vx += push * nx + rub * ny;
        vy += push * ny - rub * nx;
    }
    template <typename T>
    ROD_CALL void friction(const Numbers&, const T*, const T&, const T&, const T&, const T&, T&) {}
    template <typename T>
    ROD_CALL void bend(const Numbers&, const T*, T&) {}
};

}  // namespace rods
