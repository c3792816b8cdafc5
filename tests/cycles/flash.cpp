#include "tests/cycles/flash.hpp"

#include <algorithm>

namespace fxdyn::cycles {
namespace {

constexpr std::size_t instruction_lines = 32, data_lines = 8;  // RM0440: of 4 x 64 or 2 x 128 bits

}  // namespace

bool LineCache::has(std::uint32_t address) const {
  return std::any_of(kept_.begin(), kept_.end(), [&](const Line& line) {
    return line.address == address / line_bytes && (line.valid & part(address)) != 0;
  });
}

bool LineCache::use(std::uint32_t address) {
  const auto line =
      std::find_if(kept_.begin(), kept_.end(), [&](const Line& one) { return one.address == address / line_bytes; });
  if (line == kept_.end() || (line->valid & part(address)) == 0) return false;
  std::rotate(line, line + 1, kept_.end());
  return true;
}

void LineCache::fill(std::uint32_t address) {
  const auto line =
      std::find_if(kept_.begin(), kept_.end(), [&](const Line& one) { return one.address == address / line_bytes; });
  if (line != kept_.end()) {
    line->valid |= part(address);
    std::rotate(line, line + 1, kept_.end());
    return;
  }
  if (kept_.size() == lines_) kept_.erase(kept_.begin());
  kept_.push_back({address / line_bytes, part(address)});
}

Flash::Flash(const FlashSetup& setup)
    : setup_(setup), instruction_cache_(instruction_lines, setup.width), data_cache_(data_lines, setup.width) {}

void Flash::forget() {
  instructions_ = data_ = prefetched_ = to_prefetch_ = {};
  instruction_cache_.clear();
  data_cache_.clear();
}

Time Flash::read(Time now) {
  free_ = std::max(now, free_) + 1 + static_cast<Time>(setup_.wait_states);
  return free_;
}

Time Flash::start_prefetch() {
  prefetched_ = Read{to_prefetch_->line, read(to_prefetch_->ready)};
  to_prefetch_.reset();
  return prefetched_->ready;
}

void Flash::start_prefetch_before(Time now) {
  if (to_prefetch_ && std::max(to_prefetch_->ready, free_) < now) start_prefetch();
}

Time Flash::fetch(std::uint32_t address, Time now) {
  start_prefetch_before(now);
  const std::uint32_t line = line_of(address);
  if (instructions_ && instructions_->line == line) return std::max(now + 1, instructions_->ready);

  Time ready = now + 1;
  bool was_cached = false;
  if (to_prefetch_ && to_prefetch_->line == line) start_prefetch();
  if (prefetched_ && prefetched_->line == line) {
    const bool is_late = prefetched_->ready > ready;
    ready = std::max(ready, prefetched_->ready);
    const bool is_copied =
        setup_.prefetch == Prefetch::copied || (setup_.prefetch == Prefetch::copied_if_late && is_late);
    if (setup_.caches && is_copied) instruction_cache_.fill(line);
  } else if (setup_.caches && instruction_cache_.use(line)) {
    was_cached = true;
  } else {
    ready = read(now);
    if (setup_.caches) instruction_cache_.fill(line);
  }
  instructions_ = Read{line, ready};

  to_prefetch_.reset();
  const std::uint32_t next = line + setup_.width;
  const bool is_wanted = setup_.prefetch != Prefetch::off && !(was_cached && setup_.prefetch == Prefetch::apart);
  const bool is_there = (prefetched_ && prefetched_->line == next) || (setup_.caches && instruction_cache_.has(next));
  if (is_wanted && !is_there) to_prefetch_ = Read{next, ready};
  return ready;
}

Time Flash::load(std::uint32_t address, Time now, bool misses) {
  start_prefetch_before(now);
  const std::uint32_t line = line_of(address);
  if (!misses) {
    if (data_ && data_->line == line) return std::max(now + 1, data_->ready);
    if (setup_.caches && data_cache_.use(line)) {
      data_ = Read{line, now + 1};
      return now + 1;
    }
  }
  const Time ready = read(now);
  if (setup_.caches) data_cache_.fill(misses ? elsewhere_ += LineCache::line_bytes : line);
  data_.reset();
  if (!misses) data_ = Read{line, ready};
  return ready;
}

}  // namespace fxdyn::cycles
