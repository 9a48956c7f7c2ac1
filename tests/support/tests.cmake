# fielddeform_add_tests(NAME SOURCE... [LIBRARIES LIB...])
# One executable a folder; every test is found one by one. The label comes from the suite's name:
# suites that end in "Slow" are slow, in "Real" read the meshes of FIELDDEFORM_TEST_MESHES, all others are fast.
function(fielddeform_add_tests name)
  cmake_parse_arguments(arg "" "" "LIBRARIES" ${ARGN})
  add_executable(${name} ${arg_UNPARSED_ARGUMENTS})
  target_include_directories(${name} PRIVATE ${PROJECT_SOURCE_DIR})
  target_link_libraries(${name} PRIVATE fielddeform::fielddeform fielddeform_compile_options
                        ${arg_LIBRARIES} GTest::gtest GTest::gtest_main)
  set(common WORKING_DIRECTORY ${CMAKE_CURRENT_BINARY_DIR} DISCOVERY_TIMEOUT 60)
  gtest_discover_tests(${name} ${common} TEST_FILTER "-*Slow.*:*Real.*" PROPERTIES LABELS fast TIMEOUT 300)
  gtest_discover_tests(${name} ${common} TEST_FILTER "*Slow.*" TEST_LIST ${name}_slow PROPERTIES LABELS slow TIMEOUT 1200)
  gtest_discover_tests(${name} ${common} TEST_FILTER "*Real.*" TEST_LIST ${name}_real PROPERTIES LABELS real TIMEOUT 1200)
endfunction()
