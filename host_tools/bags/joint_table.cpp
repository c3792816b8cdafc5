#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <numeric>

#include "host_tools/bags/joint_message.hpp"
#include "host_tools/bags/joint_recording.hpp"
#include "host_tools/support/error.hpp"

namespace fxdyn {
namespace {

/// A publisher that pauses for longer than that many of its steps leaves nothing to interpolate: as of a log's rows.
constexpr std::int64_t longest_gap_steps = 10;

std::string name_of(const JointStream& stream, std::size_t column) {
  const std::size_t n = stream.joints.size();
  return stream.joints[column % n] + '.' + slot_name(stream.slots[column / n]);
}

bool is_empty(const std::vector<double>& column) {
  return std::all_of(column.begin(), column.end(), [](double value) { return std::isnan(value); });
}

/// Which of the names the stream has: its column, or -1.
std::vector<std::ptrdiff_t> columns_in(const JointStream& stream, const std::vector<std::string>& names) {
  std::vector<std::ptrdiff_t> out(names.size(), -1);
  for (std::size_t c = 0; c < stream.columns.size(); ++c) {
    const auto found = std::find(names.begin(), names.end(), name_of(stream, c));
    if (found != names.end() && !is_empty(stream.columns[c]))
      out[static_cast<std::size_t>(found - names.begin())] = static_cast<std::ptrdiff_t>(c);
  }
  return out;
}

/// What is taken of a stream: name -> column.
struct Share {
  JointStream* stream;
  std::vector<std::ptrdiff_t> columns;  ///< of each name, -1: another stream has it
};

/// The stream with most of the names first, then those that have what is missing.
std::vector<Share> shares_of(JointTopic& topic, const std::vector<std::string>& names) {
  std::vector<Share> all, out;
  for (JointStream& stream : topic.streams) all.push_back({&stream, columns_in(stream, names)});
  std::vector<bool> have(names.size(), false);
  const auto missing = [&](const Share& share) {
    std::size_t count = 0;
    for (std::size_t k = 0; k < names.size(); ++k) count += share.columns[k] >= 0 && !have[k] ? 1 : 0;
    return std::pair(count, share.stream->stamps_ns.size());
  };
  while (!all.empty()) {
    const auto best = std::max_element(all.begin(), all.end(),
                                       [&](const Share& a, const Share& b) { return missing(a) < missing(b); });
    if (missing(*best).first == 0) break;
    for (std::size_t k = 0; k < names.size(); ++k) {
      if (have[k]) best->columns[k] = -1;
      have[k] = have[k] || best->columns[k] >= 0;
    }
    out.push_back(std::move(*best));
    all.erase(best);
  }
  return out;
}

/// Rows by rising stamps. Chunks and networks mix up their order; a message that came twice counts once.
void sort_rows(JointStream& stream, const std::string& where) {
  std::vector<std::int64_t>& stamps = stream.stamps_ns;
  const auto ends_rise = [](std::int64_t a, std::int64_t b) { return a >= b; };
  if (std::adjacent_find(stamps.begin(), stamps.end(), ends_rise) == stamps.end()) return;
  std::vector<std::size_t> order(stamps.size());
  std::iota(order.begin(), order.end(), 0);
  std::stable_sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) { return stamps[a] < stamps[b]; });
  const auto is_same = [&](std::size_t a, std::size_t b) {
    return std::all_of(stream.columns.begin(), stream.columns.end(), [&](const std::vector<double>& column) {
      return column[a] == column[b] || (std::isnan(column[a]) && std::isnan(column[b]));
    });
  };
  std::vector<std::size_t> kept;
  for (const std::size_t row : order) {
    if (!kept.empty() && stamps[kept.back()] == stamps[row]) {
      if (is_same(kept.back(), row)) continue;
      throw InputError(
          fmt::format("{}: two messages of '{}' have one stamp ({} ns) and other numbers: two publishers of "
                      "the same joints; record one of them",
                      where, stream.joints.front(), stamps[row]));
    }
    kept.push_back(row);
  }
  const auto reorder = [&](auto& column) {
    auto in_order = column;
    in_order.resize(kept.size());
    for (std::size_t k = 0; k < kept.size(); ++k) in_order[k] = column[kept[k]];
    column = std::move(in_order);
  };
  for (std::vector<double>& column : stream.columns) reorder(column);
  reorder(stamps);
}

void check_gaps(const JointStream& stream, std::int64_t from, std::int64_t to, const std::string& where) {
  const std::vector<std::int64_t>& stamps = stream.stamps_ns;
  std::vector<std::int64_t> steps;
  for (std::size_t k = 1; k < stamps.size(); ++k) steps.push_back(stamps[k] - stamps[k - 1]);
  if (steps.empty()) return;
  std::nth_element(steps.begin(), steps.begin() + static_cast<std::ptrdiff_t>(steps.size() / 2), steps.end());
  const std::int64_t step = steps[steps.size() / 2];
  for (std::size_t k = 1; k < stamps.size(); ++k) {
    if (stamps[k] <= from || stamps[k - 1] >= to || (stamps[k] - stamps[k - 1]) / longest_gap_steps <= step) continue;
    throw InputError(
        fmt::format("{}: the publisher of '{}' pauses for {:.3g} s while the others go on: record it again", where,
                    stream.joints.front(), static_cast<double>(stamps[k] - stamps[k - 1]) / 1e9));
  }
}

/// At other stamps inside of its own.
std::vector<double> interpolated(const JointStream& stream, const std::vector<double>& column,
                                 const std::vector<std::int64_t>& at) {
  std::vector<double> out;
  out.reserve(at.size());
  std::size_t k = 0;
  for (const std::int64_t stamp : at) {
    while (k + 1 < column.size() && stream.stamps_ns[k + 1] <= stamp) ++k;
    const std::int64_t left = stream.stamps_ns[k];
    if (left == stamp || k + 1 == column.size()) {
      out.push_back(column[k]);
      continue;
    }
    const double share = static_cast<double>(stamp - left) / static_cast<double>(stream.stamps_ns[k + 1] - left);
    out.push_back(column[k] + share * (column[k + 1] - column[k]));
  }
  return out;
}

std::string merge_note(const std::vector<Share>& shares, const JointStream& base, const std::string& where) {
  std::vector<std::string> joints;
  for (const Share& share : shares)
    if (share.stream != &base) joints.push_back(fmt::format("'{}'", fmt::join(share.stream->joints, "', '")));
  return fmt::format("{}: {} of other publishers {} brought to the stamps of '{}', by interpolation", where,
                     fmt::join(joints, ", "), joints.size() == 1 ? "is" : "are", base.joints.front());
}

}  // namespace

std::vector<std::string> column_names(const JointTopic& topic) {
  std::vector<std::string> out{"t"};
  for (const JointStream& stream : topic.streams) {
    for (std::size_t c = 0; c < stream.columns.size(); ++c) {
      const std::string name = name_of(stream, c);
      if (!is_empty(stream.columns[c]) && std::find(out.begin(), out.end(), name) == out.end()) out.push_back(name);
    }
  }
  return out;
}

JointTable take_table(JointTopic& topic, const std::vector<std::string>& names, const std::string& where) {
  JointTable out;
  out.columns.resize(1 + names.size());
  const std::vector<Share> shares = shares_of(topic, names);
  if (shares.empty()) return out;
  std::int64_t first = std::numeric_limits<std::int64_t>::max();
  for (const JointStream& stream : topic.streams)
    first = std::min(first, *std::min_element(stream.stamps_ns.begin(), stream.stamps_ns.end()));
  for (const Share& share : shares) sort_rows(*share.stream, where);
  const auto fastest = std::max_element(shares.begin(), shares.end(), [](const Share& a, const Share& b) {
    return a.stream->stamps_ns.size() < b.stream->stamps_ns.size();
  });
  const JointStream& base = *fastest->stream;
  std::int64_t from = base.stamps_ns.front(), to = base.stamps_ns.back();
  for (const Share& share : shares) {
    if (share.stream->by_log_time != base.by_log_time)
      throw InputError(
          fmt::format("{}: mixed clocks: the stamps of '{}' are its publisher's, those of '{}' the recorder's", where,
                      base.by_log_time ? share.stream->joints.front() : base.joints.front(),
                      base.by_log_time ? base.joints.front() : share.stream->joints.front()));
    from = std::max(from, share.stream->stamps_ns.front());
    to = std::min(to, share.stream->stamps_ns.back());
  }
  for (const Share& share : shares)
    if (share.stream != &base) check_gaps(*share.stream, from, to, where);
  const auto begin = std::lower_bound(base.stamps_ns.begin(), base.stamps_ns.end(), from);
  const auto end = std::upper_bound(begin, base.stamps_ns.end(), to);
  if (begin == end)
    throw InputError(where + ": its publishers were never there at one time, or have two clocks: record them together");
  const std::vector<std::int64_t> stamps(begin, end);
  for (const std::int64_t stamp : stamps) out.columns[0].push_back(static_cast<double>(stamp - first) / 1e9);
  const auto skipped = static_cast<std::size_t>(begin - base.stamps_ns.begin());
  for (const Share& share : shares) {
    for (std::size_t k = 0; k < names.size(); ++k) {
      if (share.columns[k] < 0) continue;
      std::vector<double>& column = share.stream->columns[static_cast<std::size_t>(share.columns[k])];
      if (share.stream != &base) {
        out.columns[1 + k] = interpolated(*share.stream, column, stamps);
      } else {
        column.resize(skipped + stamps.size());
        column.erase(column.begin(), column.begin() + static_cast<std::ptrdiff_t>(skipped));
        out.columns[1 + k] = std::move(column);
      }
    }
  }
  if (shares.size() > 1) out.note = merge_note(shares, base, where);
  topic.streams.clear();
  return out;
}

}  // namespace fxdyn
