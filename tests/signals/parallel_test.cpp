// Loops over several threads, and how many they take.

#include "host_tools/support/parallel.hpp"

#include <gtest/gtest.h>

#include <chrono>
#include <set>
#include <stdexcept>

namespace fxdyn {
namespace {

/// The threads that a loop of `count` tasks ran on.
std::set<std::thread::id> threads_of(std::size_t count) {
  std::mutex mutex;
  std::set<std::thread::id> out;
  parallel_for(count, [&](std::size_t) {
    std::this_thread::sleep_for(std::chrono::milliseconds(2));  // so that each gets some
    const std::lock_guard lock(mutex);
    out.insert(std::this_thread::get_id());
  });
  return out;
}

TEST(ParallelFor, RunsEachTaskOnce) {
  std::vector<int> times(100, 0);
  parallel_for(times.size(), [&](std::size_t i) { ++times[i]; });
  EXPECT_EQ(times, std::vector<int>(100, 1));
}

TEST(ParallelFor, ThrowsWhatATaskThrows) {
  EXPECT_THROW(parallel_for(4, [](std::size_t i) { return i == 2 ? throw std::runtime_error("two") : 0; }),
               std::runtime_error);
}

TEST(ThreadLimit, HoldsWhileItLives) {
  const std::size_t before = most_threads;
  {
    const ThreadLimit one(1);
    EXPECT_EQ(threads_of(20), (std::set{std::this_thread::get_id()}));
  }
  EXPECT_EQ(most_threads, before);
}

TEST(ThreadLimit, AnInnerOneDoesNotRaiseIt) {
  const ThreadLimit one(1);
  const ThreadLimit more(100);
  EXPECT_EQ(threads_of(20).size(), 1U);
}

/// The threads that loops within a loop of `count` tasks may take, where that one may take six.
std::vector<std::size_t> within(std::size_t count) {
  const std::size_t before = most_threads;
  most_threads = 6;
  std::vector<std::size_t> out(count);
  parallel_for(count, [&](std::size_t i) { out[i] = most_threads; });
  EXPECT_EQ(most_threads, 6U);
  most_threads = before;
  return out;
}

TEST(ThreadLimit, IsSharedOutToLoopsWithinALoop) {
  EXPECT_EQ(within(1), (std::vector<std::size_t>{6}));
  EXPECT_EQ(within(2), (std::vector<std::size_t>{3, 3}));
  EXPECT_EQ(within(8), std::vector<std::size_t>(8, 1));
}

TEST(ThreadLimit, IsOfOneThreadAlone) {
  const ThreadLimit one(1);
  std::size_t other = 0;
  std::jthread([&] { other = most_threads; }).join();
  EXPECT_EQ(other, threads_allowed());
}

}  // namespace
}  // namespace fxdyn
