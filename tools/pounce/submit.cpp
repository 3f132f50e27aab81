// SPDX-License-Identifier: Apache-2.0
//
// `pounce submit`: hands a job that tasks share to whoever runs them. Slurm gets three scripts, one
// after the other: prepare, an array of tasks, assemble. Others get a command a line.
//
// All state is in the job folder. Whoever submits again gets what is missing done, and nothing
// else: tasks that died of memory with twice as much, tasks that Slurm still has not at all.
#include <fcntl.h>
#include <fmt/format.h>
#include <fmt/ranges.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <filesystem>
#include <map>
#include <memory>
#include <nlohmann/json.hpp>
#include <set>
#include <sstream>

#include "commands.h"
#include "job_line.h"
#include "job_state.h"
#include "pounce/error.h"
#include "pounce/transfer.h"
#include "task_number.h"
#include "terminal.h"
#include "terms.h"

namespace pounce::cli {
namespace {

using Json = nlohmann::ordered_json;

constexpr std::uint64_t kMiB = 1 << 20;

struct SubmitLine : Line<TransferOptions> {
  std::string folder;
  std::string partition, max_running;
  std::uint64_t memory_bytes = 0;  ///< --mem
  double minutes = 0;              ///< --time
  bool dry_run = false;
};

constexpr const char* kSlurmUsage =
    "Usage: pounce submit slurm FOLDER [SOURCE TARGET... -o OUTPUT] [options] [-- SBATCH OPTIONS]\n"
    "\n"
    "Writes three scripts into FOLDER/slurm and submits them: prepare, an array of tasks, "
    "assemble. "
    "FOLDER\n"
    "must be where all nodes see it. Submitted again, without a job, it does what is missing, with "
    "twice\n"
    "the memory where a task died of that. See docs/farm.md.\n"
    "\n"
    "Examples:\n"
    "  pounce submit slurm job scan.glb hero.obj -o 'out/hero.<UDIM>.exr' --size 8192\n"
    "  pounce status job\n"
    "  pounce submit slurm job                       # again: what is missing\n"
    "  pounce submit slurm job --dry-run             # print the scripts\n"
    "  pounce submit slurm job --partition long -- --account=show --nice=100";

constexpr const char* kCommandsUsage =
    "Usage: pounce submit commands FOLDER [SOURCE TARGET... -o OUTPUT] [options]\n"
    "\n"
    "Prints commands, one a line, for any other way to run them: first prepare, then the tasks in "
    "any\n"
    "order and on any machine that sees FOLDER, last assemble. Of a job that was begun: what is "
    "missing.\n"
    "\n"
    "Example:\n"
    "  pounce submit commands job scan.glb hero.obj -o 'out/hero.<UDIM>.exr' --tasks 8 > job.txt\n"
    "  head -n 1 job.txt | sh && sed '1d;$d' job.txt | parallel -j 4 && tail -n 1 job.txt | sh";

std::string quoted(const std::string& text) {
  std::string word = "'";
  for (const char c : text) word += c == '\'' ? std::string("'\\''") : std::string(1, c);
  return word + "'";
}

std::string own_path() {
  std::error_code failed;
  const auto path = std::filesystem::read_symlink("/proc/self/exe", failed);
  return failed ? "pounce" : path.string();
}

// --- what is to be done --------------------------------------------------------------------------

struct Missing {
  std::vector<std::uint32_t> tasks;
  bool assemble = false;
};

Missing missing_of(const JobState& state, const std::set<std::uint32_t>& queued) {
  Missing missing;
  for (const TaskState& task : state.tasks) {
    const auto number = static_cast<std::uint32_t>(std::stoul(task.name));
    if (task.state != "done" && task.state != "running" && queued.count(number) == 0)
      missing.tasks.push_back(number);
  }
  missing.assemble = state.assemble.state != "done" || !missing.tasks.empty();
  return missing;
}

/// 1,2,3,7 -> "1-3,7".
std::string ranges(const std::vector<std::uint32_t>& sorted) {
  std::string text;
  for (std::size_t i = 0; i < sorted.size();) {
    std::size_t end = i + 1;
    while (end < sorted.size() && sorted[end] == sorted[end - 1] + 1) ++end;
    text += (text.empty() ? "" : ",") + std::to_string(sorted[i]);
    if (end - i > 1) text += "-" + std::to_string(sorted[end - 1]);
    i = end;
  }
  return text;
}

JobState untouched(std::uint32_t tasks) {
  JobState state;
  for (std::uint32_t task = 1; task <= tasks; ++task) {
    state.tasks.emplace_back();
    state.tasks.back().name = std::to_string(task);
    state.tasks.back().state = "missing";
  }
  return state;
}

/// Makes or checks the folder; the line's job, if it gives none, is the folder's.
JobState open_folder(SubmitLine& line, const JobFolder& folder, std::optional<Terms>& terms,
                     const std::string& own_cache) {
  terms = load_terms(folder);
  std::uint32_t tasks = folder.has_job() ? folder.tasks() : line.farm.tasks;
  if (!terms) {
    if (line.options.resources.use_cache && line.options.resources.cache_dir.empty())
      line.options.resources.cache_dir = own_cache;
    TransferOptions asked = line.options;
    if (asked.resources.memory_bytes == 0) asked.resources.memory_bytes = std::uint64_t{1} << 46;
    Report report;
    plan(asked, nullptr, &report);
    for (const std::string& warning : report.warnings)
      write_stderr(fmt::format("pounce: warning: {}\n", visible_line(warning)));
    terms = terms_of(line.options.resources, line.memory_bytes, report);
    if (tasks == 0) tasks = usual_tasks(report, terms->threads);
    terms->minutes = line.minutes > 0 ? line.minutes : usual_minutes(report, terms->threads, tasks);
  } else {
    if (line.memory_bytes > 0) terms->memory_bytes = line.memory_bytes;
    if (line.minutes > 0) terms->minutes = line.minutes;
  }
  if (line.farm.tasks != 0) tasks = line.farm.tasks;
  if (line.dry_run && !folder.has_job()) return untouched(tasks);
  folder.be_for(job_command_name(JobCommand::transfer), option_texts(line.options), tasks);
  return read_state(folder);
}

std::string command_of(const std::string& what, const JobFolder& folder, const Terms& terms,
                       const std::string& task) {
  const std::string own = quoted(own_path()), path = quoted(folder.path());
  const std::string rest =
      fmt::format(" --memory {} --threads {}", terms.budget_bytes, terms.threads);
  if (what == "assemble") return fmt::format("{} assemble {}{}", own, path, rest);
  if (what == "prepare") return fmt::format("{} prepare --job {}{}", own, path, rest);
  return fmt::format("{} transfer --job {} --task {}{}", own, path, task, rest);
}

int submit_commands(SubmitLine& line) {
  const JobFolder folder(std::filesystem::absolute(line.folder).lexically_normal().string());
  std::optional<Terms> terms;
  const JobState state = open_folder(line, folder, terms, folder.path() + "/cache");
  save(*terms, folder);
  const Missing missing = missing_of(state, {});
  const std::string here =
      fmt::format("cd {} && ", quoted(std::filesystem::current_path().string()));
  std::string text;
  if (!missing.tasks.empty()) text += here + command_of("prepare", folder, *terms, "") + "\n";
  for (const std::uint32_t task : missing.tasks)
    text += here +
            command_of("task", folder, *terms, fmt::format("{}/{}", task, state.tasks.size())) +
            "\n";
  if (missing.assemble) text += here + command_of("assemble", folder, *terms, "") + "\n";
  write_stdout(text);
  return 0;
}

// --- Slurm ---------------------------------------------------------------------------------------

struct Output {
  int status = 0;
  std::string text;
};

/// Runs a program and returns what it prints. Throws Error(usage) where there is none.
Output run_program(const std::vector<std::string>& words, bool shows_errors = true) {
  int pipes[2];
  if (pipe2(pipes, O_CLOEXEC) != 0)
    throw Error(ErrorKind::storage, fmt::format("{}: {}", words[0], std::strerror(errno)));
  std::vector<char*> arguments;
  for (const std::string& word : words) arguments.push_back(const_cast<char*>(word.c_str()));
  arguments.push_back(nullptr);
  const pid_t child = fork();
  if (child == 0) {
    dup2(pipes[1], STDOUT_FILENO);
    if (shows_errors) dup2(own_stderr_descriptor(), STDERR_FILENO);  // else nowhere: keep_stderr()
    execvp(arguments[0], arguments.data());
    _exit(127);
  }
  close(pipes[1]);
  Output output;
  char bytes[4096];
  for (ssize_t count = 0; (count = read(pipes[0], bytes, sizeof bytes)) != 0;) {
    if (count < 0 && errno != EINTR) break;
    if (count > 0) output.text.append(bytes, static_cast<std::size_t>(count));
  }
  close(pipes[0]);
  int status = 0;
  while (child > 0 && waitpid(child, &status, 0) < 0 && errno == EINTR) {
  }
  output.status = child > 0 && WIFEXITED(status) ? WEXITSTATUS(status) : 127;
  if (output.status == 127)
    throw Error(ErrorKind::usage,
                words[0] +
                    ": there is no such program here; submit where Slurm is, or use pounce "
                    "submit commands");
  return output;
}

/// What squeue says of a job, a line for each of its tasks; nothing once it has ended. Of one that
/// Slurm has forgotten squeue prints an error, which nobody needs to read.
std::string queue_of(const std::string& job) {
  return run_program({"squeue", "-h", "-r", "-j", job, "-o", "%K"}, false).text;
}

/// Tasks that Slurm has and that have not ended. Jobs that have are forgotten: Slurm may refuse
/// what is to wait for them.
std::set<std::uint32_t> queued_tasks(Terms& terms) {
  std::set<std::uint32_t> tasks;
  std::erase_if(terms.arrays, [&](const std::string& array) {
    const std::string queue = queue_of(array);
    std::istringstream lines(queue);
    for (std::string line; std::getline(lines, line);) {
      if (!line.empty() && line.find_first_not_of("0123456789") == std::string::npos)
        tasks.insert(static_cast<std::uint32_t>(std::stoul(line)));
    }
    return queue.empty();
  });
  if (!terms.assemble.empty() && queue_of(terms.assemble).empty()) terms.assemble.clear();
  return tasks;
}

/// A batch script. It hands signals on, so that the work of minutes is kept; it says how the
/// process ended where that could not say it; and what may pass is tried again, three times (not
/// assembling: what it misses has to be made first).
std::string script_of(const std::string& command, const JobFolder& folder, const std::string& name,
                      bool tries_again) {
  constexpr const char* kTryAgain =
      "if [ $status -eq 75 ] && [ \"${SLURM_RESTART_COUNT:-0}\" -lt 3 ]; then\n"
      "  scontrol requeue \"${SLURM_ARRAY_JOB_ID:-$SLURM_JOB_ID}"
      "${SLURM_ARRAY_TASK_ID:+_$SLURM_ARRAY_TASK_ID}\" && sleep 30\n"
      "fi\n";
  return fmt::format(
      "#!/bin/bash\n"
      "# Written by pounce submit slurm.\n"
      "cd {} || exit 75\n"
      "name={}\n"
      "{} &\n"
      "child=$!\n"
      "trap 'kill -TERM \"$child\" 2>/dev/null' TERM INT\n"
      "trap 'kill -USR1 \"$child\" 2>/dev/null' USR1\n"
      "wait \"$child\"\n"
      "status=$?\n"
      "while kill -0 \"$child\" 2>/dev/null; do wait \"$child\"; status=$?; done\n"
      "[ $status -le 128 ] || [ $status -eq 143 ] || echo $status > {}/tasks/\"$name\".exit\n"
      "{}"
      "exit $status\n",
      quoted(std::filesystem::current_path().string()), name, command, quoted(folder.path()),
      tries_again ? kTryAgain : "");
}

void write_script(const JobFolder& folder, const std::string& name, const std::string& text) {
  folder.write("slurm/" + name, text);
  std::error_code ignored;
  std::filesystem::permissions(std::filesystem::path(folder.path()) / "slurm" / name,
                               std::filesystem::perms::owner_exec |
                                   std::filesystem::perms::group_exec |
                                   std::filesystem::perms::others_exec,
                               std::filesystem::perm_options::add, ignored);
}

/// One sbatch after the other; with --dry-run they are printed instead.
class Slurm {
 public:
  Slurm(const SubmitLine& line, const JobFolder& folder, const Terms& terms,
        const std::vector<std::string>& rest)
      : line_(line), folder_(folder), terms_(terms), rest_(rest) {}

  /// Returns the job's number.
  std::string submit(const std::string& name, const std::vector<std::string>& more,
                     std::uint64_t memory_bytes) {
    const bool is_array = name == "task";
    std::vector<std::string> words{"sbatch",
                                   "--parsable",
                                   fmt::format("--job-name=pounce-{}", name),
                                   fmt::format("--output={}/log/{}.log", folder_.path(),
                                               is_array ? "task-%A_%a" : name + "-%j"),
                                   "--open-mode=append",
                                   "--requeue",
                                   fmt::format("--cpus-per-task={}", terms_.threads),
                                   fmt::format("--mem={}M", (memory_bytes + kMiB - 1) / kMiB),
                                   fmt::format("--time={:.0f}", terms_.minutes)};
    if (!line_.partition.empty()) words.push_back("--partition=" + line_.partition);
    words.insert(words.end(), more.begin(), more.end());
    words.insert(words.end(), rest_.begin(), rest_.end());
    words.push_back(fmt::format("{}/slurm/{}.sh", folder_.path(), name));
    if (line_.dry_run) {
      std::string text;
      for (const std::string& word : words) text += (text.empty() ? "" : " ") + quoted(word);
      write_stdout(text + "\n");
      return fmt::format("${}", name);
    }
    const Output output = run_program(words);
    const std::string number = output.text.substr(0, output.text.find_first_of(";\n"));
    if (output.status != 0 || number.empty())
      throw Error(ErrorKind::storage,
                  fmt::format("sbatch: refused the job (status {}); nothing after it was submitted",
                              output.status));
    return number;
  }

 private:
  const SubmitLine& line_;
  const JobFolder& folder_;
  const Terms& terms_;
  const std::vector<std::string>& rest_;
};

void write_scripts(const SubmitLine& line, const JobFolder& folder, const Terms& terms,
                   std::size_t tasks) {
  const std::string task = fmt::format("\"$SLURM_ARRAY_TASK_ID\"/{}", tasks);
  const std::map<std::string, std::string> scripts{
      {"prepare.sh", script_of(command_of("prepare", folder, terms, ""), folder, "prepare", true)},
      {"task.sh",
       script_of(command_of("task", folder, terms, task), folder, "$SLURM_ARRAY_TASK_ID", true)},
      {"assemble.sh",
       script_of(command_of("assemble", folder, terms, ""), folder, "assemble", false)}};
  for (const auto& [name, text] : scripts) {
    if (line.dry_run) {
      write_stdout(fmt::format("# {}/slurm/{}\n{}\n", folder.path(), name, text));
    } else {
      write_script(folder, name, text);
    }
  }
  // For sbatch and the scripts, whatever comes of pounce itself.
  if (!line.dry_run) {
    for (const char* name : {"/log", "/tasks"})
      std::filesystem::create_directories(folder.path() + name);
  }
}

/// Those that need the same memory together.
std::map<std::uint64_t, std::vector<std::uint32_t>> by_memory(
    const std::vector<std::uint32_t>& tasks, const JobState& state, Terms& terms) {
  std::map<std::uint64_t, std::vector<std::uint32_t>> groups;
  for (const std::uint32_t task : tasks) {
    const auto more = terms.more_memory.find(task);
    std::uint64_t memory = more != terms.more_memory.end() ? more->second : terms.memory_bytes;
    if (died_of_memory(state.tasks[task - 1], memory)) {
      memory *= 2;
      terms.more_memory[task] = memory;
    }
    groups[memory].push_back(task);
  }
  return groups;
}

int submit_slurm(SubmitLine& line, const std::vector<std::string>& rest) {
  const JobFolder folder(std::filesystem::absolute(line.folder).lexically_normal().string());
  std::optional<Terms> terms;
  const JobState state = open_folder(line, folder, terms, folder.path() + "/cache");
  const Missing missing =
      missing_of(state, line.dry_run ? std::set<std::uint32_t>() : queued_tasks(*terms));
  if (!missing.assemble || (missing.tasks.empty() && !terms->assemble.empty())) {
    write_stdout(
        fmt::format("{}: all is {}\n", line.folder, missing.assemble ? "under way" : "done"));
    return 0;
  }
  write_scripts(line, folder, *terms, state.tasks.size());
  Slurm slurm(line, folder, *terms, rest);
  std::vector<std::string> arrays = terms->arrays;
  std::string said;
  if (!missing.tasks.empty()) {
    const std::string prepare = slurm.submit("prepare", {}, terms->memory_bytes);
    said = fmt::format("prepare {}", prepare);
    for (const auto& [memory, tasks] : by_memory(missing.tasks, state, *terms)) {
      const std::string running = line.max_running.empty() ? "" : "%" + line.max_running;
      arrays.push_back(
          slurm.submit("task",
                       {"--array=" + ranges(tasks) + running, "--dependency=afterok:" + prepare,
                        "--kill-on-invalid-dep=yes"},
                       memory));
      said +=
          fmt::format(", tasks {} {} with {}", arrays.back(), ranges(tasks), bytes_text(memory));
    }
    for (const std::uint32_t task : missing.tasks) {
      if (!line.dry_run) folder.forget(std::to_string(task));
    }
  }
  // One after the other: what one has assembled another would miss.
  std::vector<std::string> before = arrays, more;
  if (!terms->assemble.empty()) before.push_back(terms->assemble);
  if (!before.empty()) more = {fmt::format("--dependency=afterany:{}", fmt::join(before, ":"))};
  terms->assemble = slurm.submit("assemble", more, terms->memory_bytes);
  said += fmt::format("{}assemble {}", said.empty() ? "" : ", ", terms->assemble);
  if (line.dry_run) return 0;
  folder.forget("assemble");
  terms->arrays = arrays;
  save(*terms, folder);
  write_stdout(fmt::format("submitted {}\nsee: pounce status {}\n", said, line.folder));
  return 0;
}

// --- the command line ----------------------------------------------------------------------------

CLI::App* add_engine(CLI::App& command, const char* name, const char* purpose, const char* usage,
                     const std::shared_ptr<SubmitLine>& line) {
  CLI::App* engine = command.add_subcommand(name, purpose);
  set_help_text(*engine, usage);
  engine
      ->add_option_function<std::string>("FOLDER",
                                         [line](const std::string& text) { line->folder = text; })
      ->description("Job folder that all tasks see; it is made")
      ->option_text(" ")
      ->required();
  for (const OptionInfo& info : option_table(JobCommand::transfer))
    add_given<TransferOptions>(*engine, info, line);
  add_value(*engine, "--tasks", "N", "Tasks",
            "How many tasks share the job [default: tasks of about five minutes, 1000 at most]",
            [line](const std::string& text) { line->farm.tasks = parse_count("--tasks", text); });
  engine->callback([line] {
    const JobFolder folder(line->folder);
    if (folder.has_job() && line->options.source.empty() &&
        find_given(line->given, "source") == nullptr)
      line->job_path = line->folder;
    set_options(JobCommand::transfer, *line);
  });
  return engine;
}

void add_slurm_options(CLI::App& engine, const std::shared_ptr<SubmitLine>& line) {
  const std::string group = "Slurm";
  add_value(engine, "--max-running", "N", group, "Tasks that may run at once",
            [line](const std::string& text) {
              line->max_running = std::to_string(parse_count("--max-running", text));
            });
  add_value(engine, "--partition", "NAME", group, "Partition, as for sbatch",
            [line](const std::string& text) { line->partition = text; });
  add_value(engine, "--mem", "SIZE", group,
            "Memory of a task [default: its --memory, or 1 GiB, and what the process takes beside]",
            [line](const std::string& text) { line->memory_bytes = parse_bytes("--mem", text); });
  add_value(
      engine, "--time", "MINUTES", group,
      "Limit for a task [default: by the area of its images, generously]",
      [line](const std::string& text) { line->minutes = parse_number("--time", text, 1, 1e6); });
  add_switch(engine, "--dry-run", group, "Print scripts and sbatch commands; submit nothing",
             line->dry_run);
}

}  // namespace

Command add_submit_command(CLI::App& program, const std::vector<std::string>& rest) {
  const auto line = std::make_shared<SubmitLine>();
  CLI::App* command = program.add_subcommand(
      "submit", "Hand a transfer to a scheduler, or print it as commands, as tasks that share it");
  command->require_subcommand(1);
  set_help_text(*command,
                "Usage: pounce submit slurm|commands FOLDER [SOURCE TARGET... -o OUTPUT] "
                "[options]");
  CLI::App* slurm = add_engine(*command, "slurm", "Submit to Slurm", kSlurmUsage, line);
  add_slurm_options(*slurm, line);
  CLI::App* commands =
      add_engine(*command, "commands", "Print one command a line", kCommandsUsage, line);
  return {command, [line, slurm, commands, &rest] {
            if (!slurm->parsed() && !rest.empty())
              throw Error(ErrorKind::usage, "--: only submit slurm hands options on, to sbatch");
            return commands->parsed() ? submit_commands(*line) : submit_slurm(*line, rest);
          }};
}

}  // namespace pounce::cli
