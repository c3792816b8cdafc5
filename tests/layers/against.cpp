// Signals know no effects: this does not compile with what fxdyn_signals shows.
#include "host_tools/effects/effects.hpp"
