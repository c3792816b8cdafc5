#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

#include "firmware/protocol/serial_protocol.hpp"
#include "hal/clock.hpp"
#include "hal/serial.hpp"
#include "model/fixed.hpp"

namespace fxdyn {

/// What a node says about its tables; it refuses ticks where they are not valid.
struct TablesInfo {
  std::uint32_t layout_hash = 0;
  std::uint32_t crc32 = 0;
  bool valid = false;
};

/// Computes the feedforward torque of the setpoints that arrive on a serial port. It knows neither the board nor the
/// model: on a host it runs on a port in memory.
template <class Model, hal::SerialPort Port, hal::CycleCounter Counter>
class ReplayNode {
 public:
  ReplayNode(Port& port, Counter& counter, const typename Model::Parameters& parameters, TablesInfo tables)
      : port_(port), counter_(counter), parameters_(parameters), tables_(tables) {
    counter_.start();
    empty_measurement_ = counter_.stop();
  }

  /// Handles everything that has arrived. True: a reply waits for the port, call again soon; false: sleep until more
  /// comes.
  bool poll() {
    if (!flush()) return true;
    for (;;) {
      std::array<std::uint8_t, 64> bytes;
      const std::size_t count = port_.read(std::span{bytes}.first(std::min(bytes.size(), reader_.space())));
      reader_.push(std::span{bytes}.first(count));
      while (reader_.next(frame_)) {
        handle();
        if (!flush()) return true;
      }
      if (count == 0) return false;
    }
  }

 private:
  static constexpr std::size_t joints = Model::joints;
  static constexpr std::size_t outputs = Model::outputs;
  static constexpr std::size_t largest_reply = std::max(serial::torque_words(outputs), serial::identity_words);

  void handle() {
    switch (frame_.type) {
      case serial::Type::hello:
        return reply(
            serial::Type::identity,
            std::array{serial::protocol_version, static_cast<std::uint32_t>(joints), tables_.layout_hash, tables_.crc32,
                       static_cast<std::uint32_t>(tables_.valid ? serial::NodeState::ready
                                                                : serial::NodeState::tables_invalid),
                       reader_.corrupt_frames(), Model::outputs_mask});
      case serial::Type::reset:
        state_ = {};
        return reply(serial::Type::reset_done, std::array<std::uint32_t, 0>{});
      case serial::Type::tick:
        if (!tables_.valid) return refuse(serial::Refusal::tables_invalid);
        if (frame_.size != serial::tick_words(joints)) return refuse(serial::Refusal::wrong_length);
        return tick();
      default:
        return refuse(serial::Refusal::unknown_type);
    }
  }

  void tick() {
    const auto value = [&](std::size_t i) { return static_cast<std::int32_t>(frame_.words[1 + i]); };
    for (std::size_t j = 0; j < joints; ++j) {
      const auto i = static_cast<int>(j);
      setpoints_.q[i].raw = value(3 * j);
      setpoints_.dq[i].raw = value(3 * j + 1);
      setpoints_.ddq[i].raw = value(3 * j + 2);
    }
    saturations_ = {};
    counter_.start();
    compute();
    const std::uint32_t cycles = counter_.stop() - empty_measurement_;

    std::array<std::uint32_t, serial::torque_words(outputs)> words;
    words[0] = frame_.words[0];
    for (std::size_t j = 0; j < outputs; ++j)
      words[1 + j] = static_cast<std::uint32_t>(torques_[static_cast<int>(j)].raw);
    words[1 + outputs] = saturations_.count;
    words[2 + outputs] = cycles;
    reply(serial::Type::torque, words);
  }

  /// A function of its own, from members to members, so that no part of the tick can leave the measured stretch.
  [[gnu::noinline]] void compute() { torques_ = Model::tick(parameters_, state_, setpoints_, saturations_); }

  void refuse(serial::Refusal reason) {
    reply(serial::Type::refused,
          std::array{frame_.size > 0 ? frame_.words[0] : 0U, static_cast<std::uint32_t>(reason)});
  }

  void reply(serial::Type type, std::span<const std::uint32_t> words) {
    unsent_begin_ = 0;
    unsent_end_ = serial::encode(type, words, output_);
  }

  /// Sends what the port accepts; true if nothing is left.
  bool flush() {
    unsent_begin_ += port_.write(std::span{output_}.subspan(unsent_begin_, unsent_end_ - unsent_begin_));
    return unsent_begin_ == unsent_end_;
  }

  Port& port_;
  Counter& counter_;
  const typename Model::Parameters& parameters_;
  TablesInfo tables_;
  std::uint32_t empty_measurement_ = 0;

  typename Model::State state_{};
  typename Model::Setpoints setpoints_{};
  typename Model::Torques torques_{};
  Saturations saturations_{};

  serial::FrameReader<serial::tick_words(joints)> reader_;
  serial::Frame<serial::tick_words(joints)> frame_;
  std::array<std::uint8_t, serial::frame_bytes(largest_reply)> output_{};
  std::size_t unsent_begin_ = 0, unsent_end_ = 0;
};

}  // namespace fxdyn
