#pragma once

#include <algorithm>
#include <atomic>
#include <cstddef>
#include <cstdlib>
#include <exception>
#include <mutex>
#include <thread>
#include <vector>

namespace fxdyn {

/// FXDYN_THREADS: the most threads that a program takes, for users who run several side by side. Anything but a
/// positive number leaves it open.
inline std::size_t threads_allowed() {
  const char* text = std::getenv("FXDYN_THREADS");
  const unsigned long threads = text != nullptr ? std::strtoul(text, nullptr, 10) : 0;
  return threads > 0 ? threads : ~std::size_t{0};
}

/// Long logs are worked on by one thread: each takes memory for its own columns.
inline std::atomic<std::size_t> most_threads{threads_allowed()};

/// task(i) for i = 0 .. count-1 on all cores. Each i writes its own result, so the outcome does not depend on the
/// number of threads. The first exception is thrown again here.
template <class Task>
void parallel_for(std::size_t count, Task&& task) {
  const std::size_t threads =
      std::min<std::size_t>({count, std::max(1U, std::thread::hardware_concurrency()), most_threads.load()});
  std::atomic<std::size_t> next = 0;
  std::exception_ptr failure;
  std::mutex mutex;
  const auto run = [&] {
    for (std::size_t i; (i = next++) < count;) {
      try {
        task(i);
      } catch (...) {
        const std::lock_guard lock(mutex);
        if (!failure) failure = std::current_exception();
      }
    }
  };
  std::vector<std::jthread> pool;
  for (std::size_t t = 1; t < threads; ++t) pool.emplace_back(run);
  run();
  pool.clear();
  if (failure) std::rethrow_exception(failure);
}

}  // namespace fxdyn
