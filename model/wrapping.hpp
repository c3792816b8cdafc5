#pragma once

#include <concepts>
#include <type_traits>

// Unsigned arithmetic that is meant to wrap, modulo 2^bits: checksums, differences of clocks, sums and signs computed
// without a branch. Everything else in the model and the firmware keeps to its range, which a checker for overflow and
// lost bits (clang's -fsanitize=integer) shows: it leaves out these functions and nothing else.

#ifdef __clang__
#define FXDYN_WRAPS [[clang::no_sanitize("unsigned-integer-overflow", "unsigned-shift-base")]]
#else
#define FXDYN_WRAPS
#endif

namespace fxdyn {

/// No smaller than int, which smaller ones would become.
template <class T>
concept Wrapping = std::unsigned_integral<T> && sizeof(T) >= sizeof(int);

template <Wrapping T>
FXDYN_WRAPS constexpr T wrapping_add(T a, std::type_identity_t<T> b) {
  return a + b;
}
template <Wrapping T>
FXDYN_WRAPS constexpr T wrapping_subtract(T a, std::type_identity_t<T> b) {
  return a - b;
}
template <Wrapping T>
FXDYN_WRAPS constexpr T wrapping_negate(T a) {
  return T{0} - a;
}
template <Wrapping T>
FXDYN_WRAPS constexpr T wrapping_multiply(T a, std::type_identity_t<T> b) {
  return a * b;
}
/// x 2^places without what leaves at the top.
template <Wrapping T>
FXDYN_WRAPS constexpr T wrapping_shift_left(T x, int places) {
  return x << places;
}

}  // namespace fxdyn

#undef FXDYN_WRAPS
