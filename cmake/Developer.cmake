# SPDX-License-Identifier: Apache-2.0
# What the project's own targets need and users of the package must not inherit.
add_library(pounce_developer INTERFACE)
target_compile_features(pounce_developer INTERFACE cxx_std_20)
target_compile_options(pounce_developer INTERFACE
  -Wall -Wextra -Wshadow -Wconversion -Wpedantic
  $<$<CXX_COMPILER_ID:GNU>:-Wno-restrict>  # GCC 12 sees overlaps inside std::string that are not there (bug 105651)
  # The same bytes on every x86-64: never fuse a multiply and an add behind our back.
  -ffp-contract=off
  # A shared libpounce may inline its own functions: nobody replaces them at load time.
  -fno-semantic-interposition)
if(POUNCE_UNITY_BUILD)
  # The first two are about the unnamed namespaces of other files then, the others are GCC's bug again. The preset `dev`
  # compiles each file alone, with all warnings.
  target_compile_options(pounce_developer INTERFACE
    -Wno-shadow $<$<CXX_COMPILER_ID:GNU>:-Wno-subobject-linkage;-Wno-stringop-overflow;-Wno-array-bounds>)
endif()
if(POUNCE_SANITIZE)
  # vptr off: TBB's flow graph downcasts trip it inside TBB's own headers.
  target_compile_options(pounce_developer INTERFACE
    -fsanitize=${POUNCE_SANITIZE} -fno-sanitize=vptr -fno-omit-frame-pointer)
  target_link_options(pounce_developer INTERFACE -fsanitize=${POUNCE_SANITIZE})
endif()
