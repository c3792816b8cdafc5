#pragma once

#include <algorithm>
#include <csignal>
#include <ctime>

namespace fxdyn::fleet {

/// While it lives, these signals wait until they are asked for.
class HeldSignals {
 public:
  HeldSignals() {
    ::sigemptyset(&held_);
    for (const int signal : {SIGCHLD, SIGINT, SIGTERM, SIGHUP}) ::sigaddset(&held_, signal);
    ::pthread_sigmask(SIG_BLOCK, &held_, &before_);
  }
  ~HeldSignals() { ::pthread_sigmask(SIG_SETMASK, &before_, nullptr); }
  HeldSignals(const HeldSignals&) = delete;
  HeldSignals& operator=(const HeldSignals&) = delete;
  /// The next one, or 0 after that time.
  int wait(double seconds) const {
    const auto whole = static_cast<time_t>(seconds);
    const timespec time{whole, static_cast<long>(1e9 * (seconds - static_cast<double>(whole)))};
    return std::max(0, ::sigtimedwait(&held_, nullptr, &time));
  }

 private:
  sigset_t held_{}, before_{};
};

}  // namespace fxdyn::fleet
