# SPDX-License-Identifier: Apache-2.0
# pounce_unity(TARGET [ALONE files...]): where POUNCE_UNITY_BUILD is on, the sources of a folder are compiled together.
# Most of the compiler's time goes into what all of them include. ALONE names those whose unnamed namespaces have a name
# that another of their folder has, too. A source with options of its own is compiled alone as well.
function(pounce_unity target)
  cmake_parse_arguments(PARSE_ARGV 1 U "" "" "ALONE")
  get_target_property(sources ${target} SOURCES)
  foreach(source ${sources})
    set(name ${source})  # those of a subdirectory are absolute
    cmake_path(ABSOLUTE_PATH name)
    cmake_path(RELATIVE_PATH name)
    if(name IN_LIST U_ALONE)
      list(REMOVE_ITEM U_ALONE ${name})
    else()
      get_filename_component(folder ${name} DIRECTORY)
      string(MAKE_C_IDENTIFIER "in_${folder}" group)
      set_source_files_properties(${source} TARGET_DIRECTORY ${target} PROPERTIES UNITY_GROUP ${group})
    endif()
  endforeach()
  if(U_ALONE)
    message(FATAL_ERROR "pounce_unity: ${target} has no ${U_ALONE}")
  endif()
  set_target_properties(${target} PROPERTIES UNITY_BUILD ${POUNCE_UNITY_BUILD} UNITY_BUILD_MODE GROUP)
endfunction()
