# SPDX-License-Identifier: Apache-2.0
# Debian's own OpenEXR config wants the programs of another package; this does not.
find_path(OpenEXR_INCLUDE_DIR OpenEXR/ImfHeader.h)
find_path(Imath_INCLUDE_DIR Imath/half.h)
set(OpenEXR_found_libraries)
foreach(name OpenEXR Imath Iex IlmThread)
  find_library(OpenEXR_${name}_LIBRARY NAMES ${name} ${name}-3_1)
  list(APPEND OpenEXR_found_libraries ${OpenEXR_${name}_LIBRARY})
endforeach()
include(FindPackageHandleStandardArgs)
find_package_handle_standard_args(OpenEXR REQUIRED_VARS OpenEXR_OpenEXR_LIBRARY OpenEXR_Imath_LIBRARY
  OpenEXR_Iex_LIBRARY OpenEXR_IlmThread_LIBRARY OpenEXR_INCLUDE_DIR Imath_INCLUDE_DIR)
if(OpenEXR_FOUND AND NOT TARGET OpenEXR::OpenEXR)
  add_library(OpenEXR::OpenEXR UNKNOWN IMPORTED)
  list(REMOVE_ITEM OpenEXR_found_libraries ${OpenEXR_OpenEXR_LIBRARY})
  # Its headers include each other as those of their own folder.
  set_target_properties(OpenEXR::OpenEXR PROPERTIES
    IMPORTED_LOCATION ${OpenEXR_OpenEXR_LIBRARY}
    INTERFACE_INCLUDE_DIRECTORIES
      "${OpenEXR_INCLUDE_DIR};${OpenEXR_INCLUDE_DIR}/OpenEXR;${Imath_INCLUDE_DIR};${Imath_INCLUDE_DIR}/Imath"
    INTERFACE_LINK_LIBRARIES "${OpenEXR_found_libraries}")
endif()
