#include <fmt/format.h>
#include <fmt/ranges.h>
#include <matio.h>

#include <algorithm>
#include <memory>

#include "host_tools/arrays/arrays.hpp"
#include "host_tools/arrays/mat5_elements.hpp"
#include "host_tools/support/error.hpp"

// MATLAB 4 and 5 by libmatio. Its arrays are column-major: the shape is turned round.

namespace fxdyn {
namespace {

/// An array of more structs than that is no log (hand: a scope of Simulink has an axis each).
constexpr std::uint64_t most_structs = 64;

using File = std::unique_ptr<mat_t, int (*)(mat_t*)>;
using Variable = std::unique_ptr<matvar_t, void (*)(matvar_t*)>;

/// Whether the array is one that somebody wants, and takes it: the file stands at its variable.
using Visit = std::function<void(mat_t*, matvar_t*, const ArrayInfo&)>;

const char* type_name(matio_classes kind) {
  switch (kind) {
    case MAT_C_CELL:
      return "cell";
    case MAT_C_STRUCT:
      return "struct";
    case MAT_C_CHAR:
      return "text";
    case MAT_C_SPARSE:
      return "sparse";
    case MAT_C_DOUBLE:
      return "double";
    case MAT_C_SINGLE:
      return "single";
    case MAT_C_INT8:
      return "int8";
    case MAT_C_UINT8:
      return "uint8";
    case MAT_C_INT16:
      return "int16";
    case MAT_C_UINT16:
      return "uint16";
    case MAT_C_INT32:
      return "int32";
    case MAT_C_UINT32:
      return "uint32";
    case MAT_C_INT64:
      return "int64";
    case MAT_C_UINT64:
      return "uint64";
    default:
      return "object";
  }
}

std::string trouble_of(const matvar_t& variable, const std::string& name) {
  switch (variable.class_type) {
    case MAT_C_CELL:
      return cell_trouble(name);
    case MAT_C_SPARSE:
      return sparse_trouble(name);
    case MAT_C_CHAR:
      return "is text";
    case MAT_C_STRUCT:
      return "is an array of many structs: save one matrix a signal";
    case MAT_C_OBJECT:
    case MAT_C_FUNCTION:
    case MAT_C_OPAQUE:
    case MAT_C_EMPTY:
      return object_trouble(name);
    default:
      return variable.isComplex != 0 ? complex_trouble(name) : "";
  }
}

std::uint64_t structs_in(const matvar_t& variable) {
  std::uint64_t out = 1;
  for (int k = 0; k < variable.rank; ++k) out *= variable.dims[k];
  return out;
}

template <class Number>
void copy(const void* data, std::uint64_t at, std::span<double> out) {
  const Number* const from = static_cast<const Number*>(data) + at;
  std::transform(from, from + out.size(), out.begin(), [](Number value) { return static_cast<double>(value); });
}

void copy(const matvar_t& variable, std::uint64_t at, std::span<double> out) {
  switch (variable.class_type) {
    case MAT_C_SINGLE:
      return copy<float>(variable.data, at, out);
    case MAT_C_INT8:
      return copy<std::int8_t>(variable.data, at, out);
    case MAT_C_UINT8:
      return copy<std::uint8_t>(variable.data, at, out);
    case MAT_C_INT16:
      return copy<std::int16_t>(variable.data, at, out);
    case MAT_C_UINT16:
      return copy<std::uint16_t>(variable.data, at, out);
    case MAT_C_INT32:
      return copy<std::int32_t>(variable.data, at, out);
    case MAT_C_UINT32:
      return copy<std::uint32_t>(variable.data, at, out);
    case MAT_C_INT64:
      return copy<std::int64_t>(variable.data, at, out);
    case MAT_C_UINT64:
      return copy<std::uint64_t>(variable.data, at, out);
    default:
      return copy<double>(variable.data, at, out);
  }
}

class Walk {
 public:
  Walk(const std::filesystem::path& file, Visit visit) : name_(file.string()), visit_(std::move(visit)) {}

  /// @param checked the file was looked at before
  void all(bool checked) {
    const File file(::Mat_Open(name_.c_str(), MAT_ACC_RDONLY), ::Mat_Close);
    if (!file) fail();
    const bool has_elements = ::Mat_GetVersion(file.get()) == MAT_FT_MAT5;
    const std::size_t expected = checked ? 0 : has_elements ? check_mat5_elements(name_) : 1;
    std::size_t variables = 0;
    for (Variable next(::Mat_VarReadNextInfo(file.get()), ::Mat_VarFree); next;
         next.reset(::Mat_VarReadNextInfo(file.get())), ++variables) {
      if (next->name != nullptr) visit(file.get(), next.get(), {next->name});
    }
    if (variables < expected) fail();
  }

 private:
  [[noreturn]] void fail() const {
    throw InputError(name_ + ": is cut or damaged, or no file of MATLAB or HDF5: copy it again, or save it again");
  }

  void visit(mat_t* file, matvar_t* variable, const ArrayPath& path) {
    if (variable->rank < 0 || (variable->rank > 0 && variable->dims == nullptr)) fail();
    const std::uint64_t structs = structs_in(*variable);
    if (variable->class_type == MAT_C_STRUCT && structs <= most_structs)
      return visit_fields(file, variable, path, structs);
    ArrayInfo info;
    info.path = path;
    info.shape.assign(variable->dims, variable->dims + variable->rank);
    std::erase(info.shape, 1U);
    std::reverse(info.shape.begin(), info.shape.end());
    info.by_columns = true;
    info.type = type_name(variable->class_type);
    info.trouble = trouble_of(*variable, fmt::format("{}", fmt::join(path, ".")));
    visit_(file, variable, info);
  }

  void visit_fields(mat_t* file, matvar_t* variable, const ArrayPath& path, std::uint64_t structs) {
    const unsigned fields = ::Mat_VarGetNumberOfFields(variable);
    for (std::uint64_t k = 0; k < structs; ++k) {
      for (unsigned field = 0; field < fields; ++field) {
        matvar_t* const inner = ::Mat_VarGetStructFieldByIndex(variable, field, k);
        if (inner == nullptr || inner->name == nullptr) continue;
        ArrayPath deeper = path;
        if (structs > 1) deeper.back() += fmt::format("({})", k + 1);
        deeper.emplace_back(inner->name);
        visit(file, inner, deeper);
      }
    }
  }

  std::string name_;
  Visit visit_;
};

/// Letters of a short text.
std::string label_of(mat_t* file, matvar_t* variable, std::uint64_t size) {
  constexpr std::uint64_t longest = 64;
  if (size == 0 || size > longest || ::Mat_VarReadDataAll(file, variable) != 0 || variable->data == nullptr) return "";
  const std::size_t width = variable->nbytes / size;  // of a letter
  std::string out;
  for (std::size_t k = 0; k < size && width > 0; ++k) out += static_cast<const char*>(variable->data)[k * width];
  return out;
}

}  // namespace

ArrayList list_mat5(const std::filesystem::path& file) {
  ArrayList out;
  out.mark = '.';
  Walk(file, [&](mat_t* mat, matvar_t* variable, const ArrayInfo& info) {
    out.arrays.push_back(info);
    if (variable->class_type == MAT_C_CHAR) out.arrays.back().text = label_of(mat, variable, info.size());
  }).all(false);
  return out;
}

void read_mat5(const std::filesystem::path& file, const std::vector<ArrayPath>& paths, const ArrayNumbers& numbers) {
  Walk(file, [&](mat_t* mat, matvar_t* variable, const ArrayInfo& info) {
    const auto wanted = std::find(paths.begin(), paths.end(), info.path);
    if (wanted == paths.end() || !info.trouble.empty()) return;
    const std::uint64_t size = info.size();
    if (::Mat_VarReadDataAll(mat, variable) != 0 || variable->data == nullptr ||
        variable->nbytes < size * static_cast<std::size_t>(variable->data_size))
      throw InputError(fmt::format("{}: {} can't be read: the file is cut or damaged; copy it again, or save it again",
                                   file.string(), fmt::join(info.path, ".")));
    std::vector<double> values;
    for (std::uint64_t at = 0; at < size; at += numbers_at_once) {
      values.resize(std::min(numbers_at_once, size - at));
      copy(*variable, at, values);
      numbers(static_cast<std::size_t>(wanted - paths.begin()), at, values);
    }
  }).all(true);
}

}  // namespace fxdyn
