#include "host_tools/logs/log.hpp"
#include "host_tools/support/error.hpp"
