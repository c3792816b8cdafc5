#pragma once

#include <array>
#include <atomic>
#include <cstddef>
#include <cstdint>

namespace fxdyn::hal {

/// A queue between an interrupt that fills it and code that empties it, without masking either.
template <class T, std::uint32_t size>
class Ring {
  static_assert((size & (size - 1)) == 0, "the indices run freely and wrap");

 public:
  /// False: full, and the item is dropped.
  bool push(const T& item) {
    const std::uint32_t head = head_.load(std::memory_order_relaxed);
    if (head - tail_.load(std::memory_order_acquire) == size) return false;
    items_[head % size] = item;
    head_.store(head + 1, std::memory_order_release);
    return true;
  }
  bool pop(T& item) {
    const std::uint32_t tail = tail_.load(std::memory_order_relaxed);
    if (head_.load(std::memory_order_acquire) == tail) return false;
    item = items_[tail % size];
    tail_.store(tail + 1, std::memory_order_release);
    return true;
  }
  bool empty() const { return head_.load(std::memory_order_acquire) == tail_.load(std::memory_order_relaxed); }

 private:
  std::array<T, size> items_{};
  std::atomic<std::uint32_t> head_{0};  // written by push()
  std::atomic<std::uint32_t> tail_{0};  // written by pop()
};

}  // namespace fxdyn::hal
