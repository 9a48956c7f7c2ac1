# A function of its own: OpenVDB's find module sets variables of whoever calls it, BUILD_SHARED_LIBS among them.
function(fielddeform_find_openvdb)
  # Debian keeps the module beside the library.
  list(APPEND CMAKE_MODULE_PATH "/usr/lib/${CMAKE_LIBRARY_ARCHITECTURE}/cmake/OpenVDB")
  find_package(OpenVDB 10.0 REQUIRED COMPONENTS openvdb)
endfunction()
fielddeform_find_openvdb()
