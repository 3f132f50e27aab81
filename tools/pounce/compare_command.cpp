// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <cmath>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <vector>

#include "arguments.h"
#include "commands.h"
#include "pounce/compare.h"
#include "shared_options.h"
#include "summary.h"
#include "visible.h"

namespace pounce::cli {
namespace {

constexpr const char* kUsage =
    "Usage: pounce compare A B [--mask M] [--min-psnr DB] [--json]\n"
    "\n"
    "Examples:\n"
    "  # How alike are a result and its truth, where the truth's alpha is set?\n"
    "  pounce compare result.png truth.png\n"
    "\n"
    "  # In a script: exit status 1 unless at least 40 dB inside the mask.\n"
    "  pounce compare result.png truth.png --mask mask.png --min-psnr 40";

constexpr double kHighestThresholdDb = 1000;
constexpr int kBelowThreshold = 1;  // the exit status

struct Settings {
  std::string a, b, mask;
  std::optional<double> min_psnr_db;
  bool json = false;
  std::vector<ImageFormat> allowed_formats;
};

std::string comparison_text(const Comparison& result) {
  const std::string psnr = std::isinf(result.psnr_db) ? std::string("infinite (equal)")
                                                      : fmt::format("{:.2f} dB", result.psnr_db);
  return fmt::format(
      "similarity     {:.6f}\npsnr           {}\nlargest error  {:.6f} at ({}, {})\n"
      "compared       {} texels x {} channels\n",
      result.similarity, psnr, result.largest_error, result.largest_x, result.largest_y,
      with_commas(result.texels), result.channels);
}

std::string comparison_json(const Comparison& result, bool passed) {
  nlohmann::ordered_json json;
  json["similarity"] = result.similarity;
  // JSON has no infinity: equal images get null here, and "equal" says why.
  json["psnr_db"] = result.psnr_db;
  json["equal"] = std::isinf(result.psnr_db);
  json["largest_error"] = result.largest_error;
  json["largest_x"] = result.largest_x;
  json["largest_y"] = result.largest_y;
  json["texels"] = result.texels;
  json["channels"] = result.channels;
  json["passed"] = passed;
  return json.dump(2) + "\n";
}

int run_comparison(const Settings& settings) {
  const Comparison result =
      compare(settings.a, settings.b, settings.mask, settings.allowed_formats);
  const bool passed = !settings.min_psnr_db || result.psnr_db >= *settings.min_psnr_db;
  write_stdout(settings.json ? comparison_json(result, passed) : comparison_text(result));
  if (!passed) {
    write_stderr(fmt::format("pounce: {} and {}: {:.2f} dB, below the {:g} dB asked for\n",
                             visible_line(settings.a), visible_line(settings.b), result.psnr_db,
                             *settings.min_psnr_db));
  }
  return passed ? 0 : kBelowThreshold;
}

}  // namespace

Command add_compare_command(CLI::App& program) {
  const auto settings = std::make_shared<Settings>();
  CLI::App* command = program.add_subcommand("compare", "Measure how alike two images are");
  set_help_text(*command, kUsage);
  command->add_option("A", settings->a, "Image")->option_text(" ")->required();
  command->add_option("B", settings->b, "Image of the same size")->option_text(" ")->required();
  add_value(*command, "--mask", "M", "Options",
            "Compare where this image's first channel is not 0.\n"
            "Default: B's alpha if it has one, else everywhere",
            [settings](const std::string& text) { settings->mask = parse_path("--mask", text); });
  add_value(*command, "--min-psnr", "DB", "Options", "Exit with status 1 below this, 0 to 1000 dB",
            [settings](const std::string& text) {
              settings->min_psnr_db = parse_number("--min-psnr", text, 0, kHighestThresholdDb);
            });
  add_switch(*command, "--json", "Options", "As JSON instead of text", settings->json);
  add_format_option(*command, "Options", settings->allowed_formats);
  return {command, [settings] { return run_comparison(*settings); }};
}

}  // namespace pounce::cli
