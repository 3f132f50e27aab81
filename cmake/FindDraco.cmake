# SPDX-License-Identifier: Apache-2.0
# Debian's Draco has a tinygltf of its own in it, built otherwise than the one that is used here: in the shared library
# and in the archive. Whichever the linker met would be called by all. So this takes a copy of the archive without it.
find_path(Draco_INCLUDE_DIR draco/compression/decode.h)
find_library(Draco_LIBRARY libdraco.a)
include(FindPackageHandleStandardArgs)
find_package_handle_standard_args(Draco REQUIRED_VARS Draco_LIBRARY Draco_INCLUDE_DIR CMAKE_AR)
if(Draco_FOUND AND NOT TARGET Draco::Draco)
  set(copy ${CMAKE_BINARY_DIR}/draco/libdraco.a)
  configure_file(${Draco_LIBRARY} ${copy} COPYONLY)
  execute_process(COMMAND ${CMAKE_AR} d ${copy} tiny_gltf_utils.cc.o gltf_decoder.cc.o gltf_encoder.cc.o gltf_utils.cc.o
                  COMMAND_ERROR_IS_FATAL ANY)
  add_library(Draco::Draco STATIC IMPORTED)
  set_target_properties(Draco::Draco PROPERTIES
    IMPORTED_LOCATION ${copy}
    INTERFACE_INCLUDE_DIRECTORIES ${Draco_INCLUDE_DIR})
endif()
