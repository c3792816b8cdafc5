#include "tests/cycles/core.hpp"

#include <algorithm>

namespace fxdyn::cycles {
namespace {

constexpr std::uint32_t word = 4;
std::uint32_t word_of(std::uint32_t address) { return address & ~(word - 1); }

/// From a word that has come to the execution of what is in it.
constexpr Time decode = 1;
constexpr Time most_penalty = 3;

bool is_odd(std::uint32_t address, std::uint32_t size) { return size == 4 && address % word != 0; }

}  // namespace

Time Core::fetch(std::uint32_t address, Time now) {
  if (setup_.ideal_memory || !is_in_flash(address)) return now + 1;
  return flash_.fetch(address + setup_.moved_by, now);
}

void Core::fetch_ahead(Time until) {
  while (ready_.size() < fetched_words && may_fetch_ < until) {
    may_fetch_ = fetch(end_, may_fetch_);
    ready_.push_back(may_fetch_);
    end_ += word;
  }
}

Time Core::wait_for(std::uint32_t address, std::uint32_t size, Time now) {
  fetch_ahead(now);
  const std::uint32_t last = word_of(address + size - 1);
  while (end_ <= last) {
    may_fetch_ = fetch(end_, may_fetch_);
    ready_.push_back(may_fetch_);
    end_ += word;
  }
  const Time begins = std::max(now, ready_[(last - begin_) / word] + decode);
  fetch_ahead(begins);
  if (ready_.size() >= fetched_words) may_fetch_ = std::max(may_fetch_, begins);  // room from now on
  while (begin_ < word_of(address + size)) {
    ready_.erase(ready_.begin());
    begin_ += word;
  }
  return begins;
}

void Core::refill(std::uint32_t address, std::uint32_t size, Time branched, Time penalty) {
  fetch_ahead(branched);  // a fetch that runs is not broken off
  begin_ = end_ = word_of(address);
  ready_.clear();
  const Time fetches = is_odd(address, size) ? 2 : 1;
  may_fetch_ = std::max(may_fetch_, branched + 1 + penalty - decode - fetches);
}

Time Core::penalty(Kind kind, std::uint32_t target, std::uint32_t target_size) const {
  if (setup_.ends == Ends::fastest) return 1;
  if (setup_.ends == Ends::slowest) return most_penalty;
  const Time late = kind == Kind::branch ? 1 : kind == Kind::branch_to_register ? 2 : 3;
  return std::min(most_penalty, late + (is_odd(target, target_size) ? 1 : 0));
}

Time Core::execute(const Step& step, std::span<const Access> accesses, Time now) {
  const Instruction& instruction = *step.instruction;
  const bool fastest = setup_.ends == Ends::fastest, slowest = setup_.ends == Ends::slowest;
  const Before before = before_;
  before_ = {};

  const bool skipped = instruction.transfers > 0 && accesses.empty();  // its condition was not met
  if (!skipped && instruction.transfers > 0 && !fastest && (instruction.address_from & before.computed) != 0)
    ++now;  // "there is no forwarding path"
  if (instruction.transfers == 0 || skipped) before_.computed = instruction.writes;

  // Data out of the flash keep the core waiting, word after word; everything else comes in time.
  Time late = 0, words = 0;
  for (const Access& access : accesses) {
    const Time at = now + words++ + late;
    if (!access.is_load || setup_.ideal_memory || !is_in_flash(access.address)) continue;
    late += flash_.load(access.address + setup_.moved_by, at, setup_.misses && access.may_miss) - (at + 1);
  }
  if (skipped) return now + 1;
  const bool pipelined = before.loads && (instruction.address_from & before.loaded) == 0 && !slowest;
  switch (instruction.kind) {
    case Kind::data:
      return now + 1;
    case Kind::multiply_add:
      return now + (slowest ? 2 : 1);
    case Kind::divide:
      return now + (fastest ? 2 : 12);
    case Kind::load_literal:
    case Kind::load:
      before_.loads = true;
      before_.loaded = instruction.writes;
      if (slowest && instruction.kind == Kind::load_literal) ++late;
      return now + (pipelined ? 1 : 2) + late;
    case Kind::store:
      return now + 1;
    case Kind::store_at_register:
      return now + (pipelined ? 1 : 2);
    case Kind::multiple:
    case Kind::load_pc:
      return now + 1 + instruction.transfers + late;
    case Kind::branch:
    case Kind::branch_to_register:
      return now + 1;
    case Kind::if_then:
      return now + (fastest ? 0 : 1);
    case Kind::status:
      return now + 2;
    case Kind::barrier:
      return now + 1 + (slowest ? most_penalty : 0);
  }
  return now;
}

Time Core::run(std::span<const Step> steps, std::span<const Access> accesses, std::uint32_t after) {
  before_ = {};
  if (steps.empty()) return 0;
  const Step& first = steps.front();
  refill(first.address, first.instruction->size, now_, most_penalty);
  Time begin = 0;
  for (std::size_t i = 0; i < steps.size(); ++i) {
    const Step& step = steps[i];
    const std::uint32_t size = step.instruction->size;
    std::size_t touched = 0;
    while (touched < accesses.size() && accesses[touched].step == i) ++touched;
    now_ = wait_for(step.address, size, now_);
    if (i == 0) begin = now_;
    now_ = execute(step, accesses.first(touched), now_);
    accesses = accesses.subspan(touched);

    const bool is_last = i + 1 == steps.size();
    const std::uint32_t next = is_last ? after : steps[i + 1].address;
    if (next == step.address + size) continue;
    const std::uint32_t next_size = is_last ? 2 : steps[i + 1].instruction->size;
    // A branch is taken in the last cycle of what its instruction needs without the refill.
    refill(next, next_size, now_ - 1, penalty(step.instruction->kind, next, next_size));
    if (is_last) now_ = wait_for(next, next_size, now_);
  }
  return now_ - begin;
}

}  // namespace fxdyn::cycles
