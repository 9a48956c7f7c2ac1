# cmake -DBUILD=<build tree> -DSOURCE=<this folder> -DWORK=<scratch folder> -DGENERATOR=... -P run.cmake
# Installs the package into a scratch folder, builds the consumer against it, and runs program and consumer.
cmake_minimum_required(VERSION 3.20)

function(run)
  execute_process(COMMAND ${ARGV} RESULT_VARIABLE code OUTPUT_VARIABLE output ERROR_VARIABLE output)
  if(NOT code EQUAL 0)
    message(FATAL_ERROR "${ARGV}: ${code}\n${output}")
  endif()
  set(output ${output} PARENT_SCOPE)
endfunction()

file(REMOVE_RECURSE ${WORK})
run(${CMAKE_COMMAND} --install ${BUILD} --prefix ${WORK}/installed)
file(GLOB_RECURSE internal ${WORK}/installed/include/*/detail/*)
if(internal)
  message(FATAL_ERROR "internal headers are installed: ${internal}")
endif()
run(${CMAKE_COMMAND} -S ${SOURCE} -B ${WORK}/build -G ${GENERATOR} -DCMAKE_BUILD_TYPE=Release
    -DCMAKE_PREFIX_PATH=${WORK}/installed)
run(${CMAKE_COMMAND} --build ${WORK}/build)
run(${CMAKE_COMMAND} -E chdir ${WORK}/build ${WORK}/build/consumer)
message(STATUS "${output}")
if(PROGRAM)
  run(${WORK}/installed/bin/fielddeform --version)
  foreach(file man/man1/fielddeform.1 bash-completion/completions/fielddeform zsh/site-functions/_fielddeform
               fish/vendor_completions.d/fielddeform.fish)
    if(NOT EXISTS ${WORK}/installed/share/${file})
      message(FATAL_ERROR "not installed: share/${file}")
    endif()
  endforeach()
endif()
file(REMOVE_RECURSE ${WORK})
