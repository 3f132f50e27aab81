// SPDX-License-Identifier: Apache-2.0
//
// OpenColorIO 2.1 opens tables itself and cannot be given their bytes, so each is found as it finds
// them (search paths and variables included) and looked at first. All that a space, a look or a
// view may lead to counts, in either direction: that is simple, and a table that is no file does
// not belong beside a configuration, needed or not.
//
// What loading takes was measured with OpenColorIO 2.1.2: text that its readers split into words
// and then refuse costs most, up to 8 bytes per byte and 72 per word; a reader may also make the
// largest table there is (129^3 texels) before it finds none. A table that is loaded keeps 12 bytes
// per byte at most: a digit and a line end may be a step of three channels.
#include "io/foreign/ocio_tables.h"

#include <OpenColorIO/OpenColorIO.h>
#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <span>
#include <string_view>
#include <vector>

#include "core/file.h"
#include "core/input_file.h"
#include "io/files/asset_file.h"
#include "pounce/error.h"

namespace OCIO = OCIO_NAMESPACE;

namespace pounce::io {
namespace {

constexpr std::uint64_t kPieceBytes = 256 << 10;
constexpr std::uint64_t kFixedBytes = 32 << 20, kLoadingPerByte = 8, kLoadingPerWord = 72;
constexpr std::uint64_t kKeptPerByte = 12;

/// What counts of a table's text, which goes through it piece by piece.
class TableText {
 public:
  void add(std::string_view piece) {
    std::string text = tail_;
    for (const char c : piece) {
      if (c == '\0') continue;  // every other byte of UTF-16
      const bool is_blank = c == ' ' || (c >= '\t' && c <= '\r');
      words_ += !is_blank && after_blank_ ? 1 : 0;
      after_blank_ = is_blank;
      text += c;
    }
    for (const std::string_view mark : {"<Reference", "<!ENTITY"})
      refers_ = refers_ || text.find(mark) != std::string::npos;
    tail_ = text.substr(text.size() - std::min<std::size_t>(text.size(), 9));
  }
  std::uint64_t words() const { return words_; }
  /// May it be XML that leads to other files? So may entities, whatever they stand for.
  bool refers() const { return refers_; }

 private:
  std::uint64_t words_ = 0;
  bool after_blank_ = true, refers_ = false;
  std::string tail_;  ///< the last characters: a mark may lie across two pieces
};

TableText read_text(const ReadFile& file) {
  TableText text;
  std::vector<char> piece;
  for (std::uint64_t at = 0; at < file.size_bytes(); at += piece.size()) {
    piece.resize(std::min(kPieceBytes, file.size_bytes() - at));
    file.read(at, std::as_writable_bytes(std::span(piece)));
    text.add({piece.data(), piece.size()});
  }
  return text;
}

}  // namespace

/// Goes through all that the spaces of a conversion are made of.
class ColourTables::Finder {
 public:
  Finder(ColourTables& tables, const OCIO::ConstConfigRcPtr& config)
      : tables_(tables), config_(config), context_(config->getCurrentContext()) {}

  void add_space(const char* given) {
    const std::string name = context_->resolveStringVar(given);
    if (name.empty() || !seen_.insert(name).second) return;
    if (const auto space = config_->getColorSpace(name.c_str())) {
      add(space->getTransform(OCIO::COLORSPACE_DIR_TO_REFERENCE));
      add(space->getTransform(OCIO::COLORSPACE_DIR_FROM_REFERENCE));
      if (space->getReferenceSpaceType() == OCIO::REFERENCE_SPACE_DISPLAY) add_views();
    }
    if (const auto named = config_->getNamedTransform(name.c_str())) {
      add(named->getTransform(OCIO::TRANSFORM_DIR_FORWARD));
      add(named->getTransform(OCIO::TRANSFORM_DIR_INVERSE));
    }
  }

 private:
  void add(const OCIO::ConstTransformRcPtr& transform) {
    if (!transform) return;
    if (const auto file = OCIO::DynamicPtrCast<const OCIO::FileTransform>(transform)) {
      add_file(file->getSrc());
    } else if (const auto group = OCIO::DynamicPtrCast<const OCIO::GroupTransform>(transform)) {
      for (int i = 0; i < group->getNumTransforms(); ++i) add(group->getTransform(i));
    } else if (const auto spaces =
                   OCIO::DynamicPtrCast<const OCIO::ColorSpaceTransform>(transform)) {
      add_space(spaces->getSrc());
      add_space(spaces->getDst());
    } else if (const auto look = OCIO::DynamicPtrCast<const OCIO::LookTransform>(transform)) {
      add_space(look->getSrc());
      add_space(look->getDst());
      add_looks();
    } else if (const auto view =
                   OCIO::DynamicPtrCast<const OCIO::DisplayViewTransform>(transform)) {
      add_space(view->getSrc());
      add_views();
      add_looks();
      for (int i = 0; i < config_->getNumColorSpaces(); ++i)  // its view may show any
        add_space(config_->getColorSpaceNameByIndex(i));
    }
  }

  void add_file(const char* source) {
    std::string path;
    try {
      path = context_->resolveFileLocation(source);
    } catch (const OCIO::Exception&) {
      return;  // it is missing
    }
    tables_.add(path);
  }

  void add_looks() {
    if (has_looks_) return;
    has_looks_ = true;
    for (int i = 0; i < config_->getNumLooks(); ++i) {
      const auto look = config_->getLook(config_->getLookNameByIndex(i));
      add(look->getTransform());
      add(look->getInverseTransform());
      add_space(look->getProcessSpace());
    }
  }

  void add_views() {
    if (has_views_) return;
    has_views_ = true;
    for (int i = 0; i < config_->getNumViewTransforms(); ++i) {
      const auto view = config_->getViewTransform(config_->getViewTransformNameByIndex(i));
      add(view->getTransform(OCIO::VIEWTRANSFORM_DIR_TO_REFERENCE));
      add(view->getTransform(OCIO::VIEWTRANSFORM_DIR_FROM_REFERENCE));
    }
  }

  ColourTables& tables_;
  const OCIO::ConstConfigRcPtr& config_;
  const OCIO::ConstContextRcPtr context_;
  std::set<std::string> seen_;
  bool has_looks_ = false, has_views_ = false;
};

void ColourTables::check(const OCIO::ConstConfigRcPtr& config,
                         std::initializer_list<const char*> spaces) {
  Finder finder(*this, config);
  for (const char* space : spaces) finder.add_space(space);
}

void ColourTables::add(const std::string& path) {
  if (paths_.count(path) > 0) return;
  if (!folder_.holds(path)) {
    throw Error(
        ErrorKind::input,
        fmt::format("{}: its table {} is outside of the configuration's folder; copy it into that "
                    "folder, or add --allow-external",
                    config_path_, path));
  }
  const auto file = open_input(path);
  const std::uint64_t fixed = paths_.empty() ? kFixedBytes : 0;
  const std::uint64_t bytes = file->size_bytes();
  require(loading_bytes_ + fixed + kLoadingPerByte * bytes);
  const TableText text = read_text(*file);
  if (text.refers()) {
    throw Error(
        ErrorKind::input,
        fmt::format("{}: its table {} references other files or defines XML entities, which is not "
                    "supported; export it as one self-contained table",
                    config_path_, path));
  }
  const std::uint64_t loading = fixed + kLoadingPerByte * bytes + kLoadingPerWord * text.words();
  require(loading_bytes_ + loading);
  loading_bytes_ += loading;
  kept_bytes_ += kKeptPerByte * bytes;
  paths_.insert(path);
}

void ColourTables::require(std::uint64_t bytes) const {
  if (bytes <= most_bytes_) return;
  const std::uint64_t mib = (bytes + (1 << 20) - 1) >> 20;
  throw Error(ErrorKind::budget,
              fmt::format("--memory is too small: the tables of {} need at least {}MiB; run it "
                          "with --memory {}MiB",
                          config_path_, mib, mib));
}

void ColourTables::check_reading() const {
  for (const std::string& path : paths_) read_text(*open_input(path));
}

}  // namespace pounce::io
