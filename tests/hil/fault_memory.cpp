// The fault campaign on a bus in memory, with a time of its own: for volume. fault_memory [EVENTS [SEED
// [before|after]]], the last: when the setpoints of a SYNC come.

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <memory>

#include "firmware/drive_node.hpp"
#include "hal/fake/can.hpp"
#include "hal/fake/clock.hpp"
#include "hal/fake/gpio.hpp"
#include "tests/hil/fault_campaign.hpp"

namespace {

using namespace fxdyn;
using tables::Model;
using Frame = can::Frame;

class MemoryNode final : public hil::NodeUnderTest, public can::Bus {
 public:
  MemoryNode() { restart(true); }
  can::Bus& bus() override { return *this; }
  std::uint32_t fall_off_the_bus() override {
    controller_->fall_off_the_bus(3);
    return 0;
  }
  void restart(bool good_tables) override {
    node_.reset();
    wire_ = std::make_unique<hal::fake::CanWire<Frame>>(clock_);
    host_ = std::make_unique<hal::fake::CanController<Frame>>(*wire_);
    controller_ = std::make_unique<hal::fake::CanController<Frame>>(*wire_);
    hardware_ = std::make_unique<Hardware>(Hardware{*controller_, clock_, counter_, watchdog_, enable_, fault_, busy_});
    page_ = tables::page;
    if (!good_tables) corrupt(page_);
    node_ = std::make_unique<Node>(
        *hardware_, NodeTables<Model>{page_.parameters, page_.header, page_is_valid(page_), UpdateSlot::empty, rated_},
        NodeSettings{.id = 1});
    poll();
  }

  void send(const Frame& frame) override {
    static_cast<void>(host_->send(frame));
    wire_->sent.clear();
    poll();
  }
  bool receive(Frame& frame, can::Duration timeout) override {
    const can::Duration end = now() + timeout;
    for (;;) {
      if (host_->receive(frame) == hal::Status::ok) return true;
      if (now() >= end) return false;
      const auto left = static_cast<std::uint64_t>((end - now()) / std::chrono::microseconds(1));
      clock_.advance(std::clamp<std::uint64_t>(left, 1, 100));
      poll();
    }
  }
  can::Duration now() const override { return std::chrono::microseconds(clock_.elapsed_us()); }
  std::uint32_t lost() const override { return host_->errors().lost; }
  std::string name() const override { return "memory"; }
  std::string trouble() override { return {}; }

 private:
  using Hardware = DriveHardware<hal::fake::CanController<Frame>, hal::fake::Clock, hal::fake::CycleCounter,
                                 hal::fake::Watchdog, hal::fake::InputPin, hal::fake::OutputPin, hal::fake::OutputPin>;
  using Node = DriveNode<Model, Hardware>;
  void poll() {
    for (int i = 0; node_->poll(); ++i) {
      if (i == 100'000) {
        std::printf("FAILED: the node hangs\n");
        std::exit(1);
      }
    }
  }
  /// One bit of it, another one each time.
  void corrupt(TablePage<Model>& page) {
    corrupt_bit_ = (corrupt_bit_ + 7919) % (8 * sizeof page);
    auto* bytes = reinterpret_cast<unsigned char*>(&page);
    bytes[corrupt_bit_ / 8] = static_cast<unsigned char>(bytes[corrupt_bit_ / 8] ^ 1U << corrupt_bit_ % 8);
  }
  TablePage<Model> page_{};
  std::size_t corrupt_bit_ = 0;
  static constexpr RatedTorques<Model> rated_{tables::rated_torque};
  hal::fake::Clock clock_;
  hal::fake::CycleCounter counter_;
  hal::fake::Watchdog watchdog_{clock_, 50'000};
  hal::fake::InputPin enable_{true};
  hal::fake::OutputPin fault_, busy_;
  std::unique_ptr<hal::fake::CanWire<Frame>> wire_;
  std::unique_ptr<hal::fake::CanController<Frame>> host_, controller_;
  std::unique_ptr<Hardware> hardware_;
  std::unique_ptr<Node> node_;
};

}  // namespace

int main(int count, char** arguments) {
  const auto events = count > 1 ? std::strtoull(arguments[1], nullptr, 10) : 2000U;
  const auto seed = count > 2 ? std::strtoul(arguments[2], nullptr, 10) : 1U;
  try {
    MemoryNode node;
    const bool after = count > 3 && std::strcmp(arguments[3], "after") == 0;
    hil::FaultCampaign campaign(node, {.seed = static_cast<unsigned>(seed),
                                       .period = std::chrono::milliseconds(2),
                                       .order = after ? hil::Order::after : hil::Order::before});
    campaign.run(events);
    return campaign.report() ? 0 : 1;
  } catch (const std::exception& error) {
    std::printf("FAILED: %s\n", error.what());
    return 1;
  }
}
