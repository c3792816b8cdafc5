#pragma once

#include <algorithm>
#include <array>
#include <concepts>
#include <cstddef>
#include <cstdint>
#include <span>

#include "firmware/protocol/canopen.hpp"
#include "model/wrapping.hpp"

namespace fxdyn {

/// What an SDO server needs of a dictionary. `Object` names one entry, found by index and sub-index.
///   find      Abort::none: `object` is set
///   has_data  whether it can be read now
///   size      bytes of the object; `fixed` false for strings, whose size is then the most they hold
///   read      value into `to` (largest_object bytes), returns its bytes
///   write     Abort::none: the value is taken
template <class T>
concept SdoDictionary = requires(T& dictionary, typename T::Object& object, std::uint8_t* to,
                                 std::span<const std::uint8_t> from) {
  { dictionary.find(std::uint16_t{}, std::uint8_t{}, object) } -> std::same_as<canopen::Abort>;
  { object.readable() } -> std::same_as<bool>;
  { object.writable() } -> std::same_as<bool>;
  { object.has_fixed_size() } -> std::same_as<bool>;
  { object.size() } -> std::same_as<std::size_t>;
  { dictionary.has_data(object) } -> std::same_as<bool>;
  { dictionary.read(object, to) } -> std::same_as<std::size_t>;
  { dictionary.write(object, from) } -> std::same_as<canopen::Abort>;
};

/// Server of one SDO channel, expedited and segmented transfers in both directions (CiA 301, 7.2.4). A value is read as
/// a whole when its transfer begins and written as a whole when it has ended.
template <class Object>
class SdoServer {
 public:
  static constexpr std::size_t largest_object = 32;       ///< bytes
  static constexpr std::uint32_t timeout_us = 1'000'000;  ///< between two segments
  using Bytes = std::array<std::uint8_t, 8>;

  void reset() { transfer_ = Transfer::none; }
  std::uint32_t aborts() const { return aborts_; }

  /// Handles a request; true: `answer` has to be sent.
  template <SdoDictionary Dictionary>
  bool handle(const Bytes& request, Dictionary& dictionary, std::uint32_t now_us, Bytes& answer) {
    answer = {};
    const unsigned command = request[0] >> 5;
    if (command == abort_command) {
      transfer_ = Transfer::none;
      return false;
    }
    canopen::Abort abort = canopen::Abort::unknown_command;
    if (command == initiate_download || command == initiate_upload) {
      transfer_ = Transfer::none;  // a new transfer ends one that was left
      index_ = static_cast<std::uint16_t>(canopen::load<2>(&request[1]));
      sub_index_ = request[3];
      abort = dictionary.find(index_, sub_index_, object_);
      if (abort == canopen::Abort::none)
        abort = command == initiate_download ? begin_download(request, dictionary, answer)
                                             : begin_upload(dictionary, answer);
    } else if (command == download_segment && transfer_ == Transfer::download) {
      abort = continue_download(request, dictionary, answer);
    } else if (command == upload_segment && transfer_ == Transfer::upload) {
      abort = continue_upload(request, answer);
    }
    last_us_ = now_us;
    if (abort != canopen::Abort::none) write_abort(abort, answer);
    return true;
  }

  /// True where a transfer was given up for want of its next segment: `answer` says so.
  bool time_out(std::uint32_t now_us, Bytes& answer) {
    if (transfer_ == Transfer::none || wrapping_subtract(now_us, last_us_) < timeout_us) return false;
    write_abort(canopen::Abort::timed_out, answer);
    return true;
  }

 private:
  enum class Transfer : std::uint8_t { none, upload, download };
  // Command specifiers: of the client ..
  static constexpr unsigned download_segment = 0, initiate_download = 1, initiate_upload = 2, upload_segment = 3,
                            abort_command = 4;
  // .. and of the server, in place.
  static constexpr std::uint8_t answers_segment = 1U << 5, answers_upload = 2U << 5, answers_download = 3U << 5,
                                aborts_transfer = 4U << 5;
  static constexpr std::uint8_t toggle_bit = 1U << 4, expedited = 1U << 1, size_is_given = 1U << 0, last = 1U << 0;
  static constexpr std::size_t segment = 7;  ///< bytes

  void write_abort(canopen::Abort abort, Bytes& answer) {
    transfer_ = Transfer::none;
    ++aborts_;
    answer[0] = aborts_transfer;
    put_multiplexer(answer);
    canopen::store<4>(&answer[4], static_cast<std::uint32_t>(abort));
  }
  void put_multiplexer(Bytes& answer) const {
    canopen::store<2>(&answer[1], index_);
    answer[3] = sub_index_;
  }

  canopen::Abort check_size(std::size_t size) const {
    if (size > object_.size()) return canopen::Abort::too_long;
    if (object_.has_fixed_size() && size < object_.size()) return canopen::Abort::too_short;
    return canopen::Abort::none;
  }

  template <class Dictionary>
  canopen::Abort begin_download(const Bytes& request, Dictionary& dictionary, Bytes& answer) {
    if (!object_.writable()) return canopen::Abort::read_only;
    const bool size_given = (request[0] & size_is_given) != 0;
    if ((request[0] & expedited) != 0) {
      // Without a size the object's own counts.
      const std::size_t size = size_given ? 4U - (request[0] >> 2 & 3U) : std::min<std::size_t>(4, object_.size());
      if (const auto abort = check_size(size); abort != canopen::Abort::none) return abort;
      if (const auto abort = dictionary.write(object_, std::span(request).subspan(4, size));
          abort != canopen::Abort::none)
        return abort;
    } else {
      announced_size_ = size_given ? canopen::load<4>(&request[4]) : unknown_size;
      if (size_given) {
        if (const auto abort = check_size(announced_size_); abort != canopen::Abort::none) return abort;
      }
      transfer_ = Transfer::download;
      toggle_ = 0;
      at_ = 0;
    }
    answer[0] = answers_download;
    put_multiplexer(answer);
    return canopen::Abort::none;
  }

  template <class Dictionary>
  canopen::Abort continue_download(const Bytes& request, Dictionary& dictionary, Bytes& answer) {
    if ((request[0] & toggle_bit) != toggle_) return canopen::Abort::toggle_bit;
    const std::size_t count = segment - (request[0] >> 1 & 7U);
    if (at_ + count > object_.size()) return canopen::Abort::too_long;
    std::copy_n(request.begin() + 1, count, buffer_.begin() + static_cast<std::ptrdiff_t>(at_));
    at_ += count;
    answer[0] = static_cast<std::uint8_t>(answers_segment | toggle_);
    toggle_ ^= toggle_bit;
    if ((request[0] & last) == 0) return canopen::Abort::none;
    transfer_ = Transfer::none;
    if (announced_size_ != unknown_size && announced_size_ != at_) return canopen::Abort::wrong_length;
    if (const auto abort = check_size(at_); abort != canopen::Abort::none) return abort;
    return dictionary.write(object_, std::span<const std::uint8_t>(buffer_).first(at_));
  }

  template <class Dictionary>
  canopen::Abort begin_upload(Dictionary& dictionary, Bytes& answer) {
    if (!object_.readable()) return canopen::Abort::write_only;
    if (!dictionary.has_data(object_)) return canopen::Abort::no_data;
    announced_size_ = static_cast<std::uint32_t>(dictionary.read(object_, buffer_.data()));
    put_multiplexer(answer);
    if (announced_size_ > 0 && announced_size_ <= 4) {
      answer[0] = static_cast<std::uint8_t>(answers_upload | (4 - announced_size_) << 2 | expedited | size_is_given);
      std::copy_n(buffer_.begin(), announced_size_, answer.begin() + 4);
      return canopen::Abort::none;
    }
    answer[0] = answers_upload | size_is_given;
    canopen::store<4>(&answer[4], announced_size_);
    transfer_ = Transfer::upload;
    toggle_ = 0;
    at_ = 0;
    return canopen::Abort::none;
  }

  canopen::Abort continue_upload(const Bytes& request, Bytes& answer) {
    if ((request[0] & toggle_bit) != toggle_) return canopen::Abort::toggle_bit;
    const std::size_t count = std::min<std::size_t>(segment, announced_size_ - at_);
    std::copy_n(buffer_.begin() + static_cast<std::ptrdiff_t>(at_), count, answer.begin() + 1);
    at_ += count;
    const bool ends = at_ == announced_size_;
    answer[0] = static_cast<std::uint8_t>(toggle_ | (segment - count) << 1 | (ends ? last : 0U));
    toggle_ ^= toggle_bit;
    if (ends) transfer_ = Transfer::none;
    return canopen::Abort::none;
  }

  static constexpr std::uint32_t unknown_size = 0xFFFF'FFFF;

  Transfer transfer_ = Transfer::none;
  std::uint8_t toggle_ = 0, sub_index_ = 0;
  std::uint16_t index_ = 0;
  Object object_{};
  std::array<std::uint8_t, largest_object> buffer_{};
  std::size_t at_ = 0;
  std::uint32_t announced_size_ = 0, last_us_ = 0, aborts_ = 0;
};

}  // namespace fxdyn
