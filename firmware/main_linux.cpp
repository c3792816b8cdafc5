// The drive node as a process: SocketCAN, libgpiod, timers of the kernel. For drives that run Linux, and for tests
// without hardware. Compiled for one tables.hpp; --joints takes one of its joints, so that several processes make up a
// robot.

#include FXDYN_TABLES_HEADER

#include <poll.h>
#include <sched.h>
#include <signal.h>
#include <sys/mman.h>

#include <array>
#include <bit>
#include <cerrno>
#include <charconv>
#include <cstdio>
#include <cstring>
#include <fstream>
#include <optional>
#include <string_view>

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
  --joint J         puts out the torque of joint J alone, 1 ..; default: all that the tables are for
  --node N          node id, 1 .. 127; default: number of the first joint
  --fd              also CAN FD frames (object 0x2030)
  --tables FILE     tables.bin instead of the tables it was built with
  --gpio-chip C     chip of these lines: gpiochip0, /dev/gpiochip0 or a label
    --enable L      input, default: always enabled
    --fault L       output
    --busy L        output, high while a tick is computed
  --active-low      all three lines
  --realtime P      SCHED_FIFO with this priority, 1 .. 99, and memory locked
  --watchdog DEV    /dev/watchdog, 1 s
  --serial-number S of object 0x1018
)";

struct Options {
  const char* can = nullptr;
  unsigned joint = 0, node = 0, serial_number = 0;
  bool fd = false, active_low = false;
  const char *tables = nullptr, *chip = nullptr, *watchdog = nullptr;
  std::optional<unsigned> enable, fault, busy;
  int realtime = 0;
};

[[noreturn]] void quit(int code, const char* what, const char* why = "", const char* more = "") {
  std::fprintf(stderr, "fxdyn_node: %s%s%s\n", what, why, more);
  std::exit(code);
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
      std::exit(0);
    }
    if (name == "--fd") {
      options.fd = true;
      continue;
    }
    if (name == "--active-low") {
      options.active_low = true;
      continue;
    }
    if (i + 1 == count) quit(2, arguments[i], ": not an option, or one without its value; --help lists them");
    const char* const option = arguments[i];
    const char* const value = arguments[++i];
    if (name == "--can")
      options.can = value;
    else if (name == "--joint")
      options.joint = number(option, value, 1, Model::joints);
    else if (name == "--node")
      options.node = number(option, value, 1, fxdyn::canopen::largest_node_id);
    else if (name == "--tables")
      options.tables = value;
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

template <class Pin>
void open_pin(Pin& pin, const Options& options, const std::optional<unsigned>& line, const char* name) {
  if (!line) return;
  const auto polarity = options.active_low ? os::Polarity::active_low : os::Polarity::active_high;
  if (pin.open(options.chip, *line, name, polarity) == Status::ok) return;
  const char* remedy = errno == EACCES   ? ": no permission: sudo usermod -aG gpio $USER, and log in anew"
                       : errno == EBUSY  ? ": taken by another program: gpioinfo says which"
                       : errno == EINVAL ? ": no such line: gpioinfo lists them"
                                         : ": no such chip: gpiodetect lists them";
  quit(1, options.chip, (std::string(", line ") + std::to_string(*line)).c_str(), remedy);
}

constinit fxdyn::TablePage<Model> loaded_page{};

/// The tables to compute with: those of a file where there is one, whether they are valid or not, since the node has to
/// say so.
const fxdyn::TablePage<Model>& tables_of(const Options& options) {
  if (options.tables == nullptr) return fxdyn::tables::page;
  std::ifstream file(options.tables, std::ios::binary);
  if (!file) quit(2, options.tables, ": can't be read: `fxdyn export` writes tables.bin");
  file.read(reinterpret_cast<char*>(&loaded_page), sizeof loaded_page);
  return loaded_page;
}

void prepare_real_time(int priority) {
  const sched_param parameter{.sched_priority = priority};
  if (::sched_setscheduler(0, SCHED_FIFO, &parameter) != 0) {
    quit(1, "--realtime: ", std::strerror(errno),
         ": run it with sudo, or setcap cap_sys_nice,cap_ipc_lock+ep on the program");
  }
  if (::mlockall(MCL_CURRENT | MCL_FUTURE) != 0) quit(1, "--realtime: memory can't be locked: ", std::strerror(errno));
}

volatile sig_atomic_t stopped = 0;

/// The same model with another choice of joints whose torque goes out. Its parameters are the same words.
template <std::uint32_t outputs, class M>
struct WithOutputs;
template <std::uint32_t outputs, class N, std::uint32_t all, class... Joints>
struct WithOutputs<outputs, fxdyn::RobotModel<N, all, Joints...>> {
  using type = fxdyn::RobotModel<N, outputs, Joints...>;
};

/// What goes through to the node: all but the torques and SDO answers of the others, half of a bus. Its own stay, since
/// another node that sends them has to be noticed.
template <class M>
auto filters(std::uint32_t node) {
  constexpr canid_t base = CAN_EFF_FLAG;  // of frames with 11 bits the mask's function codes, of the others all
  std::array<can_filter, 9 + M::outputs> list{{{CAN_EFF_FLAG, base},
                                               {fxdyn::canopen::sdo_answer_id + node, base | CAN_SFF_MASK},
                                               {0x000, base | 0x780},  // NMT
                                               {0x080, base | 0x780},  // SYNC, EMCY
                                               {0x100, base | 0x780},  // TIME
                                               {0x200, base | 0x600},  // setpoints
                                               {0x400, base | 0x700},
                                               {0x500, base | 0x780},
                                               {0x600, base | 0x600}}};  // SDO requests, heartbeats
  std::size_t at = 9;
  for (std::size_t j = 0; j < M::joints; ++j) {
    if ((M::outputs_mask >> j & 1U) != 0)
      list[at++] = {static_cast<canid_t>(fxdyn::canopen::torque_id + j + 1), base | CAN_SFF_MASK};
  }
  return list;
}

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

template <class M, class Bus>
int run(const Options& options) {
  static Bus bus;
  const auto first_joint = static_cast<std::uint32_t>(std::countr_zero(M::outputs_mask)) + 1;
  const std::uint32_t id = options.node != 0 ? options.node : first_joint;
  const auto wanted = filters<M>(id);
  if (const auto result = bus.open(options.can, wanted); !result) quit(1, os::explain(result, options.can).c_str());
  static Enable enable;
  static Output fault, busy;
  open_pin(enable.pin, options, options.enable, "fxdyn enable");
  open_pin(fault.pin, options, options.fault, "fxdyn fault");
  open_pin(busy.pin, options, options.busy, "fxdyn tick-busy");
  static os::Watchdog watchdog;
  if (options.watchdog != nullptr && watchdog.open(options.watchdog, 1) != Status::ok) {
    quit(1, options.watchdog, ": ", std::strerror(errno));
  }
  static os::Clock clock;
  static os::CycleCounter counter;

  const fxdyn::TablePage<Model>& page = tables_of(options);
  const bool valid = fxdyn::page_is_valid(page);
  static typename M::Parameters parameters;
  static_assert(sizeof parameters == sizeof page.parameters);
  std::memcpy(static_cast<void*>(&parameters), &page.parameters, sizeof parameters);
  static constexpr fxdyn::RatedTorques<M> rated{fxdyn::tables::rated_torque};

  static fxdyn::DriveHardware hardware{bus, clock, counter, watchdog, enable, fault, busy};
  static fxdyn::DriveNode<M, decltype(hardware)> node(
      hardware, {parameters, page.header, valid, options.tables != nullptr, rated},
      {.id = static_cast<std::uint8_t>(id), .serial_number = options.serial_number, .board = "linux"});
  std::fprintf(stderr, "fxdyn_node: node %u on %s, %zu of %zu joints, tables %08x%s, costs in %s, watchdog %s\n",
               node.id(), options.can, M::outputs, M::joints, page.header.crc32,
               valid ? "" : " INVALID: stays pre-operational", counter.unit(), watchdog.armed() ? "armed" : "none");
  if (options.realtime != 0) prepare_real_time(options.realtime);

  Reporter reporter(options);
  std::array<pollfd, 2> inputs{{{bus.descriptor(), POLLIN, 0}, {enable.pin.descriptor(), POLLIN, 0}}};
  while (stopped == 0) {
    if (node.poll()) continue;
    reporter.look(bus);
    const timespec idle{0, 1000L * node.idle_us()};
    if (::ppoll(inputs.data(), inputs.size(), &idle, nullptr) > 0 && inputs[1].revents != 0) enable.pin.events();
  }
  return 0;
}

template <class M>
int run(const Options& options) {
  return options.fd ? run<M, os::SocketCan<fxdyn::hal::FdFrame>>(options)
                    : run<M, os::SocketCan<fxdyn::hal::ClassicFrame>>(options);
}

/// --joint J: the model that puts out joint J alone.
template <std::size_t j = 0>
int run_joint(const Options& options) {
  if constexpr (j < Model::joints) {
    if (options.joint == j + 1) return run<typename WithOutputs<1U << j, Model>::type>(options);
    return run_joint<j + 1>(options);
  }
  return 2;
}

}  // namespace

int main(int count, char** arguments) {
  const Options options = parse(count, arguments);
  struct sigaction stop {};
  stop.sa_handler = [](int) { stopped = 1; };
  ::sigaction(SIGINT, &stop, nullptr);
  ::sigaction(SIGTERM, &stop, nullptr);
  return options.joint == 0 ? run<Model>(options) : run_joint(options);
}
