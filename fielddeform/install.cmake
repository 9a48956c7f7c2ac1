# The library, its public headers (folders named detail/ are internal) and the CMake package.
include(CMakePackageConfigHelpers)
set(package_dir ${CMAKE_INSTALL_LIBDIR}/cmake/fielddeform)

install(TARGETS fielddeform EXPORT fielddeformTargets
  ARCHIVE DESTINATION ${CMAKE_INSTALL_LIBDIR} LIBRARY DESTINATION ${CMAKE_INSTALL_LIBDIR}
  RUNTIME DESTINATION ${CMAKE_INSTALL_BINDIR})
install(DIRECTORY ${PROJECT_SOURCE_DIR}/fielddeform ${PROJECT_BINARY_DIR}/generated/fielddeform
  DESTINATION ${CMAKE_INSTALL_INCLUDEDIR} FILES_MATCHING PATTERN "*.h" PATTERN detail EXCLUDE)
install(EXPORT fielddeformTargets NAMESPACE fielddeform:: DESTINATION ${package_dir})

configure_package_config_file(fielddeformConfig.cmake.in ${PROJECT_BINARY_DIR}/fielddeformConfig.cmake
  INSTALL_DESTINATION ${package_dir})
write_basic_package_version_file(${PROJECT_BINARY_DIR}/fielddeformConfigVersion.cmake
  COMPATIBILITY SameMinorVersion)
install(FILES find_openvdb.cmake ${PROJECT_BINARY_DIR}/fielddeformConfig.cmake ${PROJECT_BINARY_DIR}/fielddeformConfigVersion.cmake
  DESTINATION ${package_dir})
