// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include <catch2/catch.hpp>
#include <functional>

namespace pounce::test {

/// A child process that runs `work` and then waits to be killed. It says when `work` calls `ready`.
class Child {
 public:
  explicit Child(const std::function<void(const std::function<void()>& ready)>& work) {
    int ends[2];
    REQUIRE(::pipe(ends) == 0);
    pid_ = ::fork();
    REQUIRE(pid_ >= 0);
    if (pid_ == 0) {
      ::alarm(60);  // a child whose parent died must not stay
      try {
        work([&] { (void)!::write(ends[1], "r", 1); });
      } catch (...) {
        ::_exit(9);
      }
      for (;;) ::pause();
    }
    ::close(ends[1]);
    char letter = 0;
    ready_ = ::read(ends[0], &letter, 1) == 1;
    ::close(ends[0]);
  }
  ~Child() { kill_now(); }
  Child(const Child&) = delete;
  Child& operator=(const Child&) = delete;

  pid_t pid() const { return pid_; }
  bool ready() const { return ready_; }
  void kill_now() {
    if (pid_ <= 0) return;
    ::kill(pid_, SIGKILL);
    int status = 0;
    ::waitpid(pid_, &status, 0);
    pid_ = -1;
  }

 private:
  pid_t pid_ = -1;
  bool ready_ = false;
};

}  // namespace pounce::test
