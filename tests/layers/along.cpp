#include "host_tools/signals/log.hpp"
#include "host_tools/support/error.hpp"
