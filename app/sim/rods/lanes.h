// Lanes: sixteen candidates abreast on a CPU; on a GPU one candidate a block, whose threads are its nodes.
//
// A block has teams of threads: AS(team) is done by one of them, and what several do needs nothing of each other. Within
// EACH and TOGETHER a team is among itself; ALL_TOGETHER is for all of them. A CPU does one after the other.
#pragma once

namespace rods {

#if defined(__CUDA_ARCH__)
typedef float Lanes;
typedef bool Mask;
#define ROD_CALL static __device__ inline
#define ROD_HERE __device__ inline
#define EACH(i, from, to) for (int i = (from) + place_in_team(); i < (to); i += team_size())
#define AS(number) if (team() == (number))
#define AS_TOO(number) AS(number)
#define TOGETHER() team_barrier()
#define ALL_TOGETHER() __syncthreads()
constexpr int WARP = 32, SMALL_TEAM = 64, THREADS = 384;  // Two small teams, and a third one for pairs.
constexpr int SUMS = SMALL_TEAM + 1;                      // Of each number: see add_sums.
ROD_CALL int team() { return threadIdx.x < SMALL_TEAM ? 0 : threadIdx.x < 2 * SMALL_TEAM ? 1 : 2; }
ROD_CALL int place_in_team() { return (int)threadIdx.x - team() * SMALL_TEAM; }
ROD_CALL int team_size() { return team() < 2 ? SMALL_TEAM : THREADS - 2 * SMALL_TEAM; }
ROD_CALL void team_barrier() { asm volatile("bar.sync %0, %1;" ::"r"(1 + team()), "r"(team_size()) : "memory"); }
constexpr int WIDTH = 1;
ROD_CALL Lanes root(Lanes a) { return sqrtf(a); }
ROD_CALL Lanes larger(Lanes a, Lanes b) { return fmaxf(a, b); }
ROD_CALL Lanes smaller(Lanes a, Lanes b) { return fminf(a, b); }
ROD_CALL Lanes either(Mask m, Lanes a, Lanes b) { return m ? a : b; }
ROD_CALL bool any(Mask m) { return m; }
ROD_CALL Lanes all_of(float a) { return a; }
ROD_CALL Lanes exponential(Lanes a) { return expf(a); }
#else
typedef float Lanes __attribute__((vector_size(64), aligned(64)));
typedef int Mask __attribute__((vector_size(64), aligned(64)));
#define ROD_CALL static inline __attribute__((always_inline))
#define ROD_HERE inline __attribute__((always_inline))
#define EACH(i, from, to) for (int i = (from); i < (to); i++)
#define AS(team)
#define AS_TOO(team) if (false)
#define TOGETHER()
#define ALL_TOGETHER()
constexpr int WIDTH = 16, SUMS = 1;
ROD_CALL Lanes root(Lanes a) { return __builtin_elementwise_sqrt(a); }
ROD_CALL Lanes larger(Lanes a, Lanes b) { return a > b ? a : b; }
ROD_CALL Lanes smaller(Lanes a, Lanes b) { return a < b ? a : b; }
ROD_CALL Lanes either(Mask m, Lanes a, Lanes b) { return m ? a : b; }
ROD_CALL bool any(Mask m) { return __builtin_reduce_or(m) != 0; }
ROD_CALL Lanes all_of(float a) { return Lanes{} + a; }
// 2^n times a Taylor series on |rest| <= log(2) / 2, to 2e-7; n is rounded by the last bit of a large number.
ROD_CALL Lanes exponential(Lanes a) {
    a = smaller(larger(a, all_of(-87.0f)), all_of(88.0f));
    const Lanes n = (a * 1.44269504f + 12582912.0f) - 12582912.0f, r = (a - n * 0.693145752f) - n * 1.42860677e-6f;
    const Lanes series = 1.0f + r * (1.0f + r * (0.5f + r * (1.0f / 6 + r * (1.0f / 24 + r * (1.0f / 120 + r * (1.0f / 720))))));
    return series * (Lanes)((__builtin_convertvector(n, Mask) + 127) << 23);
}
#endif

// Where a group works: on a GPU in memory that its block has for itself.
constexpr int MOST_NODES = 129, MOST_ROWS = 62, MOST_SUMS = 58 * 65;
#if defined(__CUDA_ARCH__)
ROD_CALL Lanes* memory_of(float*, int, int) {
    __shared__ float rows[MOST_ROWS * MOST_NODES + MOST_SUMS];
    return rows;
}
#else
ROD_CALL Lanes* memory_of(float* scratch, int slot, int size) { return (Lanes*)scratch + (long long)slot * size; }
#endif

// Several threads may add to the same number.
ROD_CALL void add_to(Lanes& to, Lanes a) {
#if defined(__CUDA_ARCH__)
    atomicAdd(&to, a);
#else
    to += a;
#endif
}

ROD_CALL Lanes clipped(Lanes a, Lanes low, Lanes high) { return smaller(larger(a, low), high); }

}  // namespace rods
