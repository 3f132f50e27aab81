// SPDX-License-Identifier: Apache-2.0
//
// What a decoder may do once it sees a stranger's bytes: read the file that it was given, take and
// return memory that holds no code, answer. Whatever else it asks the kernel for ends it.
//
// New memory is filled with one and the same byte (M_PERTURB): what a decoder hands out of memory
// that nobody wrote is the same in every run, and nothing of another image.
#include "io/sandbox/serve.h"

#include <malloc.h>
#include <seccomp.h>
#include <sys/mman.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <unistd.h>

#include <array>
#include <climits>
#include <csignal>
#include <cstdio>
#include <exception>
#include <memory>
#include <new>

#include "core/page_pool.h"
#include "io/codec/row_decoder.h"
#include "io/codec/sample.h"
#include "io/files/asset_file.h"
#include "io/foreign/module.h"
#include "io/sandbox/messages.h"
#include "pounce/error.h"

namespace pounce::io {
namespace {

#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
#define POUNCE_HAS_SANITIZER 1
#elif defined(__has_feature)
#if __has_feature(address_sanitizer) || __has_feature(thread_sanitizer) || \
    __has_feature(memory_sanitizer)
#define POUNCE_HAS_SANITIZER 1
#endif
#endif

/// False where this kernel cannot, and with sanitizers, which ask the system for more: then they
/// look at the decoders in the job itself.
bool enter_sandbox() {
#ifdef POUNCE_HAS_SANITIZER
  return false;
#else
  const std::unique_ptr<void, void (*)(scmp_filter_ctx)> filter(seccomp_init(SCMP_ACT_KILL_PROCESS),
                                                                seccomp_release);
  if (!filter || prctl(PR_SET_NO_NEW_PRIVS, 1, 0, 0, 0) != 0) return false;
  // sysinfo: the C library's qsort asks once how much memory there is.
  constexpr std::array kAllowed{
      SCMP_SYS(read),         SCMP_SYS(pread64),      SCMP_SYS(lseek),
      SCMP_SYS(recvmsg),      SCMP_SYS(recvfrom),     SCMP_SYS(sendmsg),
      SCMP_SYS(sendto),       SCMP_SYS(close),        SCMP_SYS(munmap),
      SCMP_SYS(mremap),       SCMP_SYS(brk),          SCMP_SYS(madvise),
      SCMP_SYS(futex),        SCMP_SYS(exit),         SCMP_SYS(exit_group),
      SCMP_SYS(gettid),       SCMP_SYS(getpid),       SCMP_SYS(tgkill),
      SCMP_SYS(rt_sigreturn), SCMP_SYS(rt_sigaction), SCMP_SYS(clock_gettime),
      SCMP_SYS(sched_yield),  SCMP_SYS(sysinfo),      SCMP_SYS(rt_sigprocmask)};
  // Of all threads: OpenImageIO has some that wait.
  bool allowed = seccomp_attr_set(filter.get(), SCMP_FLTATR_CTL_TSYNC, 1) == 0;
  for (const int call : kAllowed)
    allowed = allowed && seccomp_rule_add(filter.get(), SCMP_ACT_ALLOW, call, 0) == 0;
  for (const int call : {SCMP_SYS(mmap), SCMP_SYS(mprotect)}) {
    allowed = allowed && seccomp_rule_add(filter.get(), SCMP_ACT_ALLOW, call, 1,
                                          SCMP_A2(SCMP_CMP_MASKED_EQ, PROT_EXEC, 0)) == 0;
  }
  return allowed && seccomp_load(filter.get()) == 0;
#endif
}

/// An image that is open, and where its rows go.
class OpenImage {
 public:
  OpenImage(const Message& request, int file)
      : bytes_(request.at("label").get<std::string>(), request.at("path").get<std::string>(), file,
               request.at("offset").get<std::uint64_t>(), request.at("size").get<std::uint64_t>()) {
    request.at("format").get_to(info_.format);
  }
  ~OpenImage() {
    if (rows_ != nullptr) munmap(rows_, rows_bytes_);
  }
  OpenImage(const OpenImage&) = delete;
  OpenImage& operator=(const OpenImage&) = delete;

  Message open(const Message& request, ImageOpener& opener) {
    decoder_ = opener(bytes_, wanted_from(request.at("wanted")), info_);
    return to_message(info_);
  }
  Message list() { return {{"names", exr_channel_names(bytes_)}}; }

  void take_buffer(int descriptor, std::size_t bytes) {
    void* const at = mmap(nullptr, bytes, PROT_READ | PROT_WRITE, MAP_SHARED, descriptor, 0);
    close(descriptor);
    if (at == MAP_FAILED) throw std::bad_alloc();
    rows_ = at;
    rows_bytes_ = bytes;
  }
  Message read(const Message& request) {
    const auto first = request.at("first").get<std::uint32_t>();
    const auto count = request.at("count").get<std::uint32_t>();
    const std::uint64_t row =
        std::uint64_t{info_.width} * info_.channels * sample_bytes(info_.depth);
    if (decoder_ == nullptr || row * count > rows_bytes_)
      throw Error(ErrorKind::internal, "rows were asked for that have no place");
    decoder_->read_rows(first, count, static_cast<std::byte*>(rows_));
    bytes_.check();
    return Message::object();
  }

 private:
  ByteSource bytes_;
  ImageInfo info_;
  std::unique_ptr<RowDecoder> decoder_;
  void* rows_ = nullptr;
  std::size_t rows_bytes_ = 0;
};

/// What a request asks for. `descriptors` are its own.
Message answer(const Message& request, const std::vector<int>& descriptors, ImageOpener& opener,
               std::unique_ptr<OpenImage>& image) {
  const std::string what = request.at("what").get<std::string>();
  if (what == "open" || what == "list") {
    image.reset();
    image = std::make_unique<OpenImage>(request, descriptors.at(0));
    return what == "open" ? image->open(request, opener) : image->list();
  }
  if (what == "close") {
    image.reset();
    return Message::object();
  }
  if (image == nullptr) throw Error(ErrorKind::internal, "no image is open");
  if (!descriptors.empty())
    image->take_buffer(descriptors.front(), request.at("buffer_bytes").get<std::size_t>());
  return image->read(request);
}

Message error_message(ErrorKind kind, const std::string& what) {
  return {{"error", static_cast<int>(kind)}, {"text", what}};
}

/// Its own, as the limits of memory count.
std::uint64_t address_space_bytes() {
  unsigned long pages = 0;
  if (FILE* const file = std::fopen("/proc/self/statm", "r")) {
    if (std::fscanf(file, "%lu", &pages) != 1) pages = 0;
    std::fclose(file);
  }
  return std::uint64_t{pages} * static_cast<std::uint64_t>(sysconf(_SC_PAGESIZE));
}

}  // namespace

int serve_images(int socket, bool with_module, ImageOpener& opener) {
  close_range(3, UINT_MAX, 0);  // whatever the job has open that is not marked
  const rlimit no_core{0, 0};
  setrlimit(RLIMIT_CORE, &no_core);
  mallopt(M_PERTURB, 0xA5);
  mallopt(M_ARENA_MAX, 1);
  try {
    if (with_module) foreign_module("images are");
    const std::uint64_t space = address_space_bytes();
    PageVector<std::byte>(1);  // the pool asks the system about huge pages, which it may now
    const bool is_confined = enter_sandbox();
    send_message(socket, {{"confined", is_confined}, {"address_space", space}});
    std::unique_ptr<OpenImage> image;
    for (;;) {
      std::vector<int> descriptors;
      const auto request = receive_message(socket, descriptors);
      if (!request) return 0;
      Message reply;
      try {
        reply = answer(*request, descriptors, opener, image);
      } catch (const Error& e) {
        reply = error_message(e.kind(), e.what());
      } catch (const std::bad_alloc&) {
        reply = {{"no_memory", true}};
      }
      send_message(socket, reply);
    }
  } catch (const std::exception&) {
    return 1;  // the other side finds the socket closed
  }
}

}  // namespace pounce::io
