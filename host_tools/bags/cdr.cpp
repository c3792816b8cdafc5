#include "host_tools/bags/cdr.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cstring>

namespace fxdyn {
namespace {

template <class Number>
Number number_at(const char* bytes, bool swap) {
  std::array<char, sizeof(Number)> own;
  std::memcpy(own.data(), bytes, own.size());
  if (swap) std::reverse(own.begin(), own.end());
  return std::bit_cast<Number>(own);
}

}  // namespace

CdrReader::CdrReader(std::string_view message) {
  if (message.size() < 4) throw MessageError("is shorter than the header of CDR");
  const int kind = static_cast<unsigned char>(message[0]) * 256 + static_cast<unsigned char>(message[1]);
  // 0, 1: CDR version 1; 6, 7 (RTPS 2.5) and 0x10, 0x11 (XTypes 1.2): plain CDR version 2; the odd ones are little
  // endian.
  const int plain = kind & ~1;
  if (plain != 0 && plain != 0x06 && plain != 0x10)
    throw MessageError(fmt::format("is in encoding 0x{:04x}, which is not plain CDR", kind));
  swap_ = (kind % 2 == 1) != (std::endian::native == std::endian::little);
  if (plain != 0) widest_ = 4;
  body_ = message.substr(4);
}

void CdrReader::align(std::size_t bytes) {
  const std::size_t to = std::min(bytes, widest_);
  at_ = (at_ + to - 1) / to * to;
}

const char* CdrReader::take(std::size_t count) {
  if (at_ > body_.size() || count > body_.size() - at_)
    throw MessageError(fmt::format("has {} bytes, and ends in the middle", body_.size() + 4));
  const char* const out = body_.data() + at_;
  at_ += count;
  return out;
}

std::uint32_t CdrReader::unsigned_32() {
  align(4);
  return number_at<std::uint32_t>(take(4), swap_);
}

double CdrReader::real_64() {
  align(8);
  return number_at<double>(take(8), swap_);
}

std::size_t CdrReader::length(std::size_t least_bytes) {
  const std::size_t count = unsigned_32();
  if (count > (body_.size() - std::min(at_, body_.size())) / least_bytes)
    throw MessageError(fmt::format("has {} bytes, and ends in the middle", body_.size() + 4));
  return count;
}

std::string_view CdrReader::string() {
  const std::size_t size = length(1);
  const std::string_view text(take(size), size);
  return text.substr(0, text.find('\0'));
}

void CdrReader::strings(std::vector<std::string_view>& into) {
  into.resize(length(4));
  for (std::string_view& one : into) one = string();
}

void CdrReader::reals(std::vector<double>& into) {
  into.resize(length(8));
  if (into.empty()) return;  // no element, no alignment
  align(8);
  const char* const bytes = take(8 * into.size());
  for (std::size_t k = 0; k < into.size(); ++k) into[k] = number_at<double>(bytes + 8 * k, swap_);
}

}  // namespace fxdyn
