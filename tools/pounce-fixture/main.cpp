// SPDX-License-Identifier: Apache-2.0
#include <CLI/CLI.hpp>
#include <cstdio>
#include <exception>
#include <functional>
#include <string>

#include "pounce/error.h"
#include "recipes.h"

namespace {

using namespace pounce::fixture;

constexpr const char* kAbout =
    "pounce-fixture makes input for trying, testing and measuring pounce: meshes with textures, "
    "targets, and\n"
    "images of the right answer. The same arguments give the same bytes. Everything is streamed: a "
    "texture of\n"
    "16384 x 16384 needs no more than a few rows of memory.\n\n"
    "First steps:\n"
    "  pounce-fixture head -o demo\n"
    "  pounce transfer demo/head_src.glb demo/head_same.glb -o demo/out.png\n"
    "  pounce compare demo/out.png demo/head_same.truth.png\n\n"
    "Exit status: 0 done, 2 wrong usage, 5 a file cannot be written, 70 internal error.";

const CLI::Range kImageSizes(1, 65536);
const CLI::Range kTriangles(12, 100000000);

void add_head(CLI::App& app, std::function<Paths()>& run, HeadOptions& o, std::string& format) {
  CLI::App* c = app.add_subcommand(
      "head",
      "a head with seven charts and a texture; the same head with other triangles and UVs "
      "and the exact answer for it; and another head");
  c->footer(
      "Writes head_src (textured), head_same, head_same.truth.png (16 bit; alpha = covered) and "
      "head_other.");
  c->add_option("-o,--output", o.folder, "folder, made if missing")->required();
  c->add_option("--triangles", o.triangles, "triangles of head_src (memory: 6 bytes each)")
      ->check(kTriangles)
      ->capture_default_str();
  c->add_option("--texture", o.texture_size, "width and height of the texture")
      ->check(kImageSizes)
      ->capture_default_str();
  c->add_option("--target-size", o.target_size, "width and height of the truth image")
      ->check(kImageSizes)
      ->capture_default_str();
  c->add_option("--format", format, "mesh format: glb, obj or both")
      ->check(CLI::IsMember({"glb", "obj", "both"}))
      ->capture_default_str();
  c->add_option("--texture-format", o.texture_format,
                "png or jpg (inside of a GLB), exr or tif (beside it: give it to pounce with "
                "--source-texture)")
      ->check(CLI::IsMember({"png", "jpg", "exr", "tif"}))
      ->capture_default_str();
  c->callback([&run, &o, &format] {
    o.glb = format != "obj";
    o.obj = format != "glb";
    run = [&o] { return make_head(o); };
  });
}

void add_shell(CLI::App& app, std::function<Paths()>& run, ShellOptions& o) {
  CLI::App* c = app.add_subcommand("shell",
                                   "a bent plate two texels thick whose sides have different "
                                   "colours, a target of the same shape "
                                   "with other UVs, and the exact answer");
  c->add_option("-o,--output", o.folder, "folder, made if missing")->required();
  c->add_option("--texture", o.texture_size, "width and height of texture and truth")
      ->check(CLI::Range(64, 65536))
      ->capture_default_str();
  c->callback([&run, &o] { run = [&o] { return make_shell(o); }; });
}

void add_channels(CLI::App& app, std::function<Paths()>& run, std::string& folder) {
  CLI::App* c = app.add_subcommand(
      "channels",
      "a model with baseColor 1024, metallicRoughness 256 and occlusion 512 (second UV set, "
      "texture "
      "transform), a target, and per channel the bilinear lookup at the analytic UV");
  c->add_option("-o,--output", folder, "folder, made if missing")->required();
  c->callback([&run, &folder] { run = [&folder] { return make_channels(folder); }; });
}

void add_one_texel(CLI::App& app, std::function<Paths()>& run, OneTexelOptions& o) {
  CLI::App* c = app.add_subcommand(
      "one-texel",
      "the smallest job of given file formats: what pounce needs for it is the baseline that its "
      "memory budget is measured against");
  c->add_option("-o,--output", o.folder, "folder, made if missing")->required();
  c->add_option("--mesh-format", o.mesh_format, "glb or obj")
      ->check(CLI::IsMember({"glb", "obj"}))
      ->capture_default_str();
  c->add_option("--image-format", o.image_format, "png, jpg, exr or tif")
      ->check(CLI::IsMember({"png", "jpg", "exr", "tif"}))
      ->capture_default_str();
  c->callback([&run, &o] { run = [&o] { return make_one_texel(o); }; });
}

void add_plain(CLI::App& app, std::function<Paths()>& run, PlainOptions& o, const char* name,
               const char* about, Paths (*make)(const PlainOptions&), unsigned largest_tiles) {
  CLI::App* c = app.add_subcommand(name, about);
  c->add_option("-o,--output", o.path, "a .glb or .obj file")->required();
  c->add_option("--triangles", o.triangles, "how many, about")
      ->check(kTriangles)
      ->capture_default_str();
  c->add_option("--texture", o.texture_size,
                "width and height of a texture, or of each of a set NAME.<UDIM>.png; 0: none")
      ->check(CLI::Range(0, 65536))
      ->capture_default_str();
  c->add_option("--uv-tiles", o.uv_tiles, "spread the charts over this many UDIM tiles")
      ->check(CLI::Range(1U, largest_tiles))
      ->capture_default_str();
  c->callback([&run, &o, make] { run = [&o, make] { return make(o); }; });
}

void add_odd(CLI::App& app, std::function<Paths()>& run, std::string& folder) {
  CLI::App* c = app.add_subcommand(
      "odd",
      "a folder of odd inputs, each named by what is odd about it: some must work, some must be "
      "refused with a clear message");
  c->add_option("-o,--output", folder, "folder, made if missing")->required();
  c->callback([&run, &folder] { run = [&folder] { return make_odd(folder); }; });
}

void add_splats(CLI::App& app, std::function<Paths()>& run, SplatOptions& o) {
  CLI::App* c =
      app.add_subcommand("splats",
                         "a splat scene (3DGS PLY, SPZ 2) as training leaves it behind: a noisy "
                         "surface, needles, a hidden "
                         "interior, floaters and haze; any number of splats in constant memory");
  c->footer(
      "How many splats there are of each kind, their spacing and the noise's sigma stand in the "
      "PLY's comments.\nRows of all kinds are mixed through the file. Colours are degree 0; higher "
      "degrees hold small noise.");
  c->add_option("-o,--output", o.path, "a .ply or .spz file; its folder is made if missing")
      ->required();
  c->add_option("--shape", o.shape,
                "head: with the head's sharp picture; sphere: radius 1, with broad waves")
      ->check(CLI::IsMember({"head", "sphere"}))
      ->capture_default_str();
  c->add_option("--count", o.count,
                "rows, all kinds together (68 bytes each at degree 0, 248 at 3)")
      ->check(CLI::Range(std::uint64_t{1}, std::uint64_t{1000000000}))
      ->capture_default_str();
  c->add_option("--sh-degree", o.sh_degree, "degree of the spherical harmonics")
      ->check(CLI::Range(0U, 3U))
      ->capture_default_str();
  c->add_option("--seed", o.seed, "another seed, another scene")->capture_default_str();
  c->add_option("--noise", o.noise,
                "sigma of the surface's means along its normal, in spacings of the splats")
      ->check(CLI::Range(0.0, 100.0))
      ->capture_default_str();
  const CLI::Range part(0.0, 1.0);
  c->add_option("--needles", o.needles, "part of the surface's splats that are long and thin")
      ->check(part)
      ->capture_default_str();
  c->add_option("--interior", o.interior, "part of all splats that hide below the surface")
      ->check(part)
      ->capture_default_str();
  c->add_option("--floaters", o.floaters, "part of all splats that float outside")
      ->check(part)
      ->capture_default_str();
  c->add_option("--haze", o.haze, "part of all splats that are large and nearly transparent")
      ->check(part)
      ->capture_default_str();
  c->add_option("--broken", o.broken,
                "rows of each kind that a reader must filter: NaN, rotation of zeros, infinite "
                "scale, 1e7 away, opacity of 6e-6")
      ->check(CLI::Range(std::uint64_t{0}, std::uint64_t{1000000}))
      ->capture_default_str();
  c->add_option(
       "--target-size", o.target_size,
       "also write NAME_target.glb, the same surface with UVs, and the right answer for it "
       "as NAME_target.truth.png of this width and height; 0: neither")
      ->check(CLI::Range(0, 65536))
      ->capture_default_str();
  c->add_option("--target-offset", o.target_offset,
                "move the target outward along its normals, in percent of its diagonal; negative: "
                "inward")
      ->check(CLI::Range(-10.0, 10.0))
      ->capture_default_str();
  c->add_flag(
      "--points", o.points,
      "write a coloured point cloud (PLY) instead, as a scanner leaves it behind: the noisy "
      "surface's places and colours, and nothing else");
  c->callback([&run, &o] { run = [&o] { return make_splats(o); }; });
}

int run_program(int argc, char** argv) {
  CLI::App app(kAbout, "pounce-fixture");
  app.require_subcommand(1);
  HeadOptions head;
  ShellOptions shell;
  OneTexelOptions one_texel;
  PlainOptions sphere, plane;
  SplatOptions splats;
  std::string head_format = "glb", channels_folder, odd_folder;
  std::function<Paths()> run;
  add_head(app, run, head, head_format);
  add_shell(app, run, shell);
  add_channels(app, run, channels_folder);
  add_one_texel(app, run, one_texel);
  add_plain(app, run, sphere, "sphere", "a big plain sphere of six charts", make_sphere, 6);
  add_plain(app, run, plane, "plane", "a big plain plane, one chart per UDIM tile", make_plane,
            100);
  add_splats(app, run, splats);
  add_odd(app, run, odd_folder);
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& e) {
    return app.exit(e) == 0 ? 0 : pounce::exit_status(pounce::ErrorKind::usage);
  }
  for (const std::string& path : run()) std::printf("%s\n", path.c_str());
  return 0;
}

}  // namespace

int main(int argc, char** argv) try {
  return run_program(argc, argv);
} catch (const pounce::Error& e) {
  std::fprintf(stderr, "pounce-fixture: error: %s\n", e.what());
  return pounce::exit_status(e.kind());
} catch (const std::exception& e) {
  std::fprintf(stderr, "pounce-fixture: internal error: %s (please report)\n", e.what());
  return 70;
}
