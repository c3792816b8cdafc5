#include "host_tools/readers/column_cut.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "host_tools/support/error.hpp"

namespace fxdyn {

ColumnTable cut_rows(std::vector<std::vector<double>> columns, const std::vector<std::string>& names,
                     const LogRequest& request, const std::string& where, std::string& note) {
  ColumnTable out;
  out.first_t = columns[0].front();
  out.last_t = columns[0].back();
  const auto bound = [&](double t) {
    return static_cast<std::size_t>(std::lower_bound(columns[0].begin(), columns[0].end(), t) - columns[0].begin());
  };
  std::size_t begin = bound(request.from), end = bound(request.to);
  const auto bad = [&](std::size_t row) {
    return std::find_if(columns.begin(), columns.end(),
                        [&](const std::vector<double>& column) { return !std::isfinite(column[row]); }) -
           columns.begin();
  };
  const auto all = static_cast<std::ptrdiff_t>(columns.size());
  const std::size_t rows = end - std::min(begin, end);
  while (begin < end && bad(begin) != all) ++begin;
  while (begin < end && bad(end - 1) != all) --end;
  if (begin < end && end - begin < rows)
    note += fmt::format("{}{}: {} rows at its ends are not numbers in every column: left out", note.empty() ? "" : "; ",
                        where, rows - (end - begin));
  for (std::size_t row = begin; row < end; ++row) {
    if (const auto column = bad(row); column != all)
      throw InputError(
          fmt::format("{}: '{}' is no number at t = {:.9g} s, though it is one before and after; cut it out "
                      "by from_s and to_s, or record it again",
                      where, names[static_cast<std::size_t>(column)], columns[0][row]));
  }
  for (std::vector<double>& column : columns) {
    column.resize(std::max(begin, end));
    column.erase(column.begin(), column.begin() + static_cast<std::ptrdiff_t>(begin));
  }
  out.columns = std::move(columns);
  return out;
}

}  // namespace fxdyn
