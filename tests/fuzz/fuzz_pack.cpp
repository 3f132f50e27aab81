// SPDX-License-Identifier: Apache-2.0
//
// Packs of the tile cache. An input that begins like a pack is one as it stands; every other is a
// list of changes to a sound pack, whose checksums and places are made right again afterwards: a
// fuzzer would not find them. Sound packs are in the folder $POUNCE_FUZZ_PACKS (fuzz_seeds).
#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <deque>
#include <numeric>
#include <vector>

#include "fuzz/fuzz_support.h"
#include "projection/hit_block.h"
#include "store/blocks/colour_store.h"
#include "store/blocks/geometry_store.h"
#include "store/blocks/hit_store.h"
#include "store/blocks/splat_store.h"
#include "support/pack_tree.h"

namespace pounce::fuzz {
namespace {

using test::PackTree;

/// A sound pack, and what a job would know of it.
struct Sound {
  PackTree tree;
  store::GeometryFacts facts;
  store::ColourDirectory image;
  store::SplatFacts splats;
  store::HitStore::Facts hits;
};

store::HitStore::Facts hits_of(const PackTree& tree) {
  store::HitStore::Facts facts;
  facts.image = {64 * PackTree::u32(tree.directory, 0), 64 * PackTree::u32(tree.directory, 4)};
  facts.most_bytes = projection::kMostHitBytes;
  for (const auto& raw : tree.blocks) {
    for (const auto& facet : projection::decode_hits(raw, SIZE_MAX, "block").facets)
      facts.source_pages = std::max(facts.source_pages, static_cast<std::size_t>(facet.page) + 1);
  }
  return facts;
}

store::ColourDirectory image_of(const PackTree& tree) {
  const std::byte* at = tree.directory.data();
  store::ColourDirectory image;
  image.width = store::get_u32(at);
  image.height = store::get_u32(at + 4);
  image.channels = store::get_u32(at + 8);
  image.depth = static_cast<Depth>(at[12]);
  image.linear = at[13] != std::byte{0};
  image.has_alpha = at[14] != std::byte{0};
  image.premultiplied = at[14] == std::byte{2};
  image.wrap_u = static_cast<mesh::Wrap>(at[15]);
  image.wrap_v = static_cast<mesh::Wrap>(at[16]);
  return image;
}

store::SplatFacts splats_of(const PackTree& tree) {
  std::array<std::uint64_t, 1 + store::kSplatFilters> counts;
  std::memcpy(counts.data(), tree.directory.data() + 16, sizeof counts);
  store::SplatFacts facts;
  facts.model = static_cast<store::SplatModel>(PackTree::u32(tree.directory, 8));
  facts.is_linear = (PackTree::u32(tree.directory, 4) & 2) != 0;
  facts.lobes = PackTree::u32(tree.directory, 116);
  facts.rows = std::accumulate(counts.begin(), counts.end(), std::uint64_t{0});
  return facts;
}

store::GeometryFacts facts_of(const PackTree& tree) {
  store::GeometryFacts facts;
  const std::byte* at = tree.directory.data() + 88;
  for (std::uint32_t i = 0; i < PackTree::u32(tree.directory, 0); ++i, at += 60) {
    mesh::Lattice& page = facts.pages.emplace_back();
    page.width = store::get_u32(at);
    page.height = store::get_u32(at + 4);
    page.uv_set = store::get_u32(at + 8);
    mesh::UvTransform& m = page.transform;
    std::size_t place = 12;
    for (double* v : {&m.a, &m.b, &m.c, &m.d, &m.e, &m.f}) {
      std::memcpy(v, at + place, sizeof *v);
      place += sizeof *v;
    }
  }
  for (const PackTree::Tile& tile : tree.tiles) {
    for (const auto& raw : tile.blocks) {
      const store::GeometryBlock block = store::decode_geometry(raw, "block");
      facts.is_target = !block.owner.empty();
      for (const std::uint32_t id : block.ids)
        facts.triangles = std::max(facts.triangles, std::uint64_t{id} + 1);
    }
    facts.most_blocks += tile.blocks.size();
  }
  return facts;
}

std::deque<Sound> read_sound_packs() {
  std::deque<Sound> packs;
  const char* folder = std::getenv("POUNCE_FUZZ_PACKS");
  require(folder != nullptr, "POUNCE_FUZZ_PACKS names the folder of sound packs");
  std::vector<std::string> paths;
  for (const auto& entry : std::filesystem::directory_iterator(folder))
    paths.push_back(entry.path().string());
  std::sort(paths.begin(), paths.end());
  for (const std::string& path : paths) {
    Sound& sound = packs.emplace_back(Sound{PackTree(path), {}, {}, {}, {}});
    if (sound.tree.kind == store::PackKind::geometry) sound.facts = facts_of(sound.tree);
    if (sound.tree.kind == store::PackKind::colour) sound.image = image_of(sound.tree);
    if (sound.tree.kind == store::PackKind::splats) sound.splats = splats_of(sound.tree);
    if (sound.tree.kind == store::PackKind::hits) sound.hits = hits_of(sound.tree);
  }
  require(!packs.empty(), "there are sound packs");
  return packs;
}

/// A change: where, what, with which value.
struct Change {
  static constexpr std::size_t kBytes = 9;
  std::uint8_t tile = 0, part = 0, kind = 0;
  std::uint16_t place = 0;
  std::uint32_t value = 0;
};

void change_bytes(const Change& change, PackTree::Bytes& raw) {
  if (raw.empty()) return;
  const std::size_t at = change.place % raw.size();
  switch (change.kind % 6) {
    case 0:
      if (at + 4 <= raw.size()) store::put_u32(raw.data() + at, change.value);
      break;
    case 1:
      raw[at] = static_cast<std::byte>(change.value);
      break;
    case 2:
      raw.resize(at);
      break;
    case 3:
      raw.insert(raw.begin() + static_cast<std::ptrdiff_t>(at), change.value % 64,
                 static_cast<std::byte>(change.value >> 8));
      break;
    case 4:
      if (at + 4 <= raw.size())
        store::put_u32(raw.data() + at, PackTree::u32(raw, at) + change.value % 16 - 8);
      break;
    default:
      raw[at] ^= static_cast<std::byte>(1U << change.value % 8);
  }
}

void read_geometry(std::unique_ptr<store::PackReader> pack, const store::GeometryFacts& facts) {
  store::Compressor compressor;
  const store::GeometryStore store(std::move(pack), facts, compressor);
  for (std::uint32_t t = 0; t < store.directory().tiles.size(); ++t) {
    for (const store::BlockEntry& entry : store.read_index(t, compressor)) {
      attempt([&] {
        const store::GeometryBlock block = store.read_block(entry, compressor);
        require(block.page < facts.pages.size(), "blocks lie on pages");
        for (const auto& triangle : block.triangles) {
          for (const std::uint16_t corner : triangle)
            require(corner < block.positions.size(), "corners are vertices");
        }
        for (const std::uint16_t owner : block.owner)
          require(owner == store::kNoTriangle ||
                      owner < std::max(block.triangles.size(), block.records.size()),
                  "owners are triangles or records");
        require(block.triangles.empty() || block.records.empty(), "blocks are of one kind");
        for (const store::TexelRecord& record : block.records)
          require(record.edge > 0 && record.edge < 0x7F80, "edges are finite");
        require(block.ids.size() == block.triangles.size() &&
                    block.normals.size() == block.positions.size() &&
                    block.uvs.size() == block.positions.size() &&
                    block.tangents.size() == block.positions.size() &&
                    (block.colours.empty() || block.colours.size() == block.positions.size()) &&
                    (block.shifts.empty() || block.shifts.size() == block.triangles.size()),
                "columns are equally long");
        for (std::size_t i = 0; i < block.triangles.size(); ++i)
          block.texel_corners(facts.pages[block.page], i);
        std::vector<std::byte> raw;
        store::encode(block, raw);
      });
    }
  }
}

void read_colours(std::unique_ptr<store::PackReader> pack, const store::ColourDirectory& image) {
  store::Compressor compressor;
  const store::ColourStore store(std::move(pack), image, compressor);
  for (std::uint32_t row = 0; row < store.directory().row_pages.size(); ++row) {
    attempt([&] {
      for (const store::ChunkRef& chunk : store.read_row(row, compressor))
        require(store.read_tile(chunk, compressor).size() == std::size_t{store::kColourTileEdge} *
                                                                 store::kColourTileEdge *
                                                                 store.directory().texel_bytes(),
                "tiles have all their texels");
    });
  }
}

void read_splats(std::unique_ptr<store::PackReader> pack, const store::SplatFacts& facts) {
  store::Compressor compressor;
  const store::SplatStore store(std::move(pack), facts, compressor);
  for (std::uint32_t t = 0; t < store.directory().tiles.size(); ++t) {
    attempt([&] {
      for (const store::SplatEntry& entry : store.read_index(t, compressor)) {
        const store::SplatBlock block = store.read_block(entry, compressor);
        for (std::size_t i = 0; i < block.size(); ++i)
          require(store::size_of(block.splat(i)) > 0, "Gaussians have a size");
      }
    });
  }
}

void read_hits(std::unique_ptr<store::PackReader> pack, const store::HitStore::Facts& facts) {
  store::Compressor compressor;
  const store::HitStore store(std::move(pack), facts, compressor);
  for (std::size_t i = 0; i < store.grid().blocks(); ++i) {
    attempt([&] {
      const auto raw = store.read(static_cast<std::uint32_t>(i % store.grid().across),
                                  static_cast<std::uint32_t>(i / store.grid().across), compressor);
      if (raw.empty()) return;
      const projection::HitBlock block = projection::decode_hits(raw, facts.source_pages, "block");
      for (const std::uint16_t facet : block.facet)
        require(facet < block.facets.size(), "hits lie on facets");
      for (const projection::HitFacet& facet : block.facets)
        require(static_cast<std::size_t>(facet.page) < facts.source_pages, "facets lie on pages");
      PageVector<projection::TexelPacket> packets;
      UnsetPageVector<projection::HitPacket> hits;
      projection::append_packets(block, 0, packets, hits);
    });
  }
}

void read_pack(const std::string& path, const Sound& sound) {
  const auto open = [&](const store::PackInfo& info) {
    return std::make_unique<store::PackReader>(posix_file_system().open(path), path, info.kind,
                                               info.key);
  };
  const store::PackInfo info = store::read_pack_info(*posix_file_system().open(path), path);
  attempt([&] { open(info)->verify(); });
  if (info.kind == store::PackKind::geometry) read_geometry(open(info), sound.facts);
  if (info.kind == store::PackKind::colour) read_colours(open(info), sound.image);
  if (info.kind == store::PackKind::splats) read_splats(open(info), sound.splats);
  if (info.kind == store::PackKind::hits) read_hits(open(info), sound.hits);
}

/// The sound pack with the changes of an input.
void write_changed(const Sound& sound, std::string_view changes, const std::string& path) {
  PackTree tree = sound.tree;
  std::vector<Change> late;
  for (; changes.size() >= Change::kBytes; changes.remove_prefix(Change::kBytes)) {
    Change change;
    std::memcpy(&change.tile, changes.data(), 1);
    std::memcpy(&change.part, changes.data() + 1, 1);
    std::memcpy(&change.kind, changes.data() + 2, 1);
    std::memcpy(&change.place, changes.data() + 3, 2);
    std::memcpy(&change.value, changes.data() + 5, 4);
    if (change.tile == 0 || change.part % 2 == 0) {
      late.push_back(change);
      continue;
    }
    auto& blocks = tree.tiles.empty() ? tree.blocks
                                      : tree.tiles[(change.tile - 1U) % tree.tiles.size()].blocks;
    if (blocks.empty()) continue;
    change_bytes(change, blocks[change.part / 2 % blocks.size()]);
  }
  tree.write(path, [&](int tile, PackTree::Bytes& raw) {
    for (const Change& change : late) {
      const int own = change.tile == 0 || tree.tiles.empty()
                          ? -1
                          : (change.tile - 1) % static_cast<int>(tree.tiles.size());
      if (own == tile) change_bytes(change, raw);
    }
  });
}

}  // namespace
}  // namespace pounce::fuzz

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace pounce;
  static const std::deque<fuzz::Sound> packs = fuzz::read_sound_packs();
  static const fuzz::Folder folder;
  const std::string_view input = fuzz::text_of(data, size);
  const fuzz::Sound& sound = packs[input.empty() ? 0 : data[0] % packs.size()];
  const std::string path = folder.path("x.pack");
  if (input.starts_with("POUNCE"))
    folder.write("x.pack", input);
  else
    fuzz::write_changed(sound, input.substr(std::min<std::size_t>(1, size)), path);
  fuzz::attempt([&] { fuzz::read_pack(path, sound); });
  return 0;
}
