// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

namespace pounce::io {

/// Tells OpenImageIO once, for the whole process, what it cannot be told per file: that OpenEXR
/// starts no threads of its own (all threads live in flow/), and to accept every image size that
/// pounce accepts. Its own threads are turned off file by file, so the pool of a program that uses
/// it, too, stays as it is. Thread-safe; called before every use of the library.
void set_up_oiio();

/// An error text of OpenImageIO as part of one sentence: no line breaks, no full stop at its end.
std::string one_line(std::string message);

}  // namespace pounce::io
