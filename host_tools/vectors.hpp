#pragma once

#include <atomic>
#include <cstdint>

namespace fxdyn {

/// `count` numbers that the processor adds or multiplies at once (GCC's vector types), wherever they lie in memory.
template <int count>
struct Vector {
  typedef double Double __attribute__((vector_size(8 * count), aligned(8), may_alias));
  typedef std::int64_t Integer __attribute__((vector_size(8 * count), aligned(8), may_alias));
  static constexpr int size = count;
  [[gnu::always_inline]] static Double& at(double* x) { return *reinterpret_cast<Double*>(x); }
  [[gnu::always_inline]] static const Double& at(const double* x) { return *reinterpret_cast<const Double*>(x); }
};

/// Whether the processor has vectors of four (AVX2); every one has vectors of two. Inner loops are compiled for both:
/// without fused multiply-add, so that the outcome is the same to the bit. Tests turn it off.
#ifdef __x86_64__
#define FXDYN_FOUR_AT_ONCE [[gnu::target("avx2")]]
inline std::atomic<bool> four_at_once = __builtin_cpu_supports("avx2") != 0;
#else
#define FXDYN_FOUR_AT_ONCE
inline std::atomic<bool> four_at_once = false;
#endif

}  // namespace fxdyn
