# SPDX-License-Identifier: Apache-2.0
# Debian's package has no CMake config.
find_path(OpenColorIO_INCLUDE_DIR OpenColorIO/OpenColorIO.h)
find_library(OpenColorIO_LIBRARY OpenColorIO)
include(FindPackageHandleStandardArgs)
find_package_handle_standard_args(OpenColorIO REQUIRED_VARS
  OpenColorIO_LIBRARY OpenColorIO_INCLUDE_DIR)
if(OpenColorIO_FOUND AND NOT TARGET OpenColorIO::OpenColorIO)
  add_library(OpenColorIO::OpenColorIO UNKNOWN IMPORTED)
  set_target_properties(OpenColorIO::OpenColorIO PROPERTIES
    IMPORTED_LOCATION ${OpenColorIO_LIBRARY}
    INTERFACE_INCLUDE_DIRECTORIES ${OpenColorIO_INCLUDE_DIR})
endif()
