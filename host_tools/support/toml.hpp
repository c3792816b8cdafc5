#pragma once

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <toml++/toml.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <limits>
#include <optional>
#include <string>
#include <vector>

#include "host_tools/support/error.hpp"
#include "host_tools/support/nearest.hpp"

/// Strict reading of TOML files: every key is asked for, others are refused with the nearest known one, and each
/// complaint names file, line and key.
namespace fxdyn::toml_input {

using Names = std::vector<std::string>;

/// What was named in place of a TOML file, as far as its first line that is no comment shows; else empty.
inline std::string other_file(const std::filesystem::path& file) {
  std::string line;
  std::ifstream in(file);
  while (std::getline(in, line) && (line.empty() || line.starts_with('#'))) continue;
  if (line.find('<') < 4) return "is XML (a URDF?)";
  if (line.find('\0') != std::string::npos) return "is no text";
  if (line.starts_with('{')) return "is JSON";
  if (std::count(line.begin(), line.end(), ',') > 1 && line.find('=') == std::string::npos)
    return "is a table (a log?)";
  return "";
}

/// @throws InputError with file and line.
inline toml::table parse(const std::filesystem::path& file) {
  if (std::filesystem::is_directory(file)) throw InputError(file.string() + ": is a folder; name the TOML file in it");
  try {
    return toml::parse_file(file.string());
  } catch (const toml::parse_error& error) {
    const auto line = error.source().begin.line;
    if (line == 0) throw InputError(file.string() + ": can't be read; check the path");
    if (const std::string other = other_file(file); !other.empty())
      throw InputError(fmt::format("{}: {}: name the TOML file that speaks of it", file.string(), other));
    throw InputError(fmt::format("{}:{}: not valid TOML: {}", file.string(), line, error.description()));
  }
}

/// A place in a file, for messages.
struct Place {
  std::string file;
  std::string path;  ///< of the key, as in "robot.gravity"
  int line = 0;

  std::string message(const std::string& what) const {
    return path.empty() ? fmt::format("{}:{}: {}", file, line, what)
                        : fmt::format("{}:{}: {}: {}", file, line, path, what);
  }
  [[noreturn]] void fail(const std::string& what) const { throw InputError(message(what)); }
};

inline int line_of(const toml::node& node) { return static_cast<int>(node.source().begin.line); }

/// A value with its place; conversions fail with one line.
class Value {
 public:
  Value(Place place, const toml::node& node) : place_(std::move(place)), node_(node) {}

  const Place& place() const { return place_; }

  double number() const {
    const auto value = node_.value<double>();
    if (!value || !node_.is_number() || !std::isfinite(*value)) place_.fail("expected a number");
    return *value;
  }
  double positive() const {
    const double value = number();
    if (!(value > 0)) place_.fail("expected a number above 0");
    return value;
  }
  std::int64_t integer(std::int64_t lowest) const {
    if (!node_.is_integer() || *node_.value<std::int64_t>() < lowest) {
      place_.fail(fmt::format("expected an integer of at least {}", lowest));
    }
    return *node_.value<std::int64_t>();
  }
  int count(int lowest) const {
    return static_cast<int>(std::min<std::int64_t>(integer(lowest), std::numeric_limits<int>::max()));
  }
  bool boolean() const {
    if (!node_.is_boolean()) place_.fail("expected true or false");
    return *node_.value<bool>();
  }
  bool is_boolean() const { return node_.is_boolean(); }
  bool is_string() const { return node_.is_string(); }
  bool is_list() const { return node_.is_array(); }
  std::string string() const {
    if (!node_.is_string()) place_.fail("expected a string in quotes");
    return *node_.value<std::string>();
  }
  /// One of a list of names.
  std::string name(const Names& known, std::string_view kind) const {
    std::string word = string();
    if (std::find(known.begin(), known.end(), word) == known.end()) {
      place_.fail(fmt::format("unknown {} '{}'; nearest is '{}' (known: {})", kind, word, nearest(word, known),
                              fmt::join(known, " ")));
    }
    return word;
  }
  std::vector<Value> items() const {
    if (!node_.is_array()) place_.fail("expected a list in [ ]");
    std::vector<Value> values;
    for (const toml::node& item : *node_.as_array()) values.emplace_back(at(item), item);
    return values;
  }
  /// A list of numbers; `size` 0: any.
  std::vector<double> numbers(std::size_t size, std::string_view per) const {
    std::vector<double> values;
    for (const Value& item : items()) values.push_back(item.number());
    expect(values.size(), size, per);
    return values;
  }
  std::vector<double> positives(std::size_t size, std::string_view per) const {
    std::vector<double> values = numbers(size, per);
    for (const double value : values) {
      if (!(value > 0)) place_.fail(fmt::format("expected numbers above 0, found {}", value));
    }
    return values;
  }
  void expect(std::size_t found, std::size_t size, std::string_view per) const {
    if (size > 0 && found != size) place_.fail(fmt::format("has {} values, expected {} ({})", found, size, per));
  }
  const toml::table& table() const {
    if (!node_.is_table()) place_.fail("expected a table");
    return *node_.as_table();
  }

 private:
  Place at(const toml::node& item) const {
    Place place = place_;
    place.line = std::max(line_of(item), 1);
    return place;
  }
  Place place_;
  const toml::node& node_;
};

/// A table whose keys are all asked for; finish() refuses the others.
class Table {
 public:
  Table(Place place, const toml::table& table) : place_(std::move(place)), table_(table) {}
  explicit Table(const Value& value) : Table(value.place(), value.table()) {}

  const Place& place() const { return place_; }

  std::optional<Value> find(const std::string& key) {
    known_.push_back(key);
    const toml::node* node = table_.get(key);
    if (!node) return std::nullopt;
    const std::string path = place_.path.empty() ? key : place_.path + "." + key;
    return Value({place_.file, path, line_of(*node)}, *node);
  }
  Value need(const std::string& key, std::string_view hint) {
    auto value = find(key);
    if (!value) place_.fail(fmt::format("key '{}' is missing; {}", key, hint));
    return *value;
  }
  std::optional<Table> table(const std::string& key) {
    const auto value = find(key);
    return value ? std::optional<Table>(Table(*value)) : std::nullopt;
  }
  void finish() const {
    for (const auto& [key, node] : table_) {
      const std::string word(key.str());
      if (std::find(known_.begin(), known_.end(), word) != known_.end()) continue;
      Place place = place_;
      place.line = static_cast<int>(key.source().begin.line);
      place.fail(fmt::format("unknown key '{}'; nearest is '{}'", word, nearest(word, known_)));
    }
  }

 private:
  Place place_;
  const toml::table& table_;
  Names known_;
};

template <class T, class Get>
void set(T& target, const std::optional<Value>& value, Get get) {
  if (value) target = get(*value);
}
inline const auto as_number = [](const Value& value) { return value.number(); };
inline const auto as_positive = [](const Value& value) { return value.positive(); };
inline const auto as_boolean = [](const Value& value) { return value.boolean(); };
inline const auto as_string = [](const Value& value) { return value.string(); };
inline const auto as_count = [](const Value& value) { return value.count(0); };

}  // namespace fxdyn::toml_input
