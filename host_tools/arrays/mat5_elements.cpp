#include "host_tools/arrays/mat5_elements.hpp"

#include <fmt/format.h>
#include <zlib.h>

#include <algorithm>
#include <array>
#include <cstdint>
#include <cstring>
#include <fstream>
#include <vector>

#include "host_tools/support/error.hpp"

namespace fxdyn {
namespace {

constexpr std::uint64_t header_bytes = 128, tag_bytes = 8;
constexpr std::uint32_t packed_element = 15;  // miCOMPRESSED

std::uint32_t swapped(std::uint32_t value) { return __builtin_bswap32(value); }

class Elements {
 public:
  explicit Elements(const std::filesystem::path& file) : name_(file.string()), stream_(file, std::ios::binary) {
    std::error_code error;
    size_ = std::filesystem::file_size(file, error);
  }

  std::size_t check() {
    std::array<char, header_bytes> header{};
    if (!stream_.read(header.data(), header.size())) fail("ends in its header");
    const bool swap = header[126] == 'M' && header[127] == 'I';  // "IM" on a machine of this byte order
    // A second, nameless part holds what objects point to; where it is stands in the header.
    const bool has_objects =
        std::any_of(header.begin() + 116, header.begin() + 124, [](char c) { return c != 0 && c != ' '; });
    std::size_t count = 0;
    std::uint64_t at = header_bytes;
    while (at < size_) {
      std::array<std::uint32_t, 2> tag{};
      if (!stream_.read(reinterpret_cast<char*>(tag.data()), tag_bytes)) fail("ends in the middle");
      if (swap) std::transform(tag.begin(), tag.end(), tag.begin(), swapped);
      if (tag[1] > size_ - at - tag_bytes) fail(fmt::format("ends in the middle of its variable {}", count + 1));
      ++count;
      if (tag[0] == packed_element)
        unpack(tag[1], count);
      else
        stream_.seekg(tag[1], std::ios::cur);
      at += tag_bytes + tag[1];
    }
    return has_objects && count > 0 ? count - 1 : count;
  }

 private:
  [[noreturn]] void fail(const std::string& what) const {
    throw InputError(fmt::format("{}: {}: copy it again, or save it again", name_, what));
  }

  void unpack(std::uint64_t left, std::size_t number) {
    z_stream zlib{};
    if (::inflateInit(&zlib) != Z_OK) throw InputError(name_ + ": no memory to unpack it");
    int code = Z_OK;
    while (left > 0 && code == Z_OK) {
      const auto some = std::min<std::uint64_t>(left, in_.size());
      stream_.read(reinterpret_cast<char*>(in_.data()), static_cast<std::streamsize>(some));
      left -= some;
      zlib.next_in = in_.data();
      zlib.avail_in = static_cast<uInt>(some);
      do {
        zlib.next_out = out_.data();
        zlib.avail_out = static_cast<uInt>(out_.size());
        code = ::inflate(&zlib, Z_NO_FLUSH);
      } while (code == Z_OK && zlib.avail_out == 0);
      if (code == Z_BUF_ERROR) code = Z_OK;  // wants more bytes
    }
    ::inflateEnd(&zlib);
    if (code != Z_STREAM_END) fail(fmt::format("its variable {} is damaged", number));
    stream_.seekg(static_cast<std::streamoff>(left), std::ios::cur);
  }

  std::string name_;
  std::ifstream stream_;
  std::uint64_t size_ = 0;
  std::vector<Bytef> in_ = std::vector<Bytef>(std::size_t{1} << 16), out_ = std::vector<Bytef>(std::size_t{1} << 18);
};

}  // namespace

std::size_t check_mat5_elements(const std::filesystem::path& file) { return Elements(file).check(); }

}  // namespace fxdyn
