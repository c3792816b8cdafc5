#include "host_tools/arrays/thrift.hpp"

namespace fxdyn {
namespace {

/// Parquet's own structs nest half as deep; damaged bytes would nest for ever.
constexpr int deepest = 32;

}  // namespace

void ThriftReader::structure(const std::function<void(int)>& field) {
  if (take() != Type::structure || ++depth_ > deepest) throw DamagedBytes("is damaged");
  int id = 0;
  for (;;) {
    const std::uint8_t head = byte();
    const int step = head >> 4;
    next_ = static_cast<Type>(head & 15);
    if (next_ == Type::stop) break;
    id = step > 0 ? id + step : static_cast<int>(zigzag());
    field(id);
    if (next_ != Type::stop) skip(take(), depth_);
  }
  --depth_;
}

void ThriftReader::list(const std::function<void()>& element) {
  const Type type = take();
  if (type != Type::list && type != Type::set) throw DamagedBytes("is damaged");
  const std::uint8_t head = byte();
  const auto of = static_cast<Type>(head & 15);
  const std::size_t count = (head >> 4) < 15 ? head >> 4 : length(1);
  for (std::size_t k = 0; k < count; ++k) {
    next_ = of;
    element();
    if (next_ != Type::stop) skip(take(), depth_);
  }
}

std::int64_t ThriftReader::integer() {
  switch (take()) {
    case Type::byte:
      return static_cast<std::int8_t>(byte());
    case Type::i16:
    case Type::i32:
    case Type::i64:
      return zigzag();
    default:
      throw DamagedBytes("is damaged");
  }
}

bool ThriftReader::flag() {
  const Type type = take();
  if (type != Type::yes && type != Type::no) throw DamagedBytes("is damaged");
  return type == Type::yes;
}

std::string ThriftReader::text() {
  if (take() != Type::binary) throw DamagedBytes("is damaged");
  const std::size_t count = length(1);
  pass(count);
  return std::string(bytes_.substr(at_ - count, count));
}

ThriftReader::Type ThriftReader::take() {
  const Type out = next_;
  next_ = Type::stop;
  return out;
}

std::uint8_t ThriftReader::byte() {
  pass(1);
  return static_cast<std::uint8_t>(bytes_[at_ - 1]);
}

std::uint64_t ThriftReader::varint() {
  std::uint64_t out = 0;
  for (unsigned shift = 0; shift < 64; shift += 7) {
    const std::uint8_t part = byte();
    out |= static_cast<std::uint64_t>(part & 127) << shift;
    if (part < 128) return out;
  }
  throw DamagedBytes("is damaged");
}

std::int64_t ThriftReader::zigzag() {
  const std::uint64_t value = varint();
  return static_cast<std::int64_t>((value >> 1) ^ (0 - (value & 1)));
}

/// How many elements of at least that size follow: never more than the bytes can hold.
std::size_t ThriftReader::length(std::size_t least_bytes) {
  const std::uint64_t count = varint();
  if (count > (bytes_.size() - at_) / least_bytes) throw DamagedBytes("ends in the middle");
  return count;
}

void ThriftReader::pass(std::size_t count) {
  if (count > bytes_.size() - at_) throw DamagedBytes("ends in the middle");
  at_ += count;
}

void ThriftReader::skip(Type type, int depth) {
  if (depth > deepest) throw DamagedBytes("is damaged");
  switch (type) {
    case Type::yes:
    case Type::no:
      return;  // the type is the value
    case Type::byte:
      return pass(1);
    case Type::i16:
    case Type::i32:
    case Type::i64:
      varint();
      return;
    case Type::real:
      return pass(8);
    case Type::binary:
      return pass(length(1));
    case Type::uuid:
      return pass(16);
    case Type::structure:
      while (const int head = byte()) {
        if ((head >> 4) == 0) zigzag();
        skip(static_cast<Type>(head & 15), depth + 1);
      }
      return;
    default:
      return skip_collection(type, depth);
  }
}

void ThriftReader::skip_collection(Type type, int depth) {
  const auto element = [&](Type of) { of == Type::yes || of == Type::no ? pass(1) : skip(of, depth + 1); };
  if (type == Type::map) {
    const std::size_t count = length(1);
    const int types = count > 0 ? byte() : 0;
    for (std::size_t k = 0; k < count; ++k) {
      element(static_cast<Type>(types >> 4));
      element(static_cast<Type>(types & 15));
    }
    return;
  }
  if (type != Type::list && type != Type::set) throw DamagedBytes("is damaged");
  const std::uint8_t head = byte();
  const std::size_t count = (head >> 4) < 15 ? head >> 4 : length(1);
  for (std::size_t k = 0; k < count; ++k) element(static_cast<Type>(head & 15));
}

}  // namespace fxdyn
