// Host in the loop: configures the nodes of a bus over SDO, streams motion in lockstep, compares every byte of every
// torque frame with the host's own Model::tick, and reads the nodes' counters afterwards. Exit code 0: all of it as it
// should be.

#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <string>
#include <vector>

#include "firmware/protocol/object_dictionary.hpp"
#include "host_tools/can/lockstep.hpp"
#include "tests/golden/tables.hpp"
#include "tests/hil/motion.hpp"

namespace {

using namespace fxdyn;
using dictionary::Counter;
using tables::Model;

int failures = 0;
void check(bool good, const char* what, unsigned node, std::uint32_t is = 0, std::uint32_t wanted = 0) {
  if (good) return;
  ++failures;
  std::printf("FAILED: node %u: %s (is %u, expected %u)\n", node, what, is, wanted);
}
void check_equal(std::uint32_t is, std::uint32_t wanted, const char* what, unsigned node) {
  check(is == wanted, what, node, is, wanted);
}

struct Options {
  std::string can = "vcan0", name = "bus";
  std::vector<std::uint8_t> nodes{1};
  unsigned ticks = 5000;
  double least_rate = 0;  // ticks/s
  bool fd = false;
};

Options parse(int count, char** arguments) {
  Options options;
  for (int i = 1; i + 1 < count; i += 2) {
    const std::string name = arguments[i], value = arguments[i + 1];
    if (name == "--can") options.can = value;
    if (name == "--name") options.name = value;
    if (name == "--ticks") options.ticks = static_cast<unsigned>(std::stoul(value));
    if (name == "--least-rate") options.least_rate = std::stod(value);
    if (name == "--fd") options.fd = value == "1";
    if (name == "--nodes") {  // how many, from 1
      options.nodes.clear();
      for (unsigned node = 1; node <= std::stoul(value); ++node)
        options.nodes.push_back(static_cast<std::uint8_t>(node));
    }
  }
  return options;
}

std::uint32_t counter(can::Master& master, std::uint8_t node, Counter item) {
  return master.read(node, dictionary::counter_record, static_cast<std::uint8_t>(static_cast<int>(item) + 1));
}

void configure(can::Master& master, std::uint8_t node, bool fd) {
  master.reset(node, std::chrono::seconds(60));  // an emulator may just start
  check_equal(master.read(node, 0x1018, 2), dictionary::product_code, "product code", node);
  check_equal(master.read(node, dictionary::tables, 1), tables::page.header.crc32, "CRC of the tables", node);
  check_equal(master.read(node, dictionary::tables, 3), 1, "tables valid", node);
  check(master.read_text(node, 0x1008, 0) == dictionary::device_name, "device name (segmented upload)", node);
  const std::string label = "joint drive of the test bed";
  master.download(node, 0x2003, 0, std::span{reinterpret_cast<const std::uint8_t*>(label.data()), label.size()});
  check(master.read_text(node, 0x2003, 0) == label, "label (segmented download)", node);
  for (std::size_t j = 0; j < Model::joints; ++j) {
    const auto& limits = tables::parameters.constants[j].limits;
    const auto sub = static_cast<std::uint8_t>(j + 1);
    check_equal(master.read(node, 0x2021, sub),
                static_cast<std::uint32_t>(whole_share(limits.dq_lower.raw, limits.dq_upper.raw)), "velocity of 32768",
                node);
    check_equal(master.read(node, 0x2022, sub),
                static_cast<std::uint32_t>(whole_share(limits.ddq_lower.raw, limits.ddq_upper.raw)),
                "acceleration of 32768", node);
    check_equal(master.read(node, 0x2040, sub), static_cast<std::uint32_t>(tables::rated_torque[j]), "rated torque",
                node);
  }
  try {
    master.write(node, 0x1018, 2, 0, 4);
    check(false, "a read-only object was written", node);
  } catch (const can::SdoAbort& abort) {
    check(abort.code == canopen::Abort::read_only, "abort code of a write to a read-only object", node);
  }
  master.use_lockstep(node, std::chrono::seconds(6));  // a slow machine is no fault here
  master.write(node, 0x2013, 0, 1, 1);                 // parity of the tick
  if (fd) master.write(node, 0x2030, 0, 1, 1);
}

std::array<std::uint32_t, dictionary::counters> read_counters(can::Master& master, std::uint8_t node) {
  std::array<std::uint32_t, dictionary::counters> values;
  for (std::size_t i = 0; i < values.size(); ++i) values[i] = counter(master, node, static_cast<Counter>(i));
  return values;
}

int run(const Options& options) {
  can::SocketBus bus(options.can, options.fd);
  can::Master master(bus);
  master.sdo_timeout = std::chrono::seconds(5);  // emulators
  for (const std::uint8_t node : options.nodes) {
    configure(master, node, options.fd);
  }
  std::vector<std::array<std::uint32_t, dictionary::counters>> before;
  for (const std::uint8_t node : options.nodes) before.push_back(read_counters(master, node));
  master.command(canopen::NmtCommand::start);
  for (const std::uint8_t node : options.nodes)
    master.wait_for(node, canopen::NmtState::operational, std::chrono::seconds(5));

  constexpr double tick_s = 0.002;
  hil::Motion<Model> motion(tables::parameters, tick_s, 7);
  hil::Expected<Model> expected(tables::parameters, tables::rated_torque, dictionary::defaults::ramp_ticks);
  can::Lockstep lockstep(master,
                         {.joints = Model::joints, .expect = {}, .fd = options.fd, .timeout = std::chrono::seconds(5)});
  std::uint64_t equal = 0, different = 0;
  std::array<std::uint8_t, Model::joints> first_count{};
  for (unsigned i = 0; i < options.ticks; ++i) {
    const auto setpoints = motion.next();
    const auto& torques = lockstep.tick(setpoints);
    const auto wanted = expected.tick(setpoints, 0);
    bool same = true;
    for (std::size_t j = 0; j < Model::joints; ++j) {
      WireTorque want = wanted[j];
      if (i == 0 && torques[j]) first_count[j] = torques[j]->tick;
      want.tick = static_cast<std::uint8_t>(first_count[j] + i);
      if (torques[j] == want) continue;
      if (same && ++different <= 5) {
        std::printf("tick %u joint %zu: %s %d per mille %d milli, status %02x, count %u; expected %d %d %02x %u\n", i,
                    j + 1, torques[j] ? "is" : "nothing, not", torques[j] ? torques[j]->per_mille : 0,
                    torques[j] ? torques[j]->milli : 0, torques[j] ? torques[j]->status : 0U,
                    torques[j] ? torques[j]->tick : 0U, want.per_mille, want.milli, want.status, want.tick);
      }
      same = false;
    }
    equal += same ? 1 : 0;
  }
  check_equal(static_cast<std::uint32_t>(equal), options.ticks, "ticks with torques equal bit for bit", 0);
  const auto& statistics = lockstep.statistics();
  check_equal(static_cast<std::uint32_t>(statistics.missing + statistics.late) + bus.lost(), 0,
              "frames lost or out of place", 0);

  std::uint32_t saturations = 0, cost = 0;
  for (std::size_t n = 0; n < options.nodes.size(); ++n) {
    const std::uint8_t node = options.nodes[n];
    const auto now = read_counters(master, node);
    for (std::size_t i = 0; i < now.size(); ++i) {
      const auto item = static_cast<Counter>(i);
      const std::uint32_t grown = now[i] - before[n][i];
      if (item == Counter::ticks)
        check_equal(grown, options.ticks, "fresh ticks", node);
      else if (item == Counter::saturations)
        saturations += grown;
      else if (item == Counter::foreign_frames && options.nodes.size() > 1)
        continue;  // the other nodes' frames
      else
        check_equal(
            grown, 0,
            dictionary::described[0].name == nullptr ? "" : ("counter " + std::to_string(i + 1) + " of 0x2001").c_str(),
            node);
    }
    cost = std::max(cost, master.read(node, dictionary::cost_record, 4));
    check_equal(master.read(node, 0x1001, 0), 0, "error register", node);
  }
  master.command(canopen::NmtCommand::stop);
  for (const can::Emergency& emergency : master.emergencies) {
    if (emergency.code != 0) check(false, "sent an emergency", emergency.node, emergency.code);
  }

  const auto ms = [&](double share) {
    return static_cast<double>(statistics.round_trips.quantile(share).count()) * 1e-6;
  };
  std::printf(
      "%s: ticks %llu, equal %llu, %.0f ticks/s, round trip p50 %.2f p99 %.2f max %.2f ms, frames lost %u, saturations "
      "%u, most cost %u\n",
      options.name.c_str(), static_cast<unsigned long long>(statistics.ticks), static_cast<unsigned long long>(equal),
      statistics.ticks_per_second(), ms(0.5), ms(0.99), ms(1), static_cast<unsigned>(statistics.missing) + bus.lost(),
      saturations, cost);
  if (options.least_rate > 0) check(statistics.ticks_per_second() >= options.least_rate, "too slow", 0);
  return failures == 0 ? 0 : 1;
}

}  // namespace

int main(int count, char** arguments) {
  try {
    return run(parse(count, arguments));
  } catch (const std::exception& error) {
    std::printf("FAILED: %s\n", error.what());
    return 1;
  }
}
