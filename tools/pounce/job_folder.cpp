// SPDX-License-Identifier: Apache-2.0
#include "job_folder.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/resource.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <chrono>
#include <csignal>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <utility>

#include "pounce/error.h"
#include "pounce/version.h"
#include "terminal.h"

namespace pounce::cli {
namespace {

using Json = nlohmann::ordered_json;

constexpr double kSayEvery_s = 5;
/// Who has said nothing for so long is gone: a busy file system may take a minute.
constexpr double kLostAfter_s = 120;

[[noreturn]] void cannot(const std::string& what, const std::string& path, int reason) {
  throw Error(ErrorKind::storage, fmt::format("{}: {}: {}", path, what, std::strerror(reason)),
              may_pass(reason));
}

std::optional<std::string> read_if_there(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  if (!file) {
    if (errno == ENOENT) return std::nullopt;
    cannot("cannot read", path, errno);
  }
  std::string text;
  char some[1 << 14];
  errno = 0;
  // By the stream, not its buffer, which would throw the library's own words.
  while (file.read(some, sizeof some), file.gcount() > 0)
    text.append(some, static_cast<std::size_t>(file.gcount()));
  if (file.bad()) cannot("cannot read", path, errno != 0 ? errno : EIO);
  return text;
}

Json json_of(const OptionReport& option) {
  if (option.is_list) return option.values;
  return option.values.empty() ? Json("") : Json(option.values.front());
}

/// What a job is: its options but those of the machine, which may differ from task to task.
Json options_of(const std::vector<OptionReport>& options) {
  Json made = Json::object();
  for (const OptionReport& option : options) made[option.name] = json_of(option);
  return made;
}

std::vector<std::string> resource_names() {
  std::vector<std::string> names;
  for (const OptionInfo& info : option_table(JobCommand::transfer)) {
    if (info.group.starts_with("Resources")) names.push_back(info.name);
  }
  return names;
}

Json without_resources(Json options) {
  for (const std::string& name : resource_names()) options.erase(name);
  return options;
}

template <class Value>
Value value_of(const Json& json, const char* name, Value otherwise) {
  const auto at = json.find(name);
  if (at == json.end()) return otherwise;
  try {
    return at->template get<Value>();
  } catch (const Json::exception&) {
    return otherwise;
  }
}

double cpu_seconds() {
  double sum = 0;
  for (const int who : {RUSAGE_SELF, RUSAGE_CHILDREN}) {
    rusage usage = {};
    getrusage(who, &usage);
    for (const timeval& time : {usage.ru_utime, usage.ru_stime})
      sum += static_cast<double>(time.tv_sec) + static_cast<double>(time.tv_usec) / 1e6;
  }
  return sum;
}

std::uint64_t most_resident_bytes() {
  rusage usage = {};
  getrusage(RUSAGE_SELF, &usage);
  return static_cast<std::uint64_t>(usage.ru_maxrss) * 1024;
}

/// A file or folder. What cannot be synced, as some network folders, has nothing to promise.
void sync(const std::filesystem::path& path) {
  const auto again = [](auto&& call) {
    int result = call();
    while (result < 0 && errno == EINTR) result = call();
    return result;
  };
  const int fd = again([&] { return ::open(path.c_str(), O_RDONLY | O_CLOEXEC); });
  const int reason = fd < 0 || again([&] { return ::fsync(fd); }) < 0 ? errno : 0;
  if (fd >= 0) ::close(fd);
  if (reason != 0 && reason != EINVAL && reason != EACCES)
    cannot("cannot write to the disk", path.string(), reason);
}

std::string draft_prefix(const std::filesystem::path& path) {
  return "." + path.filename().string() + ".";
}

std::string scheduler_name() {
  const auto value = [](const char* name) {
    const char* text = std::getenv(name);
    return std::string(text == nullptr ? "" : text);
  };
  if (const std::string job = value("SLURM_ARRAY_JOB_ID"); !job.empty())
    return "slurm " + job + "_" + value("SLURM_ARRAY_TASK_ID");
  if (const std::string job = value("SLURM_JOB_ID"); !job.empty()) return "slurm " + job;
  if (const std::string job = value("AWS_BATCH_JOB_ID"); !job.empty()) return "batch " + job;
  return "";
}

}  // namespace

std::string host_name() {
  std::array<char, 256> name{};
  if (gethostname(name.data(), name.size() - 1) != 0) return "this host";
  // Nodes that are one machine, as in tests, know their names from their scheduler.
  const char* node = std::getenv("SLURMD_NODENAME");
  return node != nullptr ? node : name.data();
}

double seconds_now() {
  return std::chrono::duration<double>(std::chrono::system_clock::now().time_since_epoch()).count();
}

// --- what the job is -----------------------------------------------------------------------------

bool JobFolder::has_job() const { return std::filesystem::exists(job_path()); }

std::uint32_t JobFolder::tasks() const {
  const auto text = read_if_there(job_path());
  if (!text)
    throw Error(ErrorKind::storage, path_ + ": is no job folder: there is no job.json in it");
  const auto tasks = value_of<std::uint64_t>(Json::parse(*text, nullptr, false), "tasks", 0);
  if (tasks < 1 || tasks > kMostTasks)
    throw Error(ErrorKind::input, job_path() + ": does not state how many tasks share the job");
  return static_cast<std::uint32_t>(tasks);
}

void JobFolder::be_for(const std::string& command, const std::vector<OptionReport>& options,
                       std::uint32_t tasks) const {
  const Json mine = options_of(options);
  const auto there = read_if_there(job_path());
  sweep_drafts("job.json");
  if (!there) {
    const Json job{
        {"version", POUNCE_VERSION}, {"command", command}, {"tasks", tasks}, {"options", mine}};
    return write("job.json", job.dump(2, ' ', false, Json::error_handler_t::replace) + "\n");
  }
  const Json job = Json::parse(*there, nullptr, false);
  if (!job.is_object())
    throw Error(ErrorKind::input, job_path() + ": is damaged; remove it, and run this again");
  const bool is_same = value_of<std::string>(job, "command", "") == command &&
                       job.contains("options") && job["options"].is_object() &&
                       without_resources(job["options"]) == without_resources(mine);
  if (!is_same)
    throw Error(
        ErrorKind::usage,
        path_ +
            ": is the folder of another job (job.json); use another folder, or remove this one");
  if (value_of<std::uint64_t>(job, "tasks", 0) == tasks) return;
  throw Error(ErrorKind::usage,
              fmt::format("{}: {} tasks share this job, not {}; use another folder for another "
                          "number",
                          path_, value_of<std::uint64_t>(job, "tasks", 0), tasks));
}

std::optional<std::string> JobFolder::read(const std::string& name) const {
  return read_if_there(path_ + "/" + name);
}

void JobFolder::write(const std::string& name, const std::string& text) const {
  replace(name, text, true);
}

void JobFolder::replace(const std::string& name, const std::string& text, bool synced) const {
  const std::filesystem::path path = std::filesystem::path(path_) / name;
  std::error_code failed;
  std::filesystem::create_directories(path.parent_path(), failed);
  if (failed) cannot("cannot create the folder", path.parent_path().string(), failed.value());
  // Of this process alone: two may write the same.
  const std::filesystem::path draft =
      path.parent_path() / fmt::format("{}{}.{}", draft_prefix(path), host_name(), getpid());
  std::ofstream file(draft, std::ios::binary | std::ios::trunc);
  file << text;
  file.close();
  if (!file) {
    const int reason = errno;
    std::filesystem::remove(draft, failed);
    cannot("cannot write", path.string(), reason);
  }
  if (synced) sync(draft);
  std::filesystem::rename(draft, path, failed);
  if (!failed) {
    if (synced) sync(path.parent_path());
    return;
  }
  const int reason = failed.value();
  std::filesystem::remove(draft, failed);
  cannot("cannot write", path.string(), reason);
}

// A living process of another container that loses its own at that moment says so and goes on.
void JobFolder::sweep_drafts(const std::string& name) const {
  const std::filesystem::path path = std::filesystem::path(path_) / name;
  const std::string prefix = draft_prefix(path) + host_name() + ".";
  std::error_code failed;
  for (std::filesystem::directory_iterator entry(path.parent_path(), failed), end;
       !failed && entry != end; entry.increment(failed)) {
    const std::string found = entry->path().filename().string();
    if (!found.starts_with(prefix)) continue;
    const auto process = static_cast<pid_t>(std::atol(found.c_str() + prefix.size()));
    std::error_code ignored;
    if (process > 0 && ::kill(process, 0) != 0 && errno == ESRCH)
      std::filesystem::remove(entry->path(), ignored);
  }
}

// --- how its tasks stand -------------------------------------------------------------------------

void JobFolder::save(const TaskState& state) const {
  const Json json{{"task", state.name},
                  {"state", state.state},
                  {"host", state.host},
                  {"process", state.process},
                  {"scheduler", state.scheduler},
                  {"begun", state.begun_s},
                  {"seen", state.seen_s},
                  {"fraction", state.fraction},
                  {"stage", state.stage},
                  {"peak_rss_bytes", state.resident_bytes},
                  {"cpu_s", state.cpu_s},
                  {"texels", state.texels},
                  {"covered", state.covered},
                  {"outputs", state.outputs},
                  {"exit_status", state.exit_status},
                  {"message", state.message}};
  // A state that is lost is as one that was not written yet.
  replace("tasks/" + state.name + ".json",
          json.dump(2, ' ', false, Json::error_handler_t::replace) + "\n", false);
}

std::optional<TaskState> JobFolder::task(const std::string& name) const {
  const auto text = read_if_there(path_ + "/tasks/" + name + ".json");
  if (!text) return std::nullopt;
  const Json json = Json::parse(*text, nullptr, false);
  TaskState state;
  state.name = name;
  state.state = value_of<std::string>(json, "state", "missing");
  state.host = value_of<std::string>(json, "host", "");
  state.process = value_of<std::int64_t>(json, "process", 0);
  state.scheduler = value_of<std::string>(json, "scheduler", "");
  state.begun_s = value_of<double>(json, "begun", 0);
  state.seen_s = value_of<double>(json, "seen", 0);
  state.fraction = value_of<double>(json, "fraction", 0);
  state.stage = value_of<std::string>(json, "stage", "");
  state.resident_bytes = value_of<std::uint64_t>(json, "peak_rss_bytes", 0);
  state.cpu_s = value_of<double>(json, "cpu_s", 0);
  state.texels = value_of<std::uint64_t>(json, "texels", 0);
  state.covered = value_of<std::uint64_t>(json, "covered", 0);
  state.outputs = value_of<std::uint64_t>(json, "outputs", 0);
  state.exit_status = value_of<int>(json, "exit_status", 0);
  state.message = value_of<std::string>(json, "message", "");
  return state;
}

TaskState JobFolder::look_at(const std::string& name) const {
  TaskState state = task(name).value_or(TaskState{});
  if (state.state.empty()) {
    state.name = name;
    state.state = "missing";
  }
  if (state.state != "running" && state.state != "missing") return state;
  // A script that saw it end says how (docs/farm.md); nobody else could.
  if (const auto status = read_if_there(path_ + "/tasks/" + name + ".exit")) {
    state.state = "failed";
    state.exit_status = std::atoi(status->c_str());
    state.message =
        state.exit_status == 137 ? "killed, for memory perhaps" : "ended without a word";
  } else if (state.state == "running" && seconds_now() - state.seen_s > kLostAfter_s) {
    state.state = "lost";
    state.message = fmt::format("no sign of life for {:.0f} s", seconds_now() - state.seen_s);
  }
  return state;
}

void JobFolder::forget(const std::string& name) const {
  std::error_code ignored;
  std::filesystem::remove(path_ + "/tasks/" + name + ".json", ignored);
  std::filesystem::remove(path_ + "/tasks/" + name + ".exit", ignored);
}

TaskLog::TaskLog(JobFolder folder, std::string name) : folder_(std::move(folder)) {
  const auto before = folder_.task(name);
  is_again_ = before && before->state == "done";
  folder_.sweep_drafts("tasks/" + name + ".json");
  if (!is_again_) folder_.forget(name);
  state_.name = std::move(name);
  state_.state = "running";
  state_.host = host_name();
  state_.process = getpid();
  state_.scheduler = scheduler_name();
  state_.begun_s = seconds_now();
  save();
}

void TaskLog::save() {
  state_.seen_s = saved_s_ = seconds_now();
  state_.resident_bytes = most_resident_bytes();
  state_.cpu_s = cpu_seconds();
  if (is_again_ && state_.state != "done") return;
  try {
    folder_.save(state_);
  } catch (const Error& error) {
    // The work goes on: what it makes counts, not what is said of it.
    if (!is_told_) write_stderr(fmt::format("pounce: warning: {}\n", visible_line(error.what())));
    is_told_ = true;
  }
}

void TaskLog::event(const ProgressEvent& event) {
  state_.fraction = event.fraction;
  state_.stage = event.stage;
  if (seconds_now() - saved_s_ >= kSayEvery_s) save();
}

void TaskLog::end(const Report& report, int exit_status, const std::string& message) {
  const bool is_stopped =
      exit_status == pounce::exit_status(ErrorKind::cancelled) || exit_status == kTerminated;
  state_.state = exit_status == 0 ? "done" : is_stopped ? "stopped" : "failed";
  state_.texels = report.target_texels;
  state_.covered = report.target_covered;
  state_.outputs = report.outputs.size();
  if (exit_status == 0) state_.fraction = 1;
  state_.exit_status = exit_status;
  state_.message = message;
  save();
}

}  // namespace pounce::cli
