#pragma once

#include <algorithm>
#include <array>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <span>

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
  /// Takes out as many as there are and fit; returns how many.
  std::size_t pop(std::span<T> items) {
    const std::uint32_t tail = tail_.load(std::memory_order_relaxed);
    const std::size_t there = head_.load(std::memory_order_acquire) - tail;
    const std::size_t count = there < items.size() ? there : items.size();
    const std::size_t from = tail % size, until_wrap = size - from, first = count < until_wrap ? count : until_wrap;
    std::copy_n(items_.begin() + from, first, items.begin());
    std::copy_n(items_.begin(), count - first, items.begin() + static_cast<std::ptrdiff_t>(first));
    tail_.store(tail + static_cast<std::uint32_t>(count), std::memory_order_release);
    return count;
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
