#pragma once

#include <algorithm>
#include <atomic>
#include <cstddef>
#include <exception>
#include <mutex>
#include <thread>
#include <vector>

namespace fxdyn {

/// Long logs are worked on by one thread: each takes memory for its own columns.
inline std::atomic<std::size_t> most_threads{~std::size_t{0}};

/// work(i) for i = 0 .. count-1 on all cores. Each i writes its own result, so the outcome does not depend on the
/// number of threads. The first exception is thrown again here.
template <class Work>
void parallel_for(std::size_t count, Work&& work) {
  const std::size_t threads =
      std::min<std::size_t>({count, std::max(1U, std::thread::hardware_concurrency()), most_threads.load()});
  std::atomic<std::size_t> next = 0;
  std::exception_ptr failure;
  std::mutex mutex;
  const auto run = [&] {
    for (std::size_t i; (i = next++) < count;) {
      try {
        work(i);
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
