# What `cmake --install` puts into a package: the headers, the CMake files for find_package(fxdyn) and, for users of the
# same processors, toolchain files and linker scripts.
include(CMakePackageConfigHelpers)
set(CMAKE_INSTALL_DEFAULT_COMPONENT_NAME libfxdyn-dev)
set(package_directory share/cmake/fxdyn)  # nothing in it depends on the architecture

set_target_properties(fxdyn_model PROPERTIES EXPORT_NAME model)
install(TARGETS fxdyn_model EXPORT fxdynTargets)
install(EXPORT fxdynTargets NAMESPACE fxdyn:: DESTINATION ${package_directory})
install(DIRECTORY ${PROJECT_SOURCE_DIR}/model DESTINATION include/fxdyn FILES_MATCHING PATTERN *.hpp)
install(FILES ${PROJECT_SOURCE_DIR}/firmware/tick_budget.hpp DESTINATION include/fxdyn/firmware)

configure_package_config_file(fxdynConfig.cmake.in fxdynConfig.cmake INSTALL_DESTINATION ${package_directory})
# Before 1.0 a minor version may change the tables' layout.
write_basic_package_version_file(fxdynConfigVersion.cmake COMPATIBILITY SameMinorVersion ARCH_INDEPENDENT)
install(FILES ${CMAKE_CURRENT_BINARY_DIR}/fxdynConfig.cmake ${CMAKE_CURRENT_BINARY_DIR}/fxdynConfigVersion.cmake
  DESTINATION ${package_directory})

file(GLOB toolchain_files CONFIGURE_DEPENDS ${PROJECT_SOURCE_DIR}/toolchains/*.cmake
  ${PROJECT_SOURCE_DIR}/toolchains/boards.txt)
install(FILES ${toolchain_files} DESTINATION share/fxdyn/toolchains)
install(DIRECTORY ${PROJECT_SOURCE_DIR}/toolchains/linker DESTINATION share/fxdyn/toolchains)
