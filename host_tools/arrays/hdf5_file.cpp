#include <fmt/format.h>
#include <fmt/ranges.h>
#include <hdf5.h>

#include <algorithm>
#include <array>
#include <cstdlib>
#include <nlohmann/json.hpp>

#include "host_tools/arrays/arrays.hpp"
#include "host_tools/support/error.hpp"

// HDF5 by its C library. MATLAB 7.3 is HDF5 with an attribute MATLAB_class at every variable; a struct is a group, an
// array has its dimensions the other way round.

namespace fxdyn {
namespace {

/// What the library has opened.
class Handle {
 public:
  Handle(hid_t id, herr_t (*close)(hid_t)) : id_(id), close_(close) {}
  ~Handle() {
    if (id_ >= 0) close_(id_);
  }
  Handle(const Handle&) = delete;
  Handle& operator=(const Handle&) = delete;
  explicit operator bool() const { return id_ >= 0; }
  hid_t get() const { return id_; }

 private:
  hid_t id_;
  herr_t (*close_)(hid_t);
};

Handle opened(const std::filesystem::path& file) {
  ::H5Eset_auto2(H5E_DEFAULT, nullptr, nullptr);
  ::setenv("HDF5_USE_FILE_LOCKING", "FALSE", 1);  // folders that can't be written have no locks
  const hid_t id = ::H5Fopen(file.c_str(), H5F_ACC_RDONLY, H5P_DEFAULT);
  if (id < 0)
    throw InputError(file.string() +
                     ": is cut or damaged, or is not closed yet: copy it again when its writer has ended");
  return {id, ::H5Fclose};
}

/// A text that stands at a group or dataset.
std::string text_attribute(hid_t object, const char* name) {
  if (::H5Aexists(object, name) <= 0) return "";
  const Handle attribute(::H5Aopen(object, name, H5P_DEFAULT), ::H5Aclose);
  const Handle type(attribute ? ::H5Aget_type(attribute.get()) : -1, ::H5Tclose);
  if (!type || ::H5Tget_class(type.get()) != H5T_STRING) return "";
  const Handle space(::H5Aget_space(attribute.get()), ::H5Sclose);
  if (!space || ::H5Sget_simple_extent_npoints(space.get()) != 1) return "";
  if (::H5Tis_variable_str(type.get()) > 0) {
    char* text = nullptr;
    if (::H5Aread(attribute.get(), type.get(), static_cast<void*>(&text)) < 0 || text == nullptr) return "";
    std::string out = text;
    ::H5free_memory(text);
    return out;
  }
  constexpr std::size_t longest = 1 << 20;
  std::string out(std::min(::H5Tget_size(type.get()), longest + 1), '\0');
  if (out.size() > longest || ::H5Aread(attribute.get(), type.get(), out.data()) < 0) return "";
  return out.substr(0, out.find('\0'));
}

/// control_freq of robomimic's env_args, a text in JSON [Hz]; 0: none.
double rate_of(const std::string& arguments) {
  const nlohmann::json all = nlohmann::json::parse(arguments, nullptr, false);
  if (!all.is_object() || !all.contains("env_kwargs") || !all["env_kwargs"].is_object()) return 0;
  const auto& frequency = all["env_kwargs"].value("control_freq", nlohmann::json());
  return frequency.is_number() ? frequency.get<double>() : 0;
}

ArrayPath path_of(const std::string& name) {
  ArrayPath out{""};
  for (const char c : name) {
    if (c == '/')
      out.emplace_back();
    else
      out.back() += c;
  }
  return out;
}

std::string type_name(hid_t type, const std::string& matlab_class) {
  if (!matlab_class.empty()) return matlab_class;
  const std::size_t bits = 8 * ::H5Tget_size(type);
  switch (::H5Tget_class(type)) {
    case H5T_INTEGER:
      return fmt::format("{}int{}", ::H5Tget_sign(type) == H5T_SGN_NONE ? "u" : "", bits);
    case H5T_FLOAT:
      return fmt::format("float{}", bits);
    case H5T_STRING:
      return "text";
    case H5T_COMPOUND:
      return "record";
    case H5T_REFERENCE:
      return "reference";
    case H5T_ENUM:
      return "enum";
    default:
      return "other data";
  }
}

/// h5py and MATLAB write a complex number as a record of two.
bool is_complex(hid_t type) {
  if (::H5Tget_class(type) != H5T_COMPOUND || ::H5Tget_nmembers(type) != 2) return false;
  char* const first = ::H5Tget_member_name(type, 0);
  const std::string name = first == nullptr ? "" : first;
  ::H5free_memory(first);
  return name == "r" || name == "real";
}

/// A filter that packs it and is not in the library; empty: none.
std::string missing_filter(hid_t dataset) {
  const Handle how(::H5Dget_create_plist(dataset), ::H5Pclose);
  const int filters = how ? ::H5Pget_nfilters(how.get()) : 0;
  for (int k = 0; k < filters; ++k) {
    unsigned flags = 0, config = 0;
    std::size_t values = 0;
    std::array<char, 64> name{};
    const H5Z_filter_t filter = ::H5Pget_filter2(how.get(), static_cast<unsigned>(k), &flags, &values, nullptr,
                                                 name.size(), name.data(), &config);
    name.back() = '\0';
    if (filter >= 0 && ::H5Zfilter_avail(filter) <= 0)
      return name[0] != '\0' ? std::string(name.data()) : fmt::format("filter {}", filter);
  }
  return "";
}

std::string trouble_of(hid_t dataset, hid_t type, const std::string& matlab_class, const std::string& name) {
  if (is_complex(type)) return complex_trouble(name);
  if (matlab_class == "cell") return cell_trouble(name);
  const H5T_class_t kind = ::H5Tget_class(type);
  const bool number = kind == H5T_INTEGER || kind == H5T_FLOAT;
  constexpr std::array numbers{"double", "single", "int8",  "uint8",  "int16",  "uint16",
                               "int32",  "uint32", "int64", "uint64", "logical"};
  if (matlab_class == "char" || kind == H5T_STRING) return "is text";
  if (!matlab_class.empty() && std::find(numbers.begin(), numbers.end(), matlab_class) == numbers.end())
    return object_trouble(name);
  if (kind == H5T_REFERENCE) return "is an array of structs or cells: save one matrix a signal";
  if (kind == H5T_COMPOUND) return "is a table of records: write one dataset a signal";
  if (!number) return "holds no numbers";
  if (::H5Aexists(dataset, "MATLAB_empty") > 0) return "is empty";
  if (const std::string filter = missing_filter(dataset); !filter.empty())
    return fmt::format("is packed by {}, which is not here: write it with compression='gzip'", filter);
  return "";
}

/// Letters of a short text of MATLAB.
std::string label_of(hid_t dataset, std::uint64_t size) {
  constexpr std::uint64_t longest = 64;
  std::array<char, longest> letters{};
  if (size == 0 || size > longest ||
      ::H5Dread(dataset, H5T_NATIVE_CHAR, H5S_ALL, H5S_ALL, H5P_DEFAULT, letters.data()) < 0)
    return "";
  return {letters.data(), size};
}

std::vector<std::uint64_t> extents_of(hid_t dataset) {
  const Handle space(::H5Dget_space(dataset), ::H5Sclose);
  const int rank = space ? ::H5Sget_simple_extent_ndims(space.get()) : 0;
  std::vector<hsize_t> extents(static_cast<std::size_t>(std::max(rank, 0)));
  if (rank > 0) ::H5Sget_simple_extent_dims(space.get(), extents.data(), nullptr);
  return {extents.begin(), extents.end()};
}

ArrayInfo describe(hid_t dataset, const std::string& name, ArrayList& list) {
  ArrayInfo out;
  out.path = path_of(name);
  const std::string matlab_class = text_attribute(dataset, "MATLAB_class");
  out.by_columns = !matlab_class.empty();
  if (out.by_columns) list.mark = '.';
  const Handle type(::H5Dget_type(dataset), ::H5Tclose);
  if (!type) {
    out.type = "other data";
    out.trouble = "can't be read: damaged";
    return out;
  }
  out.shape = extents_of(dataset);
  std::erase(out.shape, 1U);
  out.type = type_name(type.get(), matlab_class);
  out.trouble = trouble_of(dataset, type.get(), matlab_class, list.name_of(out.path));
  if (matlab_class == "char" && ::H5Tget_class(type.get()) == H5T_INTEGER) out.text = label_of(dataset, out.size());
  return out;
}

struct Found {
  std::string name;
  H5O_type_t type;
};

/// Everything that is in the file, without what a link leads to.
std::vector<Found> all_of(hid_t file) {
  std::vector<Found> out;
  ::H5Ovisit2(
      file, H5_INDEX_NAME, H5_ITER_INC,
      [](hid_t, const char* name, const H5O_info_t* info, void* to) -> herr_t {
        constexpr std::size_t most = 1'000'000;
        auto& all = *static_cast<std::vector<Found>*>(to);
        if (all.size() == most) return 1;
        all.push_back({name, info->type});
        return 0;
      },
      &out, H5O_INFO_BASIC);
  return out;
}

/// The whole array in blocks along its first dimension, each of whole chunks as the file packs them.
void read_dataset(hid_t dataset, std::size_t which, const std::string& where, const ArrayNumbers& numbers) {
  std::vector<std::uint64_t> extents = extents_of(dataset);
  if (extents.empty()) extents.push_back(1);
  std::vector<hsize_t> start(extents.size()), count(extents.begin(), extents.end()), chunk(extents.size(), 1);
  std::uint64_t row = 1;
  for (std::size_t k = 1; k < extents.size(); ++k) row *= extents[k];
  if (row == 0) return;
  const Handle how(::H5Dget_create_plist(dataset), ::H5Pclose);
  if (how && ::H5Pget_layout(how.get()) == H5D_CHUNKED)
    ::H5Pget_chunk(how.get(), static_cast<int>(chunk.size()), chunk.data());
  const std::uint64_t chunk_rows = std::clamp<std::uint64_t>(chunk[0], 1, std::max<std::uint64_t>(extents[0], 1));
  const std::uint64_t rows =
      (std::max<std::uint64_t>(numbers_at_once / row, 1) + chunk_rows - 1) / chunk_rows * chunk_rows;
  const Handle all(::H5Dget_space(dataset), ::H5Sclose);
  const bool is_number = ::H5Sget_simple_extent_type(all.get()) == H5S_SCALAR;
  std::vector<double> values;
  for (std::uint64_t at = 0; at < extents[0]; at += rows) {
    start[0] = at;
    count[0] = std::min(rows, extents[0] - at);
    const hsize_t size = count[0] * row;
    values.resize(size);
    const Handle some(::H5Screate_simple(1, &size, nullptr), ::H5Sclose);
    if (!is_number) ::H5Sselect_hyperslab(all.get(), H5S_SELECT_SET, start.data(), nullptr, count.data(), nullptr);
    if (::H5Dread(dataset, H5T_NATIVE_DOUBLE, some.get(), all.get(), H5P_DEFAULT, values.data()) < 0)
      throw InputError(where + " can't be read: the file is cut or damaged; copy it again, or write it again");
    numbers(which, at * row, values);
  }
}

}  // namespace

ArrayList list_hdf5(const std::filesystem::path& file) {
  const Handle handle = opened(file);
  ArrayList out;
  std::vector<std::string> hidden{"#refs#", "#subsystem#"};  // where MATLAB keeps what cells and objects point to
  for (const Found& found : all_of(handle.get())) {
    const bool is_hidden = std::any_of(hidden.begin(), hidden.end(), [&](const std::string& group) {
      return found.name == group || found.name.starts_with(group + "/");
    });
    if (is_hidden) continue;
    const Handle object(::H5Oopen(handle.get(), found.name.c_str(), H5P_DEFAULT), ::H5Oclose);
    if (!object) continue;
    if (found.type == H5O_TYPE_DATASET) {
      out.arrays.push_back(describe(object.get(), found.name, out));
      continue;
    }
    if (found.type != H5O_TYPE_GROUP) continue;
    if (const double rate = rate_of(text_attribute(object.get(), "env_args")); rate > 0) out.rate_hz = rate;
    if (::H5Aexists(object.get(), "MATLAB_sparse") <= 0) continue;
    out.arrays.push_back({path_of(found.name), {}, true, "sparse", sparse_trouble(found.name), {}});
    hidden.push_back(found.name);
  }
  return out;
}

void read_hdf5(const std::filesystem::path& file, const std::vector<ArrayPath>& paths, const ArrayNumbers& numbers) {
  const Handle handle = opened(file);
  for (std::size_t which = 0; which < paths.size(); ++which) {
    const std::string name = fmt::format("{}", fmt::join(paths[which], "/"));
    const Handle dataset(::H5Dopen2(handle.get(), name.c_str(), H5P_DEFAULT), ::H5Dclose);
    if (!dataset) throw InputError(fmt::format("{}: {} can't be read; copy the file again", file.string(), name));
    read_dataset(dataset.get(), which, fmt::format("{}: {}", file.string(), name), numbers);
  }
}

}  // namespace fxdyn
