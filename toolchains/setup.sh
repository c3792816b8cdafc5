#!/usr/bin/env bash
# Installs the Debian 12 packages that fxdyn builds, runs and tests with.
# Asks for root only if something is missing; running it twice does nothing.
set -euo pipefail

packages=(
  # build
  g++ cmake ninja-build pkg-config
  # host libraries
  libeigen3-dev liburdfdom-dev libtomlplusplus-dev nlohmann-json3-dev libcli11-dev libfmt-dev
  # report
  gnuplot-nox
  # target
  gcc-arm-none-eabi libnewlib-arm-none-eabi libstdc++-arm-none-eabi-newlib qemu-system-arm
  binutils-aarch64-linux-gnu openocd
  # tests
  libgtest-dev librapidcheck-dev libbenchmark-dev liborocos-kdl-dev libmujoco-dev libpagmo-dev python3 llvm-14
)

missing=()
for package in "${packages[@]}"; do
  # "installed" as the package manager records it, whatever the architecture suffix
  status=$(dpkg-query -W -f '${db:Status-Status}\n' "$package" 2>/dev/null | head -n 1 || true)
  [ "$status" = installed ] || missing+=("$package")
done
[ ${#missing[@]} -eq 0 ] && exit 0

as_root=()
if [ "$(id -u)" -ne 0 ]; then
  command -v sudo >/dev/null || { echo "setup: missing packages, run as root: apt-get install ${missing[*]}" >&2; exit 1; }
  as_root=(sudo)
fi
echo "setup: installing ${missing[*]}"
"${as_root[@]}" apt-get update -qq
"${as_root[@]}" env DEBIAN_FRONTEND=noninteractive apt-get install -y -qq --no-install-recommends "${missing[@]}" >/dev/null
