# `cpack --config build/host/CPackConfig.cmake`: the packages fxdyn and libfxdyn-dev for Debian, the same bytes from the same build
# and commit. Version and date are those of the commit: packages_version.cmake.
set(CPACK_GENERATOR DEB)
set(CPACK_PROJECT_CONFIG_FILE ${CMAKE_CURRENT_LIST_DIR}/packages_version.cmake)
set(CPACK_PACKAGE_NAME fxdyn)
set(CPACK_PACKAGE_CONTACT "The maintainers of fxdyn")
set(CPACK_PACKAGE_DESCRIPTION_SUMMARY "${PROJECT_DESCRIPTION}")
set(CPACK_PACKAGING_INSTALL_PREFIX /usr)
set(CPACK_STRIP_FILES ON)
set(CPACK_DEB_COMPONENT_INSTALL ON)
set(CPACK_COMPONENTS_ALL fxdyn libfxdyn-dev)
set(CPACK_DEBIAN_FILE_NAME DEB-DEFAULT)
set(CPACK_DEBIAN_COMPRESSION_TYPE xz)  # has no time stamp of its own
set(CPACK_DEBIAN_PACKAGE_SECTION science)

set(CPACK_DEBIAN_FXDYN_PACKAGE_NAME fxdyn)
set(CPACK_DEBIAN_FXDYN_PACKAGE_SHLIBDEPS ON)
set(CPACK_DEBIAN_FXDYN_PACKAGE_DEPENDS "gnuplot-nox | gnuplot")
if(FXDYN_PYTHON)
  # The module is for this version of Python alone.
  find_package(Python 3.9 REQUIRED COMPONENTS Interpreter)  # the one that host_tools/python is for
  math(EXPR next "${Python_VERSION_MINOR} + 1")
  string(APPEND CPACK_DEBIAN_FXDYN_PACKAGE_DEPENDS
    ", python3 (>= 3.${Python_VERSION_MINOR}), python3 (<< 3.${next}), python3-numpy")
endif()
set(CPACK_DEBIAN_FXDYN_PACKAGE_RECOMMENDS "qemu-system-arm, gcc-arm-none-eabi")

set(CPACK_DEBIAN_LIBFXDYN-DEV_PACKAGE_NAME libfxdyn-dev)
set(CPACK_DEBIAN_LIBFXDYN-DEV_PACKAGE_ARCHITECTURE all)
set(CPACK_DEBIAN_LIBFXDYN-DEV_PACKAGE_SECTION libdevel)
set(CPACK_DEBIAN_LIBFXDYN-DEV_PACKAGE_DEPENDS libeigen3-dev)
set(CPACK_COMPONENT_LIBFXDYN-DEV_DESCRIPTION "Headers and CMake files for firmware that computes with fxdyn's tables")
set(CPACK_FXDYN_SOURCE_DIR ${PROJECT_SOURCE_DIR})
include(CPack)
