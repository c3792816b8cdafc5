#pragma once

#include <array>
#include <optional>
#include <string>
#include <vector>

#include "host_tools/logs/recorded_log.hpp"
#include "host_tools/logs/time_unit.hpp"

namespace fxdyn {

/// Which field of a row holds what.
struct ColumnLayout {
  std::size_t fields = 0;
  std::vector<int> target;                             ///< field -> column of the table of values, -1: not needed
  std::vector<std::string> names;                      ///< of the columns of that table
  std::array<std::vector<int>, signal_count> columns;  ///< signal, joint -> column of that table, -1: none
  std::optional<TimeUnit> unit;                        ///< of the stamps, where it is written down
  /// Whether two signals are read from the column.
  bool is_shared(int column) const {
    std::ptrdiff_t uses = 0;
    for (const auto& signal : columns) uses += std::count(signal.begin(), signal.end(), column);
    return uses > 1;
  }
};

/// The names of a file's columns.
class ColumnNames {
 public:
  /// @param where in front of complaints: file and line, or file and topic
  /// @param has_names else they are only numbers: "#0", "#1", ...
  ColumnNames(std::string where, std::vector<std::string> names, bool has_names = true);
  bool has_names() const { return has_names_; }
  /// @throws InputError: a column is missing, or there twice
  ColumnLayout layout(std::size_t joints, const LogFormat& format, bool torque_required);

 private:
  std::vector<std::string>::const_iterator place_of(const std::string& name) const;
  std::optional<int> take(const std::string& name);
  void add_named(std::size_t signal, const std::vector<std::string>& names, std::size_t joints);
  void add(std::size_t signal, const std::string& name, std::size_t joints, bool required);
  /// @param signal the key of `columns`
  [[noreturn]] void missing(const std::string& signal, const std::string& name, const std::string& meaning) const;
  /// @throws InputError: a column is two signals, or two joints'
  void refuse_two_uses() const;

  std::string where_;
  std::vector<std::string> names_;
  bool has_names_ = true;
  std::size_t joints_ = 0;
  ColumnLayout layout_;
};

/// The rows of a window, in the columns of a layout: column 0 is t.
struct ColumnTable {
  std::vector<std::vector<double>> columns;
  double first_t = 0, last_t = 0;  ///< of the whole file
  std::size_t rows() const { return columns[0].size(); }
};

/// The signals of a log; empties the table.
Log to_log(ColumnTable table, const ColumnLayout& layout, std::size_t joints);

}  // namespace fxdyn
