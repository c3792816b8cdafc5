// Prints the EDS or the DBC of the drive node with the tables that this program was built with.

#include <cstring>
#include <iostream>

#include FXDYN_TABLES_HEADER

#include "host_tools/dictionary/dictionary.hpp"
#include "model/version.hpp"

int main(int argc, char** argv) {
  const bool eds = argc == 2 && std::strcmp(argv[1], "eds") == 0, dbc = argc == 2 && std::strcmp(argv[1], "dbc") == 0;
  if (!eds && !dbc) {
    std::cerr << "usage: fxdyn_dictionary eds|dbc > FILE\n";
    return 2;
  }
  const auto description =
      fxdyn::describe<fxdyn::tables::Model>(fxdyn::tables::parameters, fxdyn::tables::rated_torque, fxdyn::version);
  if (eds)
    fxdyn::write_eds(description, "fxdyn.eds", std::cout);
  else
    fxdyn::write_dbc(description, std::cout);
  return std::cout.good() ? 0 : 1;
}
