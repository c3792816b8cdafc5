#pragma once

#include <concepts>
#include <cstddef>
#include <cstdint>
#include <span>

namespace fxdyn::hal {

/// A byte stream in both directions. Neither call blocks: each returns how many bytes it moved, possibly none.
template <class T>
concept SerialPort = requires(T& port, std::span<std::uint8_t> in, std::span<const std::uint8_t> out) {
  { port.read(in) } -> std::same_as<std::size_t>;
  { port.write(out) } -> std::same_as<std::size_t>;
};

}  // namespace fxdyn::hal
