# SPDX-License-Identifier: Apache-2.0
include(CMakePackageConfigHelpers)
install(TARGETS pounce EXPORT pounceTargets
        LIBRARY DESTINATION ${CMAKE_INSTALL_LIBDIR}
        ARCHIVE DESTINATION ${CMAKE_INSTALL_LIBDIR}
        FILE_SET HEADERS)
# Opened and started when a file needs it, never linked.
install(TARGETS pounce_imageio pounce_decoder
        LIBRARY DESTINATION ${CMAKE_INSTALL_LIBDIR}/pounce RUNTIME DESTINATION ${CMAKE_INSTALL_LIBDIR}/pounce)
install(EXPORT pounceTargets NAMESPACE pounce::
        DESTINATION ${CMAKE_INSTALL_LIBDIR}/cmake/pounce)
configure_package_config_file(${PROJECT_SOURCE_DIR}/cmake/pounceConfig.cmake.in
  ${PROJECT_BINARY_DIR}/pounceConfig.cmake
  INSTALL_DESTINATION ${CMAKE_INSTALL_LIBDIR}/cmake/pounce)
write_basic_package_version_file(${PROJECT_BINARY_DIR}/pounceConfigVersion.cmake
  COMPATIBILITY SameMinorVersion)
install(FILES ${PROJECT_BINARY_DIR}/pounceConfig.cmake
              ${PROJECT_BINARY_DIR}/pounceConfigVersion.cmake
              ${PROJECT_SOURCE_DIR}/cmake/FindDraco.cmake
              ${PROJECT_SOURCE_DIR}/cmake/FindOpenEXR.cmake
              ${PROJECT_SOURCE_DIR}/cmake/FindWebP.cmake
        DESTINATION ${CMAKE_INSTALL_LIBDIR}/cmake/pounce)
if(TARGET pounce_cli)
  install(TARGETS pounce_cli RUNTIME DESTINATION ${CMAKE_INSTALL_BINDIR})
  # Where man and each shell look.
  set(generated ${PROJECT_BINARY_DIR}/generated)
  install(FILES ${generated}/pounce.1 DESTINATION ${CMAKE_INSTALL_MANDIR}/man1)
  install(FILES ${generated}/pounce DESTINATION ${CMAKE_INSTALL_DATADIR}/bash-completion/completions)
  install(FILES ${generated}/_pounce DESTINATION ${CMAKE_INSTALL_DATADIR}/zsh/site-functions)
  install(FILES ${generated}/pounce.fish DESTINATION ${CMAKE_INSTALL_DATADIR}/fish/vendor_completions.d)
endif()
