#include "host_tools/arrays/arrays.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <cstring>
#include <fstream>

#include "host_tools/arrays/apart.hpp"
#include "host_tools/arrays/lerobot.hpp"
#include "host_tools/support/error.hpp"
#include "host_tools/support/pipes.hpp"

namespace fxdyn {
namespace {

namespace fs = std::filesystem;

constexpr std::string_view hdf5_magic = "\x89HDF\r\n\x1a\n", matlab_magic = "MATLAB ";

std::string bytes_at(const fs::path& file, std::streamoff at) {
  std::array<char, 8> bytes;
  std::ifstream stream(file, std::ios::binary);
  stream.seekg(at);
  stream.read(bytes.data(), bytes.size());
  return {bytes.data(), static_cast<std::size_t>(stream.gcount())};
}

bool is_plain_file(const fs::path& file) {
  std::error_code error;
  return !is_pipe(file) && fs::is_regular_file(file, error);
}

/// Packs values for the way between two processes of one program.
class Packer {
 public:
  template <class Number>
  void number(Number value) {
    bytes_.append(reinterpret_cast<const char*>(&value), sizeof value);
  }
  void text(const std::string& text) {
    number(std::uint64_t{text.size()});
    bytes_ += text;
  }
  const std::string& bytes() const { return bytes_; }

 private:
  std::string bytes_;
};

/// The child may have been led astray before it packed: no length is believed.
class Unpacker {
 public:
  Unpacker(std::string_view bytes, const fs::path& file) : bytes_(bytes), file_(file) {}
  template <class Number>
  Number number() {
    Number out;
    std::memcpy(&out, take(sizeof out).data(), sizeof out);
    return out;
  }
  std::string text() { return std::string(take(number<std::uint64_t>())); }
  std::string_view rest() const { return bytes_; }

 private:
  std::string_view take(std::uint64_t count) {
    if (count > bytes_.size()) throw InputError(file_.string() + ": is damaged: copy it again, or write it again");
    const std::string_view out = bytes_.substr(0, count);
    bytes_.remove_prefix(count);
    return out;
  }
  std::string_view bytes_;
  const fs::path& file_;
};

std::string packed(const ArrayInfo& array) {
  Packer out;
  out.number(std::uint64_t{array.path.size()});
  for (const std::string& name : array.path) out.text(name);
  out.number(std::uint64_t{array.shape.size()});
  for (const std::uint64_t extent : array.shape) out.number(extent);
  out.number(array.by_columns);
  for (const std::string& text : {array.type, array.trouble, array.text}) out.text(text);
  return out.bytes();
}

ArrayInfo unpacked(Unpacker& in) {
  ArrayInfo out;
  for (auto count = in.number<std::uint64_t>(); count > 0; --count) out.path.push_back(in.text());
  for (auto count = in.number<std::uint64_t>(); count > 0; --count) out.shape.push_back(in.number<std::uint64_t>());
  out.by_columns = in.number<bool>();
  for (std::string* text : {&out.type, &out.trouble, &out.text}) *text = in.text();
  return out;
}

bool is_tree(const fs::path& file) { return is_hdf5(file) || bytes_at(file, 512).starts_with(hdf5_magic); }

}  // namespace

std::uint64_t ArrayInfo::size() const {
  std::uint64_t out = 1;
  for (const std::uint64_t extent : shape) out *= extent;
  return out;
}

std::string ArrayInfo::described() const {
  std::vector<std::uint64_t> extents = shape;
  if (by_columns) std::reverse(extents.begin(), extents.end());
  if (extents.empty()) return type;
  return fmt::format("{} {}", fmt::join(extents, " x "), type);
}

std::string ArrayList::name_of(const ArrayPath& path) const {
  return fmt::format("{}", fmt::join(path, std::string_view(&mark, 1)));
}

bool is_hdf5(const fs::path& file) {
  if (!is_plain_file(file)) return false;
  // Behind a block of the user's own, as the format allows it; MATLAB's is one.
  for (const std::streamoff at : {0, 512, 1024, 2048, 4096})
    if (bytes_at(file, at).starts_with(hdf5_magic)) return !bytes_at(file, 0).starts_with(matlab_magic);
  return false;
}

bool is_matlab(const fs::path& file) {
  if (!is_plain_file(file)) return false;
  if (bytes_at(file, 0).starts_with(matlab_magic)) return true;
  std::string extension = file.extension().string();
  std::transform(extension.begin(), extension.end(), extension.begin(),
                 [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  // Of version 4: type (0 to 4052), rows, columns; little endian where it is of a machine of today.
  const std::string bytes = bytes_at(file, 0);
  return extension == ".mat" && bytes.size() == 8 && bytes[2] == 0 && bytes[3] == 0;
}

bool is_parquet(const fs::path& file) {
  if (is_lerobot(file)) return true;
  if (!is_plain_file(file)) return false;
  const std::string bytes = bytes_at(file, 0);
  return bytes.starts_with("PAR1") || bytes.starts_with("PARE");
}

ArrayList list_arrays(const fs::path& file) {
  if (is_parquet(file)) return list_parquet(file);  // no library that could be led astray
  ArrayList out;
  read_apart(
      file,
      [&](const SendPiece& send) {
        const ArrayList list = is_tree(file) ? list_hdf5(file) : list_mat5(file);
        Packer head;
        head.number(list.mark);
        head.number(list.rate_hz);
        send(head.bytes());
        for (const ArrayInfo& array : list.arrays) send(packed(array));
      },
      [&, first = true](std::string_view piece) mutable {
        Unpacker in(piece, file);
        if (!first) {
          out.arrays.push_back(unpacked(in));
          return;
        }
        first = false;
        out.mark = in.number<char>();
        out.rate_hz = in.number<double>();
      });
  return out;
}

void read_arrays(const fs::path& file, const std::vector<ArrayPath>& paths, const ArrayNumbers& numbers) {
  if (is_parquet(file)) return read_parquet(file, paths, numbers);
  std::vector<double> values;
  read_apart(
      file,
      [&](const SendPiece& send) {
        const auto pass_on = [&](std::size_t which, std::uint64_t at, std::span<const double> some) {
          Packer piece;
          piece.number(which);
          piece.number(at);
          send(piece.bytes() + std::string(reinterpret_cast<const char*>(some.data()), some.size_bytes()));
        };
        is_tree(file) ? read_hdf5(file, paths, pass_on) : read_mat5(file, paths, pass_on);
      },
      [&](std::string_view piece) {
        Unpacker in(piece, file);
        const auto which = in.number<std::size_t>();
        const auto at = in.number<std::uint64_t>();
        values.resize(in.rest().size() / sizeof(double));
        std::memcpy(values.data(), in.rest().data(), values.size() * sizeof(double));
        numbers(which, at, values);
      });
}

std::string cell_trouble(const std::string& name) {
  return fmt::format("is a cell: save a matrix, as of cell2mat({})", name);
}
std::string sparse_trouble(const std::string& name) { return fmt::format("is sparse: save full({})", name); }
std::string complex_trouble(const std::string& name) { return fmt::format("is complex: save real({})", name); }
std::string object_trouble(const std::string& name) {
  return fmt::format("is an object: save numbers, as {0}.Time and {0}.Data of a timeseries", name);
}

}  // namespace fxdyn
