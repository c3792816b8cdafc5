#include "tests/emulated_g474/fdcan.hpp"

#include <algorithm>
#include <bit>
#include <cmath>

#include "firmware/bus_load.hpp"

namespace fxdyn::emulated {
namespace {

constexpr std::array<std::uint8_t, 16> lengths{0, 1, 2, 3, 4, 5, 6, 7, 8, 12, 16, 20, 24, 32, 48, 64};

// Bits of IR (44.4.15)
constexpr std::uint32_t transmission_complete = 1U << 7, cancellation_finished = 1U << 8, fifo_empty = 1U << 9,
                        error_passive = 1U << 17, error_warning = 1U << 18, bus_off_changed = 1U << 19,
                        arbitration_error = 1U << 21;

std::uint32_t code_of(const Frame& frame) {
  const auto found = std::find(lengths.begin(), lengths.end(), frame.size);
  return static_cast<std::uint32_t>(found - lengths.begin());
}

struct Segments {
  double prescaler, segment1, segment2, jump;
  double quanta() const { return 1 + segment1 + segment2; }
};
Segments nominal_segments(std::uint32_t r) {
  return {(r >> 16 & 0x1ff) + 1.0, (r >> 8 & 0xff) + 1.0, (r & 0x7f) + 1.0, (r >> 25 & 0x7f) + 1.0};
}
Segments data_segments(std::uint32_t r) {
  return {(r >> 16 & 0x1f) + 1.0, (r >> 8 & 0x1f) + 1.0, (r >> 4 & 0xf) + 1.0, (r & 0xf) + 1.0};
}

}  // namespace

void Fdcan::power_on(std::uint32_t garbage) {
  for (auto& word : ram_) word = garbage = garbage * 1'664'525 + 1'013'904'223;
  reset();
}

void Fdcan::reset() {
  control_ = 1;
  nominal_ = 0x0600'0a03;
  data_ = 0x0000'0a33;
  delay_ = filters_ = transmit_mode_ = divider_ = 0;
  mask_ = 0x1fff'ffff;
  init_ = init_before_ = true;
  init_visible_ = 0;
  interrupts_ = enabled_ = lines_ = line_enable_ = 0;
  reset_fifos();
  transmit_errors_ = receive_errors_ = logged_errors_ = 0;
  last_error_ = 7;
  bus_off_ = false;
  sequences_left_ = 1;
}

void Fdcan::reset_fifos() {
  fifos_ = {};
  put_ = get_ = pending_ = occurred_ = cancelled_ = cancel_requests_ = 0;
  in_flight_.reset();
}

// --- registers -------------------------------------------------------------------------------------------------------

bool Fdcan::raised_on(std::uint32_t line) const {
  // ILS: a bit for each group of IR's bits (44.4.17)
  constexpr std::array<std::uint32_t, 7> groups{0x7, 0x38, 0x1c0, 0x1e00, 0xe000, 0x3'0000, 0xfc'0000};
  std::uint32_t bits = 0;
  for (std::size_t i = 0; i < groups.size(); ++i)
    if ((lines_ >> i & 1U) == line) bits |= groups[i];
  return (interrupts_ & enabled_ & bits) != 0;
}

std::uint32_t Fdcan::transmit_status() const {
  const bool full = queue_mode() ? pending_ == 0b111 : std::popcount(pending_) == 3;
  const auto free = static_cast<std::uint32_t>(3 - std::popcount(pending_));
  return (queue_mode() ? 0 : free | get_ << 8) | put_ << 16 | (full ? 1U << 21 : 0);
}

std::uint32_t Fdcan::protocol_status() {
  const std::uint32_t warning = transmit_errors_ >= 96 || receive_errors_ >= 96 ? 1U << 6 : 0;
  const std::uint32_t activity = takes_part() ? (in_flight_ ? 0b11U : 0b01U) << 3 : 0;
  const std::uint32_t value =
      last_error_ | activity | (passive() ? 1U << 5 : 0) | warning | (bus_off_ ? 1U << 7 : 0) | 7U << 8;
  last_error_ = 7;
  return value;
}

std::uint32_t Fdcan::read(Offset offset, Time now) {
  const auto fifo_status = [&](std::uint32_t i) {
    const Fifo& fifo = fifos_[i];
    return fifo.level | fifo.get << 8 | (fifo.get + fifo.level) % 3 << 16 | (fifo.level == 3 ? 1U << 24 : 0) |
           ((interrupts_ >> (3 * i + 2) & 1U) << 25);
  };
  switch (offset) {
    case 0x00:
      return 0x3214'1218;
    case 0x04:
      return 0x8765'4321;
    case 0x0c:
      return data_;
    case 0x18:
      return (control_ & ~1U) | ((now >= init_visible_ ? init_ : init_before_) ? 1U : 0);
    case 0x1c:
      return nominal_;
    case 0x40: {
      const std::uint32_t value = transmit_errors_ | (receive_errors_ & 0x7f) << 8 |
                                  (receive_errors_ > 127 ? 1U << 15 : 0) | logged_errors_ << 16;
      logged_errors_ = 0;
      return value;
    }
    case 0x44:
      return protocol_status();
    case 0x48:
      return delay_;
    case 0x50:
      return interrupts_;
    case 0x54:
      return enabled_;
    case 0x58:
      return lines_;
    case 0x5c:
      return line_enable_;
    case 0x80:
      return filters_;
    case 0x84:
      return mask_;
    case 0x90:
      return fifo_status(0);
    case 0x98:
      return fifo_status(1);
    case 0xc0:
      return transmit_mode_;
    case 0xc4:
      return transmit_status();
    case 0xc8:
      return pending_;
    case 0xcc:
      return 0;
    case 0xd0:
      return cancel_requests_;
    case 0xd4:
      return occurred_;
    case 0xd8:
      return cancelled_;
    case 0x100:
      return divider_;
    default:
      complain_("reads FDCAN + " + std::to_string(offset) + ", which is not modelled");
      return 0;
  }
}

void Fdcan::write(Offset offset, std::uint32_t value, Time now) {
  const auto configure = [&](std::uint32_t& to, std::uint32_t fields) {
    if (!open()) return complain_("FDCAN + " + std::to_string(offset) + " is protected: INIT and CCE");
    if ((value & ~fields) != 0) complain_("FDCAN + " + std::to_string(offset) + ": reserved bits");
    to = value & fields;
  };
  switch (offset) {
    case 0x0c:
      return configure(data_, 0x009f'1fff);
    case 0x18:
      return write_control(value, now);
    case 0x1c:
      return configure(nominal_, 0xffff'ff7f);
    case 0x48:
      return configure(delay_, 0x7f7f);
    case 0x50:
      interrupts_ &= ~value;
      return;
    case 0x54:
      enabled_ = value & 0x00ff'ffff;
      return;
    case 0x58:
      lines_ = value & 0x7f;
      return;
    case 0x5c:
      line_enable_ = value & 0b11;
      return;
    case 0x80:
      return configure(filters_, 0x0f1f'033f);
    case 0x84:
      return configure(mask_, 0x1fff'ffff);
    case 0x94:
      return acknowledge(0, value);
    case 0x9c:
      return acknowledge(1, value);
    case 0xc0:
      return configure(transmit_mode_, 1U << 24);
    case 0xcc:
      return add_requests(value);
    case 0xd0:
      return cancel(value);
    case 0x100:
      return configure(divider_, 0xf);
    default:
      complain_("writes FDCAN + " + std::to_string(offset) + ", which is not modelled");
  }
}

void Fdcan::write_control(std::uint32_t value, Time now) {
  constexpr std::uint32_t clock_stop = 1U << 4, fixed = 0b1011'0000'1110'0100;  // modes that nobody should need
  constexpr std::uint32_t guarded = 0b1111'0011'1100'0000;                      // protected by INIT and CCE
  if ((value & fixed) != 0) complain_("CCCR: a mode that is not modelled");
  if ((value & clock_stop) != 0) complain_("CCCR: clock stop");
  const bool sees_init = now >= init_visible_ && init_;
  if ((value & 0b10) != 0 && !sees_init) {
    complain_("CCCR: CCE before INIT has come through");
    value &= ~0b10U;
  }
  if (!open() && ((value ^ control_) & guarded) != 0) {
    complain_("CCCR: protected bits need INIT and CCE");
    value = (value & ~guarded) | (control_ & guarded);
  }
  const bool init = (value & 1U) != 0;
  if (!init) value &= ~0b10U;
  if ((value & 0b10) != 0 && (control_ & 0b10) == 0) reset_fifos();
  if (init != init_) {
    if (now < init_visible_) complain_("CCCR: INIT changes before its last change has come through");
    init_before_ = init_;
    init_visible_ = now + (hz_ == 0 ? 0 : periods(4, hz_));
    init_ = init;
    if (init) in_flight_.reset();
    // Bus-off cannot be shortened: 129 sequences; else the controller joins at the next bus idle (44.4.13).
    if (!init) sequences_left_ = bus_off_ ? 129 : 1;
    joins_after_ = now;
  }
  control_ = (value & 0xf3e6U) | (init_ ? 1U : 0);
}

std::uint32_t Fdcan::read_ram(Offset offset) {
  if (offset >= ram_bytes) {
    complain_("reads the message RAM of another instance");
    return 0;
  }
  for (std::uint32_t i = 0; i < 2; ++i) {
    const Offset begin = fifo_at + i * fifo_bytes;
    if (offset < begin || offset >= begin + fifo_bytes) continue;
    if (fifos_[i].level == 0 || (offset - begin) / 72 != fifos_[i].get)
      complain_("reads another element of an Rx FIFO than the oldest");
  }
  return word(offset);
}

void Fdcan::write_ram(Offset offset, std::uint32_t value) {
  if (offset >= ram_bytes) return complain_("writes the message RAM of another instance");
  if (offset >= transmit_at && (pending_ >> (offset - transmit_at) / 72 & 1U) != 0)
    complain_("writes a Tx buffer that waits to be sent");
  if (offset >= fifo_at && offset < events_at && !init_) complain_("writes into an Rx FIFO");
  ram_[offset / 4] = value;
}

void Fdcan::acknowledge(std::uint32_t i, std::uint32_t index) {
  Fifo& fifo = fifos_[i];
  if (fifo.level == 0 || index != fifo.get) complain_("acknowledges another element than the oldest");
  if (fifo.level == 0) return;
  fifo.get = (index + 1) % 3;
  --fifo.level;
}

// --- sending ---------------------------------------------------------------------------------------------------------

void Fdcan::add_requests(std::uint32_t bits) {
  if (off()) complain_("asks to send while off the bus");
  for (std::uint32_t i = 0; i < 3; ++i) {
    if ((bits >> i & 1U) == 0) continue;
    if ((pending_ >> i & 1U) != 0) {
      complain_("asks to send a buffer that waits already");
      continue;
    }
    if (!queue_mode() && i != put_) complain_("asks to send another buffer than the put index");
    pending_ |= 1U << i;
    occurred_ &= ~(1U << i);
    cancelled_ &= ~(1U << i);
    if (queue_mode()) {
      for (std::uint32_t step = 0; step < 3 && (pending_ >> put_ & 1U) != 0; ++step) put_ = (put_ + 1) % 3;
    } else {
      put_ = (put_ + 1) % 3;
    }
  }
}

void Fdcan::free_buffer(std::uint32_t buffer) {
  const bool was_full = pending_ == 0b111;
  pending_ &= ~(1U << buffer);
  cancel_requests_ &= ~(1U << buffer);
  if (queue_mode()) {
    if (was_full) put_ = buffer;
  } else {
    while (pending_ != 0 && (pending_ >> get_ & 1U) == 0) get_ = (get_ + 1) % 3;
    if (pending_ == 0) get_ = put_;
  }
  if (pending_ == 0) interrupts_ |= fifo_empty;
}

void Fdcan::cancel(std::uint32_t bits) {
  for (std::uint32_t i = 0; i < 3; ++i) {
    if ((bits >> i & 1U) == 0) continue;
    cancel_requests_ |= 1U << i;
    if (in_flight_ == i) continue;  // at the end of the transmission
    free_buffer(i);
    cancel_requests_ &= ~(1U << i);
    cancelled_ |= 1U << i;
    interrupts_ |= cancellation_finished;
  }
}

std::uint32_t Fdcan::key(std::uint32_t head) {
  // Identifier, then RTR, IDE, the lower bits: as they follow each other on the wire.
  const bool extended = (head >> 30 & 1U) != 0, remote = (head >> 29 & 1U) != 0;
  const std::uint32_t base = head >> 18 & 0x7ff;
  if (!extended) return base << 21 | (remote ? 1U << 20 : 0);
  return base << 21 | 1U << 20 | 1U << 19 | (head & 0x3'ffff) << 1 | (remote ? 1U : 0);
}

std::optional<std::uint32_t> Fdcan::candidate() const {
  if (pending_ == 0 || !takes_part()) return std::nullopt;
  if (!queue_mode()) return (pending_ >> get_ & 1U) != 0 ? std::optional(get_) : std::nullopt;
  std::optional<std::uint32_t> best;
  for (std::uint32_t i = 0; i < 3; ++i)
    if ((pending_ >> i & 1U) != 0 && (!best || arbitration_key(i) < arbitration_key(*best))) best = i;
  return best;
}

Frame Fdcan::frame_in(std::uint32_t buffer) const {
  const Offset at = transmit_at + 72 * buffer;
  const std::uint32_t head = word(at), shape = word(at + 4);
  Frame frame;
  frame.extended = (head >> 30 & 1U) != 0;
  frame.remote = (head >> 29 & 1U) != 0;
  frame.id = frame.extended ? head & 0x1fff'ffff : head >> 18 & 0x7ff;
  frame.fd = fd_enabled() && (shape >> 21 & 1U) != 0 && !frame.remote;
  const std::uint32_t code = shape >> 16 & 0xf;
  frame.size = frame.fd ? lengths[code] : static_cast<std::uint8_t>(std::min<std::uint32_t>(code, 8));
  if (frame.fd && ((control_ >> 9 & 1U) == 0 || (shape >> 20 & 1U) == 0))
    complain_("an FD frame without bit rate switch");
  for (std::uint32_t i = 0; i < frame.size && !frame.remote; ++i)
    frame.data[i] = static_cast<std::uint8_t>(word(at + 8 + (i & ~3U)) >> 8 * (i % 4));
  return frame;
}

void Fdcan::sent(std::uint32_t buffer) {
  in_flight_.reset();
  occurred_ |= 1U << buffer;
  if ((cancel_requests_ >> buffer & 1U) != 0) cancelled_ |= 1U << buffer;
  free_buffer(buffer);
  interrupts_ |= transmission_complete;
  last_error_ = 0;
  const bool was_passive = passive(), was_warning = transmit_errors_ >= 96 || receive_errors_ >= 96;
  if (transmit_errors_ > 0) --transmit_errors_;
  update_state(was_passive, was_warning);
}

void Fdcan::failed(std::uint32_t buffer, Failure why) {
  in_flight_.reset();
  last_error_ = why == Failure::bit ? 5 : 3;
  interrupts_ |= arbitration_error;
  if ((cancel_requests_ >> buffer & 1U) != 0) {
    free_buffer(buffer);
    cancelled_ |= 1U << buffer;
  }
  // A passive transmitter that nobody acknowledges does not count (ISO 11898-1, exception 1).
  if (why == Failure::bit || !passive()) count_transmit_error();
}

void Fdcan::update_state(bool was_passive, bool was_warning) {
  if (passive() != was_passive) interrupts_ |= error_passive;
  if ((transmit_errors_ >= 96 || receive_errors_ >= 96) != was_warning) interrupts_ |= error_warning;
}

void Fdcan::count_transmit_error() {
  const bool was_passive = passive(), was_warning = transmit_errors_ >= 96 || receive_errors_ >= 96;
  transmit_errors_ += 8;
  logged_errors_ = std::min<std::uint32_t>(logged_errors_ + 1, 0xff);
  if (transmit_errors_ > 255) {
    transmit_errors_ = 255;
    bus_off_ = true;
    init_ = init_before_ = true;
    control_ |= 1U;
    interrupts_ |= bus_off_changed;
  }
  update_state(was_passive, was_warning);
}

void Fdcan::count_receive_error() {
  const bool was_passive = passive(), was_warning = transmit_errors_ >= 96 || receive_errors_ >= 96;
  if (receive_errors_ < 128) ++receive_errors_;
  logged_errors_ = std::min<std::uint32_t>(logged_errors_ + 1, 0xff);
  interrupts_ |= arbitration_error;
  last_error_ = 2;
  update_state(was_passive, was_warning);
}

void Fdcan::recessive_sequences(std::uint32_t count) {
  if (init_ || sequences_left_ == 0 || count == 0) return;
  sequences_left_ -= std::min(count, sequences_left_);
  if (sequences_left_ != 0 || !bus_off_) return;
  bus_off_ = false;
  transmit_errors_ = receive_errors_ = 0;
  interrupts_ |= bus_off_changed;
}

// --- receiving -------------------------------------------------------------------------------------------------------

std::optional<std::uint32_t> Fdcan::filter(const Frame& frame) const {
  const auto by_element = [&](std::uint32_t action) -> std::optional<std::uint32_t> {
    if (action == 1 || action == 2) return action - 1;
    if (action != 3) complain_("priority filters are not modelled");
    return std::nullopt;
  };
  const auto otherwise = [](std::uint32_t field) -> std::optional<std::uint32_t> {
    return field < 2 ? std::optional(field) : std::nullopt;
  };
  const auto matches = [&](std::uint32_t type, std::uint32_t id, std::uint32_t one, std::uint32_t two) {
    switch (type) {
      case 0:
      case 3:
        return id >= one && id <= two;
      case 1:
        return id == one || id == two;
      default:
        return (id & two) == (one & two);
    }
  };
  if (frame.remote && (filters_ >> (frame.extended ? 0 : 1) & 1U) != 0) return std::nullopt;
  if (frame.extended) {
    for (Offset i = 0; i < std::min<std::uint32_t>(filters_ >> 24 & 0xf, 8); ++i) {
      const std::uint32_t one = word(extended_at + 8 * i), two = word(extended_at + 8 * i + 4);
      if (one >> 29 == 0 || one >> 29 == 7) continue;
      const std::uint32_t id = two >> 30 == 3 ? frame.id : frame.id & mask_;
      if (matches(two >> 30, id, one & 0x1fff'ffff, two & 0x1fff'ffff)) return by_element(one >> 29);
    }
    return otherwise(filters_ >> 2 & 0b11);
  }
  for (Offset i = 0; i < std::min<std::uint32_t>(filters_ >> 16 & 0x1f, 28); ++i) {
    const std::uint32_t element = word(4 * i), action = element >> 27 & 0b111;
    if (action == 0 || action == 7 || element >> 30 == 3) continue;
    if (matches(element >> 30, frame.id, element >> 16 & 0x7ff, element & 0x7ff)) return by_element(action);
  }
  return otherwise(filters_ >> 4 & 0b11);
}

void Fdcan::arrives(const Frame& frame) {
  if (frame.fd && !fd_enabled()) return;  // protocol exception event: waits for bus idle (44.3, PXHD = 0)
  last_error_ = 0;
  if (receive_errors_ > 0) {
    const bool was_passive = passive(), was_warning = transmit_errors_ >= 96 || receive_errors_ >= 96;
    receive_errors_ = receive_errors_ > 127 ? 120 : receive_errors_ - 1;
    update_state(was_passive, was_warning);
  }
  if (const auto fifo = filter(frame)) store(*fifo, frame);
}

void Fdcan::store(std::uint32_t i, const Frame& frame) {
  Fifo& fifo = fifos_[i];
  const bool overwrites = (filters_ >> (9 - i) & 1U) != 0;
  if (fifo.level == 3) {
    if (!overwrites) {
      interrupts_ |= 0b100U << 3 * i;
      return;
    }
    fifo.get = (fifo.get + 1) % 3;
    --fifo.level;
  }
  const Offset at = fifo_at + i * fifo_bytes + 72 * ((fifo.get + fifo.level) % 3);
  ram_[at / 4] = (frame.extended ? 1U << 30 | frame.id : frame.id << 18) | (frame.remote ? 1U << 29 : 0);
  ram_[at / 4 + 1] = (frame.fd ? 0b11U << 20 : 0) | code_of(frame) << 16;
  for (std::uint32_t byte = 0; byte < frame.size && !frame.remote; byte += 4) {
    std::uint32_t data = 0;
    for (std::uint32_t k = 0; k < 4; ++k) data |= std::uint32_t{frame.data[byte + k]} << 8 * k;
    ram_[(at + 8 + byte) / 4] = data;
  }
  ++fifo.level;
  interrupts_ |= 0b001U << 3 * i;
  if (fifo.level == 3) interrupts_ |= 0b010U << 3 * i;
}

// --- bit timing ------------------------------------------------------------------------------------------------------

double Fdcan::bit_rate() const {
  const Segments n = nominal_segments(nominal_);
  const double clock = static_cast<double>(hz_) / ((divider_ & 0xf) == 0 ? 1 : 2 * (divider_ & 0xf));
  return clock / (n.prescaler * n.quanta());
}
double Fdcan::data_bit_rate() const {
  const Segments d = data_segments(data_);
  const double clock = static_cast<double>(hz_) / ((divider_ & 0xf) == 0 ? 1 : 2 * (divider_ & 0xf));
  return clock / (d.prescaler * d.quanta());
}

bool Fdcan::follows(const WireRates& wire, bool fd) const {
  if (hz_ == 0) return false;
  // Both ends may be off by the tolerance; here one of them is perfect.
  const auto tolerance = [](double one, double other) { return 2 * std::min(one, other); };
  const Segments n = nominal_segments(nominal_);
  const double off = std::abs(bit_rate() / static_cast<double>(wire.nominal) - 1);
  if (off > tolerance(n.jump / (20 * n.quanta()), n.segment2 / (2 * (13 * n.quanta() - n.segment2)))) return false;
  if (!fd) return true;
  const Segments d = data_segments(data_);
  const double data_off = std::abs(data_bit_rate() / static_cast<double>(wire.data) - 1);
  return data_off <= 2 * d.jump / (20 * d.quanta());
}

bool Fdcan::sees_itself(const WireRates& wire) const {
  if (hz_ == 0) return false;
  const Segments d = data_segments(data_);
  const double period = 1e9 / static_cast<double>(hz_);
  const double bit = period * d.prescaler * d.quanta(), delay = static_cast<double>(wire.loop_delay) / 1e6;
  if ((data_ >> 23 & 1U) == 0) return delay < period * d.prescaler * (1 + d.segment1);
  if (d.prescaler > 2) complain_("TDC with a data prescaler above 2");
  const double offset = period * (delay_ >> 8 & 0x7f);
  // The secondary sample point lies in the bit as it comes back, and its place fits into TDCV.
  return offset > 0 && offset < bit && delay + offset <= 127 * period;
}

// --- the wire --------------------------------------------------------------------------------------------------------

Time Wire::duration(const Frame& frame) const {
  const bus_load::Rates both{rates.nominal, rates.data};
  const Time nanosecond = microsecond / 1000 / speed;
  const std::uint32_t bytes = frame.remote ? 0U : frame.size;
  if (frame.fd) return bus_load::fd_ns(bytes, both) * nanosecond;
  return bus_load::classic_ns(bytes, both) * nanosecond + (frame.extended ? bit_time(25) : 0);
}

void Wire::count_idle(Time now) {
  idle_counted_ = std::max({idle_counted_, idle_since_, node_.joins_after()});
  if (node_.initialising() || node_.sequences_left() == 0 || now < idle_counted_) return;
  const std::uint64_t sequences = (now - idle_counted_) / bit_time(11);
  idle_counted_ += bit_time(static_cast<std::uint32_t>(11 * sequences));
  node_.recessive_sequences(static_cast<std::uint32_t>(sequences));
}

void Wire::finish() {
  const Time end = busy_until_;
  busy_until_ = 0;
  idle_since_ = end;
  if (host_sends_) {
    host_sends_ = false;
    if (node_.takes_part()) {
      if (node_.follows(rates, frame_.fd))
        node_.arrives(frame_);
      else
        node_.receives_error();
    }
  } else if (node_sends_) {
    node_sends_ = false;
    if (node_.off()) return;
    if (failure_) {
      node_.failed(buffer_, *failure_);
    } else {
      node_.sent(buffer_);
      heard.push_back({end, frame_});
    }
  }
  node_.recessive_sequences(1);  // acknowledge delimiter, end of frame, intermission
}

bool Wire::start(Time now) {
  const auto own = node_.candidate();
  const bool host_ready = !queue_.empty() && queue_.front().earliest <= now;
  if (!own && !host_ready) return false;
  bool host_wins = host_ready;
  if (own && host_ready) {
    const Frame& theirs = queue_.front().frame;
    const std::uint32_t head =
        (theirs.extended ? 1U << 30 | theirs.id : theirs.id << 18) | (theirs.remote ? 1U << 29 : 0);
    host_wins = Fdcan::key(head) < node_.arbitration_key(*own);
    if (host_wins) ++lost_arbitrations;
  }
  if (host_wins) {
    frame_ = queue_.front().frame;
    queue_.pop_front();
    host_sends_ = true;
  } else {
    buffer_ = *own;
    frame_ = node_.frame_in(buffer_);
    node_.starts(buffer_);
    node_sends_ = true;
    const bool destroyed =
        disturbed > 0 || !node_.follows(rates, frame_.fd) || (frame_.fd && !node_.sees_itself(rates));
    failure_ = std::nullopt;
    if (destroyed)
      failure_ = Fdcan::Failure::bit;
    else if (!host_listens)
      failure_ = Fdcan::Failure::acknowledge;
    if (disturbed > 0) --disturbed;
  }
  // A frame that is destroyed early, its error frame and the pause: 20 + 23 bits; a passive transmitter waits 8 more.
  const bool cut_off = node_sends_ && failure_ == Fdcan::Failure::bit;
  busy_until_ = now + (cut_off ? bit_time(20 + 23 + (node_.passive() ? 8 : 0)) : duration(frame_));
  return true;
}

Time Wire::happen(Time now) {
  for (;;) {
    if (stuck_dominant) {
      // Only what is under way is destroyed; nobody sees the bus idle.
      if (node_sends_ && busy_until_ != 0) node_sends_ = false, node_.failed(buffer_, Fdcan::Failure::bit);
      busy_until_ = 0;
      idle_since_ = idle_counted_ = now;
      return now + bit_time(11);
    }
    if (busy_until_ != 0) {
      if (busy_until_ > now) return busy_until_;
      finish();
      continue;
    }
    count_idle(now);
    if (!start(now)) break;
  }
  Time next = never;
  if (!queue_.empty()) next = std::max(queue_.front().earliest, now + 1);
  if (!node_.initialising() && node_.sequences_left() != 0) next = std::min(next, idle_counted_ + bit_time(11) + 1);
  return std::max(next, now + 1);
}

}  // namespace fxdyn::emulated
