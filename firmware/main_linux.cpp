// The drive node as a process: SocketCAN, libgpiod, timers of the kernel. For drives that run Linux, and for tests
// without hardware. Compiled for one tables.hpp; --joint takes one of its joints, so that several nodes, each a process
// or all in one, make up a robot.

#include FXDYN_TABLES_HEADER

#include <poll.h>
#include <sched.h>
#include <signal.h>
#include <sys/mman.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cerrno>
#include <charconv>
#include <cstdio>
#include <cstring>
#include <fstream>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "firmware/drive_node.hpp"
#include "hal/linux/clock.hpp"
#include "hal/linux/pins.hpp"
#include "hal/linux/socket_can.hpp"

namespace {

namespace os = fxdyn::hal::linux;
using fxdyn::hal::Status;
using fxdyn::tables::Model;

constexpr const char* usage =
    R"(usage: fxdyn_node --can IF [options]
  --can IF          SocketCAN interface
  --joint J         puts out the torque of joint J alone, 1 ..; several times: that many nodes, each with a socket of
                    its own; default: one node with all joints that the tables are for
  --node N          node id, 1 .. 127, several nodes count on from it; default: number of the (first) joint
  --fd              also CAN FD frames (object 0x2030)
  --tables FILE     tables.bin instead of the tables it was built with
  --update FILE     tables.bin of `fxdyn update`: taken where it is whole, of the same model and newer than those
  --gpio-chip C     chip of these lines, for one node: gpiochip0, /dev/gpiochip0 or a label
    --enable L      input, default: always enabled
    --fault L       output, low while an error is present: a line that a dead process has let go of reads the same,
                    with a pull-down at the reader
    --busy L        output, high while a tick is computed
  --active-low      of --enable and --busy: low enables, low while a tick is computed
  --fault-high      of --fault: high while an error is present
  --realtime P      SCHED_FIFO with this priority, 1 .. 99, and memory locked
  --watchdog DEV    /dev/watchdog, 1 s, for one node
  --serial-number S of object 0x1018
)";

struct Options {
  const char* can = nullptr;
  std::vector<unsigned> joints;
  unsigned node = 0, serial_number = 0;
  bool fd = false, active_low = false, fault_high = false;
  const char *tables = nullptr, *update = nullptr, *chip = nullptr, *watchdog = nullptr;
  std::optional<unsigned> enable, fault, busy;
  int realtime = 0;
};

/// The way out, to main() and through every destructor: a watchdog that is left armed would reset the machine.
struct Quit {
  int code;
};
[[noreturn]] void quit(int code, const char* what, const char* why = "", const char* more = "") {
  std::fprintf(stderr, "fxdyn_node: %s%s%s\n", what, why, more);
  throw Quit{code};
}

unsigned number(const char* option, const char* text, unsigned lowest, unsigned highest) {
  unsigned value = 0;
  const char* end = text + std::strlen(text);
  const auto [at, error] = std::from_chars(text, end, value);
  if (error != std::errc{} || at != end || value < lowest || value > highest)
    quit(2, option, ": not a number it can take: ", text);
  return value;
}

Options parse(int count, char** arguments) {
  Options options;
  for (int i = 1; i < count; ++i) {
    const std::string_view name = arguments[i];
    if (name == "--help") {
      std::fputs(usage, stdout);
      throw Quit{0};
    }
    if (name == "--fd") {
      options.fd = true;
      continue;
    }
    if (name == "--active-low") {
      options.active_low = true;
      continue;
    }
    if (name == "--fault-high") {
      options.fault_high = true;
      continue;
    }
    if (i + 1 == count) quit(2, arguments[i], ": not an option, or one without its value; --help lists them");
    const char* const option = arguments[i];
    const char* const value = arguments[++i];
    if (name == "--can")
      options.can = value;
    else if (name == "--joint")
      options.joints.push_back(number(option, value, 1, Model::joints));
    else if (name == "--node")
      options.node = number(option, value, 1, fxdyn::canopen::largest_node_id);
    else if (name == "--tables")
      options.tables = value;
    else if (name == "--update")
      options.update = value;
    else if (name == "--gpio-chip")
      options.chip = value;
    else if (name == "--enable")
      options.enable = number(option, value, 0, 65535);
    else if (name == "--fault")
      options.fault = number(option, value, 0, 65535);
    else if (name == "--busy")
      options.busy = number(option, value, 0, 65535);
    else if (name == "--realtime")
      options.realtime = static_cast<int>(number(option, value, 1, 99));
    else if (name == "--watchdog")
      options.watchdog = value;
    else if (name == "--serial-number")
      options.serial_number = number(option, value, 0, 0xFFFF'FFFF);
    else
      quit(2, option, ": no such option; --help lists them");
  }
  if (options.can == nullptr) quit(2, "--can IF is missing: `ip -br link show type can` lists the interfaces");
  if (options.chip == nullptr && (options.enable || options.fault || options.busy))
    quit(2, "--gpio-chip is missing: `gpiodetect` lists the chips");
  if (options.joints.size() > 1 && (options.chip != nullptr || options.watchdog != nullptr))
    quit(2, "--gpio-chip and --watchdog are one node's, so go with one --joint");
  if (options.node + options.joints.size() > fxdyn::canopen::largest_node_id + 1)
    quit(2, "--node: the last node's id would be above 127");
  for (std::size_t i = 0; i < options.joints.size(); ++i) {
    if (std::count(options.joints.begin(), options.joints.end(), options.joints[i]) > 1)
      quit(2, "--joint: the same joint twice");
  }
  return options;
}

/// A pin of the board, or none.
struct Enable {
  os::InputPin pin;
  Status read(bool& on) {
    if (pin.is_open()) return pin.read(on);
    on = true;
    return Status::ok;
  }
};
struct Output {
  os::OutputPin pin;
  Status set(bool on) { return pin.is_open() ? pin.set(on) : Status::ok; }
};

/// `how`: polarity, and of an output what it shows at first.
template <class Pin, class... How>
void open_pin(Pin& pin, const Options& options, const std::optional<unsigned>& line, const char* name, How... how) {
  if (!line) return;
  if (pin.open(options.chip, *line, name, how...) == Status::ok) return;
  const char* remedy = errno == EACCES   ? ": no permission: sudo usermod -aG gpio $USER, and log in anew"
                       : errno == EBUSY  ? ": taken by another program: gpioinfo says which"
                       : errno == EINVAL ? ": no such line: gpioinfo lists them"
                                         : ": no such chip: gpiodetect lists them";
  quit(1, options.chip, (std::string(", line ") + std::to_string(*line)).c_str(), remedy);
}

std::string remedy_of_watchdog(int number) {
  const char* remedy =
      number == EACCES || number == EPERM ? ": run it with sudo"
      : number == EBUSY
          ? ": taken by another program: `sudo fuser -v /dev/watchdog*` says which; systemd lets go of it "
            "with RuntimeWatchdogSec=off in /etc/systemd/system.conf"
      : number == ENOENT || number == ENODEV || number == ENXIO
          ? ": no such watchdog: `wdctl` lists them; one in software: sudo modprobe softdog"
          : ": no watchdog that can be set to 1 s: `wdctl` says what it can do; one in software: sudo "
            "modprobe softdog";
  return std::strerror(number) + std::string(remedy);
}

using Page = fxdyn::TablePage<Model>;
using Tables = fxdyn::ChosenTables<Model>;
constexpr Page nothing{{.magic = 0}, {}};  // as an empty slot
constinit Page loaded_page = nothing, update_page = nothing;

void load(const char* name, Page& page) {
  std::ifstream file(name, std::ios::binary);
  if (!file) quit(2, name, ": can't be read: `fxdyn export` and `fxdyn update` write tables.bin");
  file.read(reinterpret_cast<char*>(&page), sizeof page);
}

/// The tables to compute with, whether they are valid or not, since the node has to say so.
Tables tables_of(const Options& options) {
  if (options.tables != nullptr) load(options.tables, loaded_page);
  if (options.update != nullptr) load(options.update, update_page);
  return fxdyn::choose_tables(options.tables != nullptr ? loaded_page : fxdyn::tables::page, update_page);
}

void prepare_real_time(int priority) {
  const sched_param parameter{.sched_priority = priority};
  if (::sched_setscheduler(0, SCHED_FIFO, &parameter) != 0) {
    quit(1, "--realtime: ", std::strerror(errno),
         ": run it with sudo, or setcap cap_sys_nice,cap_ipc_lock+ep on the program");
  }
  if (::mlockall(MCL_CURRENT | MCL_FUTURE) != 0) {
    quit(1, "--realtime: memory can't be locked: ", std::strerror(errno),
         ": run it with sudo, or setcap cap_sys_nice,cap_ipc_lock+ep on the program, or ulimit -l unlimited before it");
  }
}

volatile sig_atomic_t stopped = 0;

/// The same model with another choice of joints whose torque goes out. Its parameters are the same words.
template <std::uint32_t outputs, class M>
struct WithOutputs;
template <std::uint32_t outputs, class N, std::uint32_t all, class... Joints>
struct WithOutputs<outputs, fxdyn::RobotModel<N, all, Joints...>> {
  using type = fxdyn::RobotModel<N, outputs, Joints...>;
};

/// What goes through to the node beside what it asks for itself (DriveNode::listen): all but the torques and SDO
/// answers of the others, half of a bus. Frames that nobody wants come too, to be counted.
constexpr canid_t base = CAN_EFF_FLAG;  // of frames with 11 bits the mask's function codes, of the others all
constexpr std::array<can_filter, 8> filters{{{CAN_EFF_FLAG, base},
                                             {0x000, base | 0x780},    // NMT
                                             {0x080, base | 0x780},    // SYNC, EMCY
                                             {0x100, base | 0x780},    // TIME
                                             {0x200, base | 0x600},    // setpoints
                                             {0x400, base | 0x700},    // further PDOs
                                             {0x500, base | 0x780},    // the same
                                             {0x600, base | 0x600}}};  // SDO requests, heartbeats

/// Tells when the bus gets worse or better.
class Reporter {
 public:
  explicit Reporter(const Options& options) : options_(options) {}
  template <class Bus>
  void look(Bus& bus) {
    if (const int failure = bus.take_failure(); failure != 0 && failure != failure_) {
      failure_ = failure;
      const auto error = failure == ENETDOWN ? os::CanOpenError::down : os::CanOpenError::no_interface;
      const std::string why = os::explain({error, failure}, options_.can);
      if (failure == ENODEV || failure == ENXIO) quit(1, why.c_str());
      std::fprintf(stderr, "fxdyn_node: %s\n", why.c_str());
    }
    const auto errors = bus.errors();
    if (errors.state == state_) return;
    state_ = errors.state;
    os::CanLink link;
    static_cast<void>(os::query_link(options_.can, link));
    const std::string why = os::explain(errors, options_.can, link.bit_rate);
    std::fprintf(stderr, "fxdyn_node: %s\n", why.empty() ? "on the bus again" : why.c_str());
  }

 private:
  const Options& options_;
  int failure_ = 0;
  fxdyn::hal::CanState state_ = fxdyn::hal::CanState::active;
};

/// A node of this process, whatever its model.
class Node {
 public:
  virtual ~Node() = default;
  virtual bool poll() = 0;  ///< true: there is more to do
  virtual std::uint32_t idle_us() const = 0;
  virtual int bus_descriptor() const = 0;
  virtual int enable_descriptor() const = 0;
  virtual void take_enable_events() = 0;
  virtual void report() = 0;
};

template <class M, class Bus>
class NodeOf final : public Node {
 public:
  NodeOf(const Options& options, const Tables& tables, std::uint32_t id) : reporter_(options) {
    open(options);
    static_assert(sizeof parameters_ == sizeof tables.page.parameters);
    std::memcpy(static_cast<void*>(&parameters_), &tables.page.parameters, sizeof parameters_);
    std::fprintf(stderr, "fxdyn_node: node %u on %s, %zu of %zu joints, tables %08x%s, costs in %s, watchdog %s\n", id,
                 options.can, M::outputs, M::joints, tables.header.crc32,
                 tables.valid ? "" : " INVALID: stays pre-operational", counter_.unit(),
                 watchdog_.armed() ? "armed" : "none");
    if (options.update != nullptr)
      std::fprintf(stderr, "fxdyn_node: %s: %s\n", options.update, fxdyn::name_of(tables.update).data());
    node_.emplace(hardware_, fxdyn::NodeTables<M>{parameters_, tables.header, tables.valid, tables.update, rated},
                  fxdyn::NodeSettings{
                      .id = static_cast<std::uint8_t>(id), .serial_number = options.serial_number, .board = "linux"});
  }
  bool poll() override { return node_->poll(); }
  std::uint32_t idle_us() const override { return node_->idle_us(); }
  int bus_descriptor() const override { return bus_.descriptor(); }
  int enable_descriptor() const override { return enable_.pin.descriptor(); }
  void take_enable_events() override { enable_.pin.events(); }
  void report() override { reporter_.look(bus_); }

 private:
  void open(const Options& options) {
    if (const auto result = bus_.open(options.can, filters); !result) quit(1, os::explain(result, options.can).c_str());
    const auto polarity = options.active_low ? os::Polarity::active_low : os::Polarity::active_high;
    open_pin(enable_.pin, options, options.enable, "fxdyn enable", polarity);
    open_pin(fault_.pin, options, options.fault, "fxdyn fault",
             options.fault_high ? os::Polarity::active_high : os::Polarity::active_low, fxdyn::hal::AtStart::on);
    open_pin(busy_.pin, options, options.busy, "fxdyn tick-busy", polarity);
    if (options.watchdog != nullptr && watchdog_.open(options.watchdog, 1) != Status::ok)
      quit(1, options.watchdog, ": ", remedy_of_watchdog(errno).c_str());
  }

  static constexpr fxdyn::RatedTorques<M> rated{fxdyn::tables::rated_torque};
  Bus bus_;
  Enable enable_;
  Output fault_, busy_;
  os::Watchdog watchdog_;
  os::Clock clock_;
  os::CycleCounter counter_;
  typename M::Parameters parameters_;
  Reporter reporter_;
  using Hardware = decltype(fxdyn::DriveHardware{bus_, clock_, counter_, watchdog_, enable_, fault_, busy_});
  Hardware hardware_{bus_, clock_, counter_, watchdog_, enable_, fault_, busy_};
  std::optional<fxdyn::DriveNode<M, Hardware>> node_;
};

template <class M>
std::unique_ptr<Node> make_node(const Options& options, const Tables& tables, std::uint32_t id) {
  if (options.fd) return std::make_unique<NodeOf<M, os::SocketCan<fxdyn::hal::FdFrame>>>(options, tables, id);
  return std::make_unique<NodeOf<M, os::SocketCan<fxdyn::hal::ClassicFrame>>>(options, tables, id);
}

/// The node that puts out joint `joint` alone.
template <std::size_t j = 0>
std::unique_ptr<Node> make_joint_node(const Options& options, const Tables& tables, unsigned joint, std::uint32_t id) {
  if constexpr (j < Model::joints) {
    if (joint == j + 1) return make_node<typename WithOutputs<1U << j, Model>::type>(options, tables, id);
    return make_joint_node<j + 1>(options, tables, joint, id);
  }
  return nullptr;
}

std::vector<std::unique_ptr<Node>> make_nodes(const Options& options) {
  std::vector<std::unique_ptr<Node>> nodes;
  const Tables tables = tables_of(options);
  constexpr auto first_joint = static_cast<std::uint32_t>(std::countr_zero(Model::outputs_mask)) + 1;
  if (options.joints.empty())
    nodes.push_back(make_node<Model>(options, tables, options.node != 0 ? options.node : first_joint));
  for (std::uint32_t i = 0; i < options.joints.size(); ++i) {
    const unsigned joint = options.joints[i];
    nodes.push_back(make_joint_node(options, tables, joint, options.node != 0 ? options.node + i : joint));
  }
  return nodes;
}

/// One wait for all nodes: a SYNC wakes the process once.
void run(std::vector<std::unique_ptr<Node>>& nodes) {
  std::vector<pollfd> inputs;
  for (const auto& node : nodes) inputs.push_back({node->bus_descriptor(), POLLIN, 0});
  inputs.push_back({nodes[0]->enable_descriptor(), POLLIN, 0});
  while (stopped == 0) {
    bool more = false;
    for (auto& node : nodes) more |= node->poll();
    if (more) continue;
    std::uint32_t idle_us = UINT32_MAX;
    for (auto& node : nodes) idle_us = std::min(idle_us, node->idle_us());
    nodes[0]->report();  // the others are on the same interface
    const timespec idle{0, 1000L * idle_us};
    if (::ppoll(inputs.data(), inputs.size(), &idle, nullptr) > 0 && inputs.back().revents != 0)
      nodes[0]->take_enable_events();
  }
}

}  // namespace

int main(int count, char** arguments) try {
  const Options options = parse(count, arguments);
  struct sigaction stop {};
  stop.sa_handler = [](int) { stopped = 1; };
  ::sigaction(SIGINT, &stop, nullptr);
  ::sigaction(SIGTERM, &stop, nullptr);
  auto nodes = make_nodes(options);
  if (options.realtime != 0) prepare_real_time(options.realtime);
  run(nodes);
  return 0;
} catch (const Quit& quit) {
  return quit.code;
}
