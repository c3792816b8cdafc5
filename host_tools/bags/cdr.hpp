#pragma once

#include <cstdint>
#include <stdexcept>
#include <string_view>
#include <vector>

namespace fxdyn {

/// Why a message can't be read; in words that go behind its number.
struct MessageError : std::runtime_error {
  using std::runtime_error::runtime_error;
};

/// Reads values one after another out of a serialised ROS 2 message: plain CDR, version 1 or 2, of either byte order.
/// Alignment counts from behind the four bytes of the encapsulation header; a type of 8 bytes is aligned to 8, to 4 in
/// version 2. (OMG DDS-XTypes 1.3: 7.4.1 and 7.4.2 encodings, 7.6.3.1.2 header; OMG CORBA 3.3 part 2, 9.3: CDR)
class CdrReader {
 public:
  /// @throws MessageError: another encoding
  explicit CdrReader(std::string_view message);
  std::uint32_t unsigned_32();
  std::int32_t signed_32() { return static_cast<std::int32_t>(unsigned_32()); }
  double real_64();
  /// Without its zero at the end; points into the message.
  std::string_view string();
  /// A sequence of strings.
  void strings(std::vector<std::string_view>& into);
  /// A sequence of doubles.
  void reals(std::vector<double>& into);
  bool at_end() const { return at_ == body_.size(); }

 private:
  void align(std::size_t bytes);
  const char* take(std::size_t count);
  /// How many elements of at least that size follow.
  std::size_t length(std::size_t least_bytes);

  std::string_view body_;
  std::size_t at_ = 0, widest_ = 8;
  bool swap_ = false;
};

}  // namespace fxdyn
