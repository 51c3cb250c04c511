// Lanes: sixteen candidates abreast on a CPU; on a GPU one candidate a block, whose threads are its nodes.
#pragma once

namespace rods {

#if defined(__CUDA_ARCH__)
typedef float Lanes;
typedef bool Mask;
#define ROD_CALL static __device__ inline
#define ROD_HERE __device__ inline
#define EACH(i, from, to) for (int i = (from) + (int)threadIdx.x; i < (to); i += THREADS)
#define TOGETHER() __syncthreads()
constexpr int THREADS = 64;
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
#define TOGETHER()
constexpr int WIDTH = 16;
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
constexpr int MOST_NODES = 129, MOST_ROWS = 62;
#if defined(__CUDA_ARCH__)
ROD_CALL Lanes* memory_of(float*, int, int) {
    __shared__ float rows[MOST_ROWS * MOST_NODES];
    return rows;
}
#else
ROD_CALL Lanes* memory_of(float* scratch, int slot, int size) { return (Lanes*)scratch + (long long)slot * size; }
#endif

ROD_CALL Lanes clipped(Lanes a, Lanes low, Lanes high) { return smaller(larger(a, low), high); }

}  // namespace rods
