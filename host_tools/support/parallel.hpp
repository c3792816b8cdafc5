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

/// The cores; FXDYN_THREADS takes fewer, for users who run several programs side by side. Anything but a positive
/// number leaves it open.
inline std::size_t threads_allowed() {
  const char* text = std::getenv("FXDYN_THREADS");
  const unsigned long threads = text != nullptr ? std::strtoul(text, nullptr, 10) : 0;
  const std::size_t cores = std::max(1U, std::thread::hardware_concurrency());
  return threads > 0 ? std::min<std::size_t>(threads, cores) : cores;
}

/// The most threads that loops of this thread take. Changed by ThreadLimit.
inline thread_local std::size_t most_threads = threads_allowed();

/// While it lives, loops of the thread that made it, and loops within those, take at most so many threads. Loops lie
/// deep below the stage that knows how many may work; an argument would go through every function between them. Each
/// thread has a limit of its own, so work side by side does not see another's.
class ThreadLimit {
 public:
  explicit ThreadLimit(std::size_t threads) : before_(most_threads) { most_threads = std::min(threads, before_); }
  ~ThreadLimit() { most_threads = before_; }
  ThreadLimit(const ThreadLimit&) = delete;
  ThreadLimit& operator=(const ThreadLimit&) = delete;

 private:
  std::size_t before_;
};

/// task(i) for i = 0 .. count-1 on as many threads as ThreadLimit leaves. Each i writes its own result, so the outcome
/// does not depend on their number. Loops within share the threads out: they take what this one leaves free. The first
/// exception is thrown again here.
template <class Task>
void parallel_for(std::size_t count, Task&& task) {
  const std::size_t limit = most_threads, threads = std::min(count, limit);
  std::atomic<std::size_t> next = 0;
  std::exception_ptr failure;
  std::mutex mutex;
  const auto run = [&] {
    const ThreadLimit within(std::max<std::size_t>(1, limit / std::max<std::size_t>(1, threads)));
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
  const auto run_within = [&] {
    most_threads = limit;
    run();
  };
  for (std::size_t t = 1; t < threads; ++t) pool.emplace_back(run_within);
  run();
  pool.clear();
  if (failure) std::rethrow_exception(failure);
}

}  // namespace fxdyn
