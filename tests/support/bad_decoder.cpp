// SPDX-License-Identifier: Apache-2.0
//
// A decoder's process whose decoders do what a stranger's file may make them do: which of it, the
// image's label says. What confines it is the real thing.
#include <fcntl.h>
#include <sys/socket.h>
#include <unistd.h>

#include <csignal>
#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <thread>
#include <vector>

#include "io/sandbox/serve.h"
#include "pounce/error.h"

using namespace pounce;

namespace {

/// Writes where nothing is, which no compiler can know.
void crash() {
  volatile std::uintptr_t nowhere = 16;
  *reinterpret_cast<volatile int*>(nowhere) = 1;
}

void loop() {
  volatile bool on = true;
  while (on) {
  }
}

/// Of 4 x 4 texels, whose rows come or not.
class BadRows : public io::RowDecoder {
 public:
  explicit BadRows(std::string how) : how_(std::move(how)) {}
  void read_rows(std::uint32_t, std::uint32_t count, std::byte* rows) override {
    if (how_ == "rows-crash") crash();
    if (how_ == "rows-loop") loop();
    std::memset(rows, 7, std::size_t{count} * 4);
  }

 private:
  std::string how_;
};

/// Memory that is used, 4 GiB of it.
void allocate_much() {
  std::vector<std::vector<char>> blocks;
  for (int i = 0; i < 64; ++i) blocks.emplace_back(std::size_t{64} << 20, static_cast<char>(i + 1));
}

/// None of these comes back.
void try_system(const std::string& how) {
  if (how == "open") open("/etc/hostname", O_RDONLY);
  if (how == "create") open("/tmp/pounce-bad-decoder", O_CREAT | O_WRONLY, 0600);
  if (how == "network") socket(AF_INET, SOCK_STREAM, 0);
  if (how == "fork") fork();
  if (how == "exec") execl("/bin/true", "true", nullptr);
  if (how == "thread") std::thread([] {}).join();
  if (how == "kill") kill(getppid(), 0);
}

std::unique_ptr<io::RowDecoder> open_badly(io::ByteSource& bytes, const io::WantedChannels&,
                                           io::ImageInfo& info) {
  const std::string how = bytes.label();
  try_system(how);
  if (how == "crash") crash();
  if (how == "abort") std::abort();
  if (how == "end") _exit(0);
  if (how == "loop") loop();
  if (how == "allocate") allocate_much();
  if (how == "refuse") throw Error(ErrorKind::input, "refuse: the file is damaged");
  info.width = info.height = how == "too-wide" ? 70000 : 4;
  info.channels = how == "no-channels" ? 0 : 1;
  info.names = {"Y"};
  return std::make_unique<BadRows>(how);
}

}  // namespace

int main() { return io::serve_images(0, false, open_badly); }
