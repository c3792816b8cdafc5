#include "host_tools/regression/split.hpp"

#include <algorithm>

namespace fxdyn {
namespace {

bool has_validation(const std::vector<LogUse>& logs) {
  return std::any_of(logs.begin(), logs.end(), [](const LogUse& log) { return !log.fits; });
}

std::vector<LogUse> uses_of(const std::vector<LogRows>& logs) {
  std::vector<LogUse> out;
  for (const LogRows& log : logs) out.push_back({.rows = log.rows, .fits = log.role != Role::validate});
  return out;
}

}  // namespace

std::vector<LogPart> parts_of(const std::vector<LogUse>& logs, LeaveOut leave_out) {
  const auto judges = std::count_if(logs.begin(), logs.end(), [](const LogUse& log) { return log.judges; });
  const bool is_cut = !has_validation(logs) && (judges == 1 || leave_out == LeaveOut::part_of_each);
  std::vector<LogPart> parts;
  Eigen::Index first = 0;
  for (std::size_t l = 0; l < logs.size(); ++l) {
    for (const RowRange& range : cut({first, logs[l].rows}, is_cut && logs[l].judges ? blocks_of_one_log : 1))
      parts.push_back({l, range});
    first += logs[l].rows;
  }
  return parts;
}

std::vector<Fold> folds_of(const std::vector<LogUse>& logs, const std::vector<LogPart>& parts, LeaveOut leave_out) {
  const bool validated = has_validation(logs);
  std::vector<std::size_t> fit;
  std::vector<std::vector<std::size_t>> judges;  // by fold
  std::size_t of_log = 0;                        // parts of the log so far
  for (std::size_t p = 0; p < parts.size(); ++p) {
    const LogUse& log = logs[parts[p].log];
    if (p > 0 && parts[p].log != parts[p - 1].log) of_log = 0;
    if (log.fits) fit.push_back(p);
    if (!(validated ? !log.fits : log.judges)) continue;
    const std::size_t fold = validated ? 0 : leave_out == LeaveOut::part_of_each ? of_log++ : judges.size();
    if (fold >= judges.size()) judges.resize(fold + 1);
    judges[fold].push_back(p);
  }
  std::vector<Fold> folds;
  for (std::vector<std::size_t>& judge : judges) {
    Fold fold{fit, std::move(judge)};
    std::erase_if(fold.fit, [&](std::size_t p) {
      return std::find(fold.judge.begin(), fold.judge.end(), p) != fold.judge.end();
    });
    folds.push_back(std::move(fold));
  }
  return folds;
}

std::vector<LogBlock> make_blocks(const std::vector<LogRows>& logs) {
  std::vector<LogBlock> blocks;
  for (const LogPart& part : parts_of(uses_of(logs))) {
    const RowRange& rows = part.rows;
    blocks.push_back({part.log, rows.first, rows.first + rows.count, logs[part.log].role == Role::train});
  }
  return blocks;
}

Split make_split(const std::vector<LogRows>& logs) {
  const std::vector<LogUse> uses = uses_of(logs);
  Split split;
  split.has_validation = has_validation(uses);
  split.kind = split.has_validation ? "validate logs"
               : logs.size() > 1
                   ? "each train log judged by a fit of the others (no log has the role validate)"
                   : "blocks of the train log (no log has the role validate, and there is one trajectory only)";
  for (Fold& fold : folds_of(uses, parts_of(uses))) {
    split.fit.push_back(std::move(fold.fit));
    split.judge.push_back(std::move(fold.judge));
  }
  return split;
}

}  // namespace fxdyn
