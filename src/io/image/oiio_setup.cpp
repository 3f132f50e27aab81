// SPDX-License-Identifier: Apache-2.0
#include "io/image/oiio_setup.h"

#include <OpenImageIO/imageio.h>

#include <mutex>

namespace pounce::io {

void set_up_oiio() {
  static std::once_flag once;
  std::call_once(once, [] {
    OIIO::attribute("exr_threads", -1);      // -1: none at all; it has no setting per file
    OIIO::attribute("tiff:multithread", 0);  // its readers ask no file either
    // What nobody asked for it would put on the standard error output, between lines of ours.
    OIIO::attribute("oiio:print_uncaught_errors", 0);
    OIIO::attribute("limits:imagesize_MB", 0);  // no limit: we never allocate by what a header says
  });
}

std::string one_line(std::string message) {
  while (!message.empty() &&
         (message.back() == '\n' || message.back() == '.' || message.back() == ' ')) {
    message.pop_back();
  }
  for (std::size_t at = 0; (at = message.find('\n', at)) != std::string::npos;)
    message.replace(at, 1, "; ");
  return message;
}

}  // namespace pounce::io
