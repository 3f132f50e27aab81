// SPDX-License-Identifier: Apache-2.0
#include <catch2/catch.hpp>

#include "io/obj/materials.h"
#include "pounce/error.h"
#include "support/gltf_builder.h"
#include "support/test_data.h"

using namespace pounce;
using Colour = std::array<float, 3>;
using Pair = std::array<double, 2>;

namespace {

std::vector<io::MtlMaterial> read(const std::string& text) {
  const test::TempFolder folder;
  test::write_file(folder.file("m.mtl"), text);
  std::vector<io::MtlMaterial> found;
  io::read_mtl(folder.file("m.mtl"),
               [&](io::MtlMaterial&& material) { found.push_back(std::move(material)); });
  return found;
}

/// The one material that the statements make.
io::MtlMaterial material(const std::string& statements) {
  auto found = read("newmtl m\n" + statements);
  REQUIRE(found.size() == 1);
  return std::move(found[0]);
}

}  // namespace

TEST_CASE("MTL colours and opacity are read", "[io]") {
  const io::MtlMaterial empty = material("illum 2\nNs 10\nKa 0 0 0\n");
  CHECK(empty.diffuse == Colour{1, 1, 1});
  CHECK(empty.emission == Colour{0, 0, 0});
  CHECK(empty.dissolve == 1);
  CHECK(material("Kd .5 +0.25 1e-1 7").diffuse == Colour{.5F, .25F, .1F});
  CHECK(material("\tKd\t0.5\n").diffuse == Colour{.5F, .5F, .5F});  // green and blue are as red
  CHECK(material("Kd 0.5 .25 \n").diffuse == Colour{.5F, .25F, .5F});
  CHECK(material("Kd .5 x 1,5\n").diffuse == Colour{.5F, 0, 1});
  CHECK(material("Ke 3\n").emission == Colour{3, 3, 3});
  CHECK(material("Kd nan -inf 0x7\n").diffuse == Colour{0, 0, 0});
  CHECK(material("Kd 1e999 -1e39 1e-50\n").diffuse == Colour{0, 0, 0});
  CHECK(material("Kd \nKe\n").diffuse == Colour{1, 1, 1});
  CHECK(material("Kd 1 0 0\nKd 0 1 0\n").diffuse == Colour{0, 1, 0});
  CHECK(material("Ke 1 2 3\n").emission == Colour{1, 2, 3});
  CHECK(material("kd 0 0 0\nKdx 0 0 0\n").diffuse == Colour{1, 1, 1});
  CHECK(material("Tr 0.25\n").dissolve == .75F);
  CHECK(material("Tr 0.25\nTr 1\n").dissolve == 0);
  CHECK(material("d 0.5\nTr 0.25\n").dissolve == .5F);
  CHECK(material("Tr 0.25\nd 0.5\n").dissolve == .5F);
  CHECK(material("d -halo 0.5\n").dissolve == 0);
}

TEST_CASE("MTL colours that are no RGB count as not given", "[io]") {
  const io::MtlMaterial xyz = material("Kd xyz .5 .5 .5\nKe spectral glow.rfl 2\n");
  CHECK(xyz.diffuse == Colour{1, 1, 1});
  CHECK(xyz.emission == Colour{0, 0, 0});
  CHECK(xyz.unread_diffuse == "xyz");
  CHECK(xyz.unread_emission == "spectral");
  const io::MtlMaterial both = material("Kd xyz .5 .5 .5\nKd 1 0 0\n");
  CHECK(both.diffuse == Colour{1, 0, 0});
  CHECK(both.unread_diffuse.empty());
}

TEST_CASE("options stand before the name of an MTL texture", "[io]") {
  const io::MtlTexture all =
      material(
          "map_Kd -blendu off -blendv on -boost 2 -bm 1 -mm 0 1 -t 0 0 0 -texres 512 "
          "-type cube_top -imfchan r -colorspace sRGB -s 2 0.1 4 -o .5\t-.25 0 -clamp on "
          " my skin.png \n")
          .base_color;
  CHECK(all.name == "my skin.png");
  CHECK(all.clamp);
  // Single precision, as all numbers of these files.
  CHECK(all.scale == Pair{2, double{.1F}});
  CHECK(all.offset == Pair{.5, -.25});
  const io::MtlTexture plain = material("map_Ke -texture 1 glow.png\n").emissive;
  CHECK(plain.name == "-texture 1 glow.png");
  CHECK_FALSE(plain.clamp);
  CHECK(plain.scale == Pair{1, 1});
  CHECK(plain.offset == Pair{0, 0});
  CHECK(material("map_Kd a.png -clamp on\n").base_color.name == "a.png -clamp on");
  CHECK_FALSE(material("map_Kd -clamp off a.png\n").base_color.clamp);
  CHECK(material("map_Kd -clamp what a.png\n").base_color.clamp);
  CHECK(material("map_Kd -s x 2 2 a.png\n").base_color.scale == Pair{1, 2});
  CHECK(material("map_Kd -s 1e999 2 2 a.png\n").base_color.scale == Pair{1, 2});
  CHECK(material("map_Kd -bm\t1 a.png\n").base_color.name == "a.png");
}

TEST_CASE("the second and third number of an MTL option may be left out", "[io]") {
  const io::MtlTexture two = material("map_Kd -s 2 3 -o .5 my skin.png\n").base_color;
  CHECK(two.name == "my skin.png");
  CHECK(two.scale == Pair{2, 3});
  CHECK(two.offset == Pair{.5, 0});
  CHECK(material("map_Kd -s 2 -clamp on 7.png\n").base_color.name == "7.png");
  CHECK(material("map_Kd -s 2 -clamp on 7.png\n").base_color.scale == Pair{2, 1});
  CHECK(material("bump -t 1 1 1 2 x.png\n").others.at(0).second == "2 x.png");
}

TEST_CASE("the last statement of a texture counts, with the options of those before", "[io]") {
  const io::MtlMaterial m = material(
      "map_Kd -clamp on -s 2 2 2 a.png\nmap_Kd -s 3 3 3 b.png\nbump a\nmap_Bump b\nmap_bump c\n"
      "map_Kd\nmap_Kd -o 1 1 1\n");
  CHECK(m.base_color.name == "b.png");
  CHECK(m.base_color.clamp);
  CHECK(m.base_color.scale == Pair{3, 3});
  CHECK(m.base_color.offset == Pair{1, 1});
  REQUIRE(m.others.size() == 1);
  CHECK(m.others[0].second == "c");
}

TEST_CASE("MTL textures that no channel takes are told in one order", "[io]") {
  const io::MtlMaterial m = material(
      "map_Ps ps\nmap_Pm pm\nmap_Pr pr\nrefl -type sphere r\nmap_d d\ndisp di\nbump b\n"
      "map_Ns ns\nmap_Ks ks\nmap_Ka ka\nmap_Disp x\nmap_disp x\nmap_Kt x\nmap_RMA x\n");
  std::string told;
  for (const auto& [slot, name] : m.others) told += std::string(slot) + " " + name + ",";
  CHECK(told ==
        "map_Ka ka,map_Ks ks,map_Ns ns,map_Bump b,disp di,map_d d,refl r,map_Pr pr,map_Pm pm,"
        "map_Ps ps,");
  CHECK(m.others.size() + 3 == io::kMaxMtlTextures);
}

TEST_CASE("MTL materials have the names that are written, blanks and all", "[io]") {
  const auto found = read(
      "map_Kd nobodys.png\nKd 0 0 0\n  newmtl \ttwo  words\t \nnewmtl\nnewmtlx no\nnewmtl a\n"
      "newmtl a\n");
  REQUIRE(found.size() == 4);
  CHECK(found[0].name == "\ttwo  words");
  CHECK(found[0].base_color.name.empty());
  CHECK(found[1].name.empty());
  CHECK(found[2].name == "a");
  CHECK(found[3].name == "a");
  CHECK(read("").empty());
  CHECK(read("# nothing\n\n").empty());
}

TEST_CASE("lines of an MTL end in every way, and do not go on", "[io]") {
  for (const std::string end : {"\n", "\r\n", "\r"}) {
    const auto found = read("\xEF\xBB\xBFnewmtl a" + end + "map_Kd textures\\" + end + end +
                            "newmtl b" + end + "Kd 0 0 0.5");
    REQUIRE(found.size() == 2);
    CHECK(found[0].name == "a");
    CHECK(found[0].base_color.name == "textures\\");
    CHECK(found[1].diffuse == Colour{0, 0, .5F});
  }
}

TEST_CASE("MTL files longer than any are refused", "[io]") {
  const std::string statement = "map_Kd " + std::string(900'000, 'x') + "\n";
  CHECK(material(statement + statement).base_color.name.size() == 900'000);
  CHECK_THROWS_AS(material(statement + statement + statement), Error);
  CHECK_THROWS_AS(material("# " + std::string(1 << 20, 'x') + "\n"), Error);
  CHECK(read(statement + statement + statement + "newmtl a\n").size() == 1);
}

TEST_CASE("only norm is a normal map; a bump may be anything", "[io]") {
  const io::MtlMaterial m = material("norm -bm 0.5 n.png\nmap_Bump -bm 2 heights.png\n");
  CHECK(m.normal.name == "n.png");
  CHECK(m.normal.strength == 0.5F);
  REQUIRE(m.others.size() == 1);
  CHECK(std::string(m.others[0].first) == "map_Bump");
  CHECK(material("norm n.png\n").normal.strength == 1);
}
