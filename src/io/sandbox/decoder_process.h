// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <sys/types.h>

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "io/sandbox/messages.h"

namespace pounce::io {

/// A process that decodes images (serve_images()), from this side. When it crashes, hangs or takes
/// more than it may, that ends as an error of the image that it had. Not thread-safe: one image at
/// a time.
class DecoderProcess {
 public:
  /// Starts one, or takes one that is idle; null where there is no program to start, or where the
  /// kernel cannot confine it.
  static std::unique_ptr<DecoderProcess> take(bool with_module);
  /// For tests: starts this program from now on, and nothing that is idle.
  static void use_program(const std::string& path);
  /// For the next image.
  static void give_back(std::unique_ptr<DecoderProcess> process);

  ~DecoderProcess();
  DecoderProcess(const DecoderProcess&) = delete;
  DecoderProcess& operator=(const DecoderProcess&) = delete;

  /// Sends a request about the image of that label and waits for what comes back. `memory_bytes`
  /// and `work_bytes`: what it may take beside the program itself, and what it has to decode at
  /// most, for the time it may need. Throws the decoder's own errors; Error(input) where the
  /// process ended, did not answer, or took more than that.
  Message ask(const std::string& label, const Message& request, const std::vector<int>& descriptors,
              std::uint64_t memory_bytes, std::uint64_t work_bytes);
  /// False once it ended: it is of no use then.
  bool is_alive() const { return pid_ > 0; }

 private:
  DecoderProcess(pid_t pid, int socket, bool with_module)
      : pid_(pid), socket_(socket), with_module_(with_module) {}
  static std::unique_ptr<DecoderProcess> start(bool with_module);
  bool begin();
  void wait_for_answer(const std::string& label, std::uint64_t work_bytes);
  double cpu_seconds() const;
  [[noreturn]] void fail(const std::string& label, const std::string& why);
  std::string end();

  pid_t pid_ = -1;
  int socket_ = -1;
  bool with_module_ = false;
  std::uint64_t address_space_ = 0;  ///< of the program itself
};

}  // namespace pounce::io
