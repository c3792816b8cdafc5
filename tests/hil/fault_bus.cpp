// The fault campaign on a bus of the kernel with the node as a process: for reality. fault_bus NODE EVENTS [SEED], NODE
// the program, on vcan0.

#include <fcntl.h>
#include <linux/can/error.h>
#include <linux/can/raw.h>
#include <net/if.h>
#include <signal.h>
#include <spawn.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <fstream>

#include "tests/hil/fault_campaign.hpp"

namespace {

using namespace fxdyn;
constexpr const char* interface = "vcan0";
constexpr const char* corrupt_tables = "/tmp/fxdyn_corrupt_tables.bin";

class ProcessNode final : public hil::NodeUnderTest {
 public:
  explicit ProcessNode(const char* program) : program_(program), bus_(interface) {
    std::array<char, sizeof tables::page> bytes;
    std::memcpy(bytes.data(), &tables::page, bytes.size());
    bytes[bytes.size() / 2] ^= 1;
    std::ofstream(corrupt_tables, std::ios::binary).write(bytes.data(), bytes.size());
    restart(true);
  }
  ~ProcessNode() override { stop(); }
  can::Bus& bus() override { return bus_; }

  /// As a driver tells it: off the bus, and a little later on it again. A virtual interface lets any program say so.
  std::uint32_t fall_off_the_bus() override {
    error_frame(CAN_ERR_BUSOFF);
    ::usleep(20'000);
    error_frame(CAN_ERR_RESTARTED);
    return 0;
  }
  void restart(bool good_tables) override {
    stop();
    const char* arguments[] = {program_,       "--can", interface, "--node", "1", good_tables ? nullptr : "--tables",
                               corrupt_tables, nullptr};
    posix_spawn_file_actions_t files;
    ::posix_spawn_file_actions_init(&files);
    ::posix_spawn_file_actions_addopen(&files, STDERR_FILENO, "/dev/null", O_WRONLY, 0);
    if (::posix_spawn(&process_, program_, &files, nullptr, const_cast<char**>(arguments), environ) != 0) std::abort();
    ::posix_spawn_file_actions_destroy(&files);
  }
  /// False: it crashed.
  bool is_alive() const { return ::waitpid(process_, nullptr, WNOHANG) == 0; }

 private:
  void stop() {
    if (process_ <= 0) return;
    ::kill(process_, SIGKILL);
    ::waitpid(process_, nullptr, 0);
  }
  static void error_frame(canid_t what) {
    const int socket = ::socket(AF_CAN, SOCK_RAW, CAN_RAW);
    sockaddr_can address{};
    address.can_family = AF_CAN;
    address.can_ifindex = static_cast<int>(::if_nametoindex(interface));
    can_frame frame{};
    frame.can_id = CAN_ERR_FLAG | what;
    frame.len = CAN_ERR_DLC;
    if (::bind(socket, reinterpret_cast<sockaddr*>(&address), sizeof address) != 0 ||
        ::write(socket, &frame, sizeof frame) < 0)
      std::abort();
    ::close(socket);
  }

  const char* program_;
  can::SocketBus bus_;
  pid_t process_ = -1;
};

}  // namespace

int main(int count, char** arguments) {
  if (count < 3) return 2;
  try {
    ProcessNode node(arguments[1]);
    const unsigned long seed = count > 3 ? std::strtoul(arguments[3], nullptr, 10) : 1;
    hil::FaultCampaign campaign(node, {.seed = static_cast<unsigned>(seed), .slow_share = 0.05});
    campaign.run(std::strtoull(arguments[2], nullptr, 10));
    const bool good = campaign.report();
    return good && node.is_alive() ? 0 : 1;
  } catch (const std::exception& error) {
    std::printf("FAILED: %s\n", error.what());
    return 1;
  }
}
