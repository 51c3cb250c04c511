// Laws of effects beside a rod's own, and their exact derivatives by dual numbers.
//
// Each law is a struct that laws.py writes: so many NUMBERS of its own, and, as HAS_... says, `velocity` of a node,
// `friction` of the table under it and `bend`, the elastic angle at it.
#pragma once
#include "numbers.h"

namespace rods {

// A number and its derivatives with respect to M others (forward mode).
template <int M>
struct Dual {
    Lanes a, d[M];

    ROD_HERE Dual() {}
    ROD_HERE Dual(Lanes value) : a(value) { for (int m = 0; m < M; m++) d[m] = Lanes{}; }
    ROD_HERE static Dual input(Lanes value, int number) { Dual o(value); o.d[number] = all_of(1.0f); return o; }
    // Of functions of one and of two numbers, by the chain rule.
    ROD_HERE static Dual of(const Dual& p, Lanes value, Lanes slope) {
        Dual o;
        o.a = value;
        for (int m = 0; m < M; m++) o.d[m] = slope * p.d[m];
        return o;
    }
    ROD_HERE static Dual of(const Dual& p, const Dual& q, Lanes value, Lanes slope, Lanes other) {
        Dual o;
        o.a = value;
        for (int m = 0; m < M; m++) o.d[m] = slope * p.d[m] + other * q.d[m];
        return o;
    }

    friend ROD_HERE Dual operator-(const Dual& p) { return of(p, -p.a, all_of(-1.0f)); }
    friend ROD_HERE Dual operator+(const Dual& p, const Dual& q) { return of(p, q, p.a + q.a, all_of(1.0f), all_of(1.0f)); }
    friend ROD_HERE Dual operator-(const Dual& p, const Dual& q) { return of(p, q, p.a - q.a, all_of(1.0f), all_of(-1.0f)); }
    friend ROD_HERE Dual operator*(const Dual& p, const Dual& q) { return of(p, q, p.a * q.a, q.a, p.a); }
    friend ROD_HERE Dual operator/(const Dual& p, const Dual& q) {
        const Lanes ratio = p.a / q.a;
        return of(p, q, ratio, 1.0f / q.a, -ratio / q.a);
    }
    friend ROD_HERE Dual operator+(const Dual& p, float q) { return of(p, p.a + q, all_of(1.0f)); }
    friend ROD_HERE Dual operator+(float p, const Dual& q) { return q + p; }
    friend ROD_HERE Dual operator-(const Dual& p, float q) { return p + (-q); }
    friend ROD_HERE Dual operator-(float p, const Dual& q) { return of(q, p - q.a, all_of(-1.0f)); }
    friend ROD_HERE Dual operator*(const Dual& p, float q) { return of(p, p.a * q, all_of(q)); }
    friend ROD_HERE Dual operator*(float p, const Dual& q) { return q * p; }
    friend ROD_HERE Dual operator/(const Dual& p, float q) { return p * (1.0f / q); }
    friend ROD_HERE Dual operator/(float p, const Dual& q) {
        const Lanes ratio = p / q.a;
        return of(q, ratio, -ratio / q.a);
    }
    template <typename Q> ROD_HERE Dual& operator+=(const Q& q) { return *this = *this + q; }
    template <typename Q> ROD_HERE Dual& operator-=(const Q& q) { return *this = *this - q; }
    template <typename Q> ROD_HERE Dual& operator*=(const Q& q) { return *this = *this * q; }
    template <typename Q> ROD_HERE Dual& operator/=(const Q& q) { return *this = *this / q; }

    friend ROD_HERE Dual root(const Dual& p) {
        const Lanes value = root(p.a);
        return of(p, value, 0.5f / value);
    }
    friend ROD_HERE Dual exponential(const Dual& p) {
        const Lanes value = exponential(p.a);
        return of(p, value, value);
    }
    friend ROD_HERE Mask operator<(const Dual& p, const Dual& q) { return p.a < q.a; }
    friend ROD_HERE Mask operator>(const Dual& p, const Dual& q) { return p.a > q.a; }
    // Of equal numbers the second one is taken, and its derivative.
    friend ROD_HERE Dual larger(const Dual& p, const Dual& q) { return either(p.a > q.a, p, q); }
    friend ROD_HERE Dual smaller(const Dual& p, const Dual& q) { return either(p.a < q.a, p, q); }
    friend ROD_HERE Dual either(Mask which, const Dual& p, const Dual& q) {
        Dual o;
        o.a = either(which, p.a, q.a);
        for (int m = 0; m < M; m++) o.d[m] = either(which, p.d[m], q.d[m]);
        return o;
    }
};

// What a law changes, and what it is given besides its numbers.
struct OfVelocity {
    static constexpr int CHANGED = 2, GIVEN = 2;  // [m/s]; at x, y [m]
    template <typename Law> static constexpr bool in() { return Law::HAS_VELOCITY; }
    template <typename Law, typename T>
    ROD_CALL void call(const Numbers& k, const T* phi, const T* at, T* to) { Law::velocity(k, phi, at[0], at[1], to[0], to[1]); }
};
struct OfFriction {
    static constexpr int CHANGED = 1, GIVEN = 4;  // the coefficient; at x, y [m], moving with vx, vy [m/s]
    template <typename Law> static constexpr bool in() { return Law::HAS_FRICTION; }
    template <typename Law, typename T>
    ROD_CALL void call(const Numbers& k, const T* phi, const T* at, T* to) { Law::friction(k, phi, at[0], at[1], at[2], at[3], *to); }
};
struct OfBend {
    static constexpr int CHANGED = 1, GIVEN = 0;  // the elastic angle [rad]
    template <typename Law> static constexpr bool in() { return Law::HAS_BEND; }
    template <typename Law, typename T>
    ROD_CALL void call(const Numbers& k, const T* phi, const T*, T* to) { Law::bend(k, phi, *to); }
};

// Laws one after the other; each has its numbers after those of the laws before it.
template <typename... Each>
struct Laws {
    static constexpr int NUMBERS = 0;
    template <typename Kind> static constexpr bool has() { return false; }
    template <typename Kind> ROD_CALL void apply(const Numbers&, const Lanes*, const Lanes*, Lanes*) {}
    template <typename Kind>
    ROD_CALL void apply_adjoint(const Numbers&, const Lanes*, const Lanes*, const Lanes*, Lanes*, Lanes*, Lanes*) {}
};

template <typename Law, typename... Rest>
struct Laws<Law, Rest...> {
    static constexpr int OWN = Law::NUMBERS, NUMBERS = OWN + Laws<Rest...>::NUMBERS;

    template <typename Kind> static constexpr bool has() { return Kind::template in<Law>() || Laws<Rest...>::template has<Kind>(); }

    // `to` holds what is changed, before and after.
    template <typename Kind> ROD_CALL void apply(const Numbers& k, const Lanes* phi, const Lanes* at, Lanes* to) {
        if constexpr (Kind::template in<Law>()) Kind::template call<Law>(k, phi, at, to);
        Laws<Rest...>::template apply<Kind>(k, phi + OWN, at, to);
    }

    // `before`: what is changed, before it. `bar` is turned in place from what follows to what was; the others add up.
    template <typename Kind> ROD_CALL void apply_adjoint(
        const Numbers& k, const Lanes* phi, const Lanes* at, const Lanes* before, Lanes* bar, Lanes* at_bar, Lanes* phi_bar
    ) {
        if constexpr (!Kind::template in<Law>()) {
            Laws<Rest...>::template apply_adjoint<Kind>(k, phi + OWN, at, before, bar, at_bar, phi_bar + OWN);
        } else {
            constexpr int C = Kind::CHANGED, G = Kind::GIVEN, M = C + G + OWN;
            typedef Dual<M> Number;
            Number to[C], given[G + 1], own[OWN + 1];
            for (int m = 0; m < C; m++) to[m] = Number::input(before[m], m);
            for (int m = 0; m < G; m++) given[m] = Number::input(at[m], C + m);
            for (int m = 0; m < OWN; m++) own[m] = Number::input(phi[m], C + G + m);
            Kind::template call<Law>(k, (const Number*)own, (const Number*)given, to);
            Lanes after[C];
            for (int m = 0; m < C; m++) after[m] = to[m].a;
            Laws<Rest...>::template apply_adjoint<Kind>(k, phi + OWN, at, after, bar, at_bar, phi_bar + OWN);
            Lanes of[M];
            for (int m = 0; m < M; m++) {
                of[m] = bar[0] * to[0].d[m];
                for (int c = 1; c < C; c++) of[m] += bar[c] * to[c].d[m];
            }
            for (int m = 0; m < C; m++) bar[m] = of[m];
            for (int m = 0; m < G; m++) at_bar[m] += of[C + m];
            for (int m = 0; m < OWN; m++) phi_bar[m] += of[C + G + m];
        }
    }
};

// Of one candidate, the same for all steps.
template <int N>
struct LawNumbers {
    Lanes numbers[N];
    ROD_HERE Lanes* law() { return numbers; }
    ROD_HERE const Lanes* law() const { return numbers; }
};
template <>
struct LawNumbers<0> {
    ROD_HERE Lanes* law() { return nullptr; }
    ROD_HERE const Lanes* law() const { return nullptr; }
};

}  // namespace rods
