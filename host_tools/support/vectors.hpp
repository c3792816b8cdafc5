#pragma once

#include <atomic>
#include <cstdint>

namespace fxdyn {

/// `count` numbers that the processor adds or multiplies at once (GCC's vector types).
template <int count>
struct Vector {
  typedef double Double __attribute__((vector_size(8 * count), may_alias));
  typedef std::int64_t Integer __attribute__((vector_size(8 * count), may_alias));
  /// Wherever they lie in memory. A packed struct: Clang forgets the smaller alignment of a template's own type.
  struct [[gnu::packed, gnu::may_alias]] InMemory {
    Double value;
  };
  static constexpr int size = count;
  [[gnu::always_inline]] static InMemory& at(double* x) { return *reinterpret_cast<InMemory*>(x); }
  [[gnu::always_inline]] static const InMemory& at(const double* x) { return *reinterpret_cast<const InMemory*>(x); }
};

/// How long the processor's vectors are: eight (AVX-512), four (AVX2), and every one has vectors of two. Inner loops
/// are compiled for all of them, without fused multiply-add (-ffp-contract=off), so that the outcome is the same to the
/// bit. Tests make it less.
#ifdef __x86_64__
#define FXDYN_FOUR_AT_ONCE [[gnu::target("avx2")]]
#define FXDYN_EIGHT_AT_ONCE [[gnu::target("avx512f,avx512dq")]]
inline std::atomic<int> at_once = __builtin_cpu_supports("avx512f") != 0 && __builtin_cpu_supports("avx512dq") != 0 ? 8
                                  : __builtin_cpu_supports("avx2") != 0                                             ? 4
                                                                                                                    : 2;
#else
#define FXDYN_FOUR_AT_ONCE
#define FXDYN_EIGHT_AT_ONCE
inline std::atomic<int> at_once = 2;
#endif

/// Of the same function compiled three times, the one for this processor.
template <class Function>
Function* widest(Function* eight, Function* four, Function* two) {
  const int count = at_once;
  return count >= 8 ? eight : count >= 4 ? four : two;
}

}  // namespace fxdyn
