// g474_trace NODE.elf [--ticks N]: runs the image through N ticks of a smooth motion and writes what the processor did
// from one rising edge of tick-busy to the next, a line each:
//   t K            tick K begins (tick-busy high)
//   d              the model's tick is done (tick-busy low)
//   i PC SIZE      an instruction was executed (or skipped by its IT block), 2 or 4 bytes
//   r ADDR SIZE    it read memory: flash, RAM or a peripheral
//   w ADDR SIZE    it wrote
//   e N            exception N was entered (16 + interrupt); x: it returned
//   z              it sleeps
// Numbers hexadecimal but K, SIZE and N.

#include <cstdio>
#include <cstring>
#include <exception>

#include "tests/emulated_g474/host.hpp"
#include "tests/firmware/node_bench.hpp"

namespace {

using namespace fxdyn;

class Printer : public emulated::Trace {
 public:
  explicit Printer(emulated::Board& board) : board_(board) {}
  void executes(emulated::Address pc, std::uint32_t size) override {
    follow_pin();
    if (ticks_ > 0) std::printf("i %x %u\n", pc, size);
  }
  void accesses(emulated::Address address, std::uint32_t size, bool writes) override {
    if (ticks_ > 0) std::printf("%c %x %u\n", writes ? 'w' : 'r', address, size);
  }
  void enters(std::uint32_t exception) override {
    if (ticks_ > 0) std::printf("e %u\n", exception);
  }
  void returns() override {
    if (ticks_ > 0) std::puts("x");
  }
  void sleeps() override {
    if (ticks_ > 0) std::puts("z");
  }

 private:
  void follow_pin() {
    const bool busy = board_.port_b.mode(6) == 0b01 && board_.port_b.level(6).value_or(false);
    if (busy && !busy_) std::printf("t %u\n", ++ticks_);
    if (!busy && busy_) std::puts("d");
    busy_ = busy;
  }
  emulated::Board& board_;
  bool busy_ = false;
  std::uint32_t ticks_ = 0;
};

}  // namespace

int main(int argc, char** argv) {
  const bool asks = argc == 4 && std::strcmp(argv[2], "--ticks") == 0;
  if (argc != 2 && !asks) {
    std::fputs("usage: g474_trace NODE.elf [--ticks N]\n", stderr);
    return 2;
  }
  try {
    emulated::Host host(emulated::Image::load(argv[1]));
    if (!host.boot() || !host.write(0x2010, 0, 0, 2)) throw std::runtime_error("the node does not answer");
    host.nmt(canopen::NmtCommand::start);
    Printer printer(host.board);
    host.board.core.set_trace(&printer);
    const unsigned long ticks = asks ? std::strtoul(argv[3], nullptr, 10) : 10;
    for (std::size_t k = 0; k < ticks; ++k) host.tick(test::motion(k));
    host.board.core.set_trace(nullptr);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "g474_trace: %s\n", error.what());
    return 1;
  }
}
