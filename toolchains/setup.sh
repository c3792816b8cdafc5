#!/usr/bin/env bash
# Installs the Debian 12 packages that fxdyn builds, runs and tests with.
# Asks for root only if something is missing; running it twice does nothing. The tests with hardware in the loop need
# more: hil_setup.sh.
set -euo pipefail

packages=(
  # build
  g++ cmake ninja-build pkg-config
  # its Debian packages
  dpkg-dev
  # host libraries
  libeigen3-dev liburdfdom-dev libtomlplusplus-dev nlohmann-json3-dev libcli11-dev libfmt-dev zlib1g-dev
  libzstd-dev liblz4-dev libsnappy-dev libsqlite3-dev libmatio-dev libhdf5-dev libsdformat-dev
  # the module of Python
  pybind11-dev python3-dev python3-numpy
  # pins of the node on Linux
  libgpiod-dev
  # report: its pictures; what npm needs to install its plotting library
  gnuplot-nox nodejs
  # target
  gcc-arm-none-eabi libnewlib-arm-none-eabi libstdc++-arm-none-eabi-newlib qemu-system-arm
  binutils-aarch64-linux-gnu openocd libunicorn-dev libcapstone-dev
  # a second compiler, its linker, its checks, the sources' format
  clang-14 lld-14 libclang-rt-14-dev clang-format-14 clang-tidy-14
  # sanitizers: of Clang 14, templates with consteval calls do not compile
  clang-16 libclang-rt-16-dev
  # tests
  chromium
  libgtest-dev libunicorn-dev librapidcheck-dev libbenchmark-dev liborocos-kdl-dev libmujoco-dev libpagmo-dev python3 llvm-14 zstd lz4
  # spelling of the pages, their site, the reference of the headers
  aspell aspell-en mkdocs mkdocs-material doxygen
)

# npm brings the plotting library of the reports (host_tools/page/plotting) and the packages of their tests.
# Node.js from elsewhere has its own npm, beside which Debian's can't be installed.
command -v npm >/dev/null || packages+=(npm)

"$(dirname "$0")/install.sh" "${packages[@]}"
