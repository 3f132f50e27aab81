# SPDX-License-Identifier: Apache-2.0
"""The parts of bench/table.py: the input of each, and the rows that run on it.

A part is a function from a Bench to groups; a group is one block of the table, whose first row is what the ratios
of the others are counted in.
"""
import dataclasses
import json
import os
import shutil
import subprocess

import table_input

# Names that the goals ask for.
OURS, RIVAL, BLENDER = "pounce", "Embree, footprints", "Blender's bake"
TENT, TWO, TWO_EIGHTH = "--filter tent", "2 threads", "2 threads, an eighth of the stores"
OTHER_CPU = "pounce, on the other CPU"
EIGHTH, COLD, WARM, WARM_EIGHTH = ("an eighth of the stores", "empty cache", "warm cache",
                                   "warm cache, an eighth of the stores")


@dataclasses.dataclass
class Row:
    name: str
    command: list
    environment: dict
    is_ours: bool = True   # compared with the last release's, and able to write a report
    cleared: str = ""      # a folder that is removed before each run
    budget_mib: float = 0  # of a row whose budget depends on the stores
    threads: int = 1
    cpu: int = 0           # where one thread runs: how many CPUs are faster now


@dataclasses.dataclass
class Group:
    title: str
    rows: list
    facts: dict = dataclasses.field(default_factory=dict)  # what goals choose groups by


@dataclasses.dataclass
class Scale:
    """How large the input is that no option names."""
    texture: int = 2048
    budget_sizes: tuple = (1024, 4096)
    splats: int = 300_000
    materials: tuple = (1, 64, 1024)
    material_size: int = 1024
    tile_size: int = 512


SMOKE = Scale(texture=64, budget_sizes=(256,), splats=2000, materials=(1, 4), material_size=32, tile_size=16)


class Bench:
    """The programs, what was asked for, and a folder for one part's input and output."""

    def __init__(self, options, scale, folder):
        self.options, self.scale, self.folder = options, scale, folder
        self.pounce = os.path.join(options.programs, "pounce")
        self.embree = os.path.join(options.programs, "pounce_embree")
        self.environment = dict(os.environ, XDG_CACHE_HOME=f"{folder}/cache")
        self.notes = []

    def path(self, *parts):
        return os.path.join(self.folder, *parts)

    def made(self, *parts):
        folder = self.path(*parts)
        os.makedirs(folder, exist_ok=True)
        return folder

    def fixture(self, *command):
        subprocess.run([os.path.join(self.options.programs, "pounce-fixture"), *map(str, command)],
                       stdout=subprocess.DEVNULL, check=True)

    def heads(self, texture, *more):
        """A folder with a head whose texture is as large as that."""
        folder = self.path(f"heads-{len(os.listdir(self.folder))}")
        self.fixture("head", "-o", folder, "--format", "obj", "--texture", texture, "--target-size", 16, *more)
        return folder

    def ours(self, name, job, *more, threads=1, cache=None, **fields):
        """A transfer; `cache` is its folder, None: no cache."""
        where = ["--no-cache"] if cache is None else ["--cache", cache]
        command = [self.pounce, "transfer", *map(str, job), *more, "--threads", str(threads), "--quiet", "--redo"]
        return Row(name, command + where, fields.pop("environment", self.environment), threads=threads, **fields)

    def eighth_of_stores(self, job, *more, threads=1):
        """Bytes: what a first run wrote, by eight; the least that works where that is more."""
        report = self.path("first.json")
        row = self.ours("", job, *more, "--report", report, threads=threads)
        subprocess.run(row.command, env=row.environment, check=True)
        with open(report, encoding="utf-8") as file:
            told = json.load(file)
        stores = told["bytes"]["source_store"] + told["bytes"]["target_store"]
        return max(stores // 8, told["memory"]["least"])

    def budget_rows(self, job, *more):
        """The same job in memory, in an eighth of its stores, with caches, and by two threads."""
        cold, warm = (self.path(f"{kind}-{len(os.listdir(self.folder))}") for kind in ("cold", "warm"))

        def small(name, threads, **fields):
            eighth = self.eighth_of_stores(job, *more, threads=threads)
            return self.ours(name, job, *more, "--memory", str(eighth), threads=threads, budget_mib=eighth / 2**20,
                             **fields)

        return [
            self.ours(OURS, job, *more),
            small(EIGHTH, 1),
            self.ours(COLD, job, *more, cache=cold, cleared=cold),
            self.ours(WARM, job, *more, cache=warm),
            small(WARM_EIGHTH, 1, cache=warm),
            self.ours(TWO, job, *more, threads=2),
            small(TWO_EIGHTH, 2),
        ]

    def rivals(self, source, target, out, size):
        """What would be used in place of pounce, as far as it is installed. `source` without its ending."""
        rows = []
        if os.path.exists(self.embree):
            for name, kernel in (("tent", "tent"), ("cubic", "cubic"), ("footprints", "footprint")):
                rows.append(Row(f"Embree, {name}", [self.embree, f"{source}.obj", f"{source}.png", target, out,
                                                    str(size), kernel], self.environment, is_ours=False))
        else:
            self.notes.append("no pounce_embree: libembree-dev is not installed")
        if self.options.blender:
            script = os.path.join(os.path.dirname(os.path.abspath(__file__)), "blender_bake.py")
            rows.append(Row(BLENDER, [self.options.blender, "--background", "--factory-startup", "--threads", "1",
                                      "--python", script, "--", f"{source}.obj", target, out, str(size)],
                            self.environment, is_ours=False))
        return rows


def head_job(folder, size, target="head_same", out="out.png"):
    return f"{folder}/head_src.obj", f"{folder}/{target}.obj", "-o", f"{folder}/{out}", "--size", size


def heads(bench):
    """Heads with a texture as large as the target, of the same and of another shape."""
    groups = [Group("start-up", [Row(OURS, [bench.pounce, "--version"], bench.environment, is_ours=False)],
                    {"start": True})]
    for size in bench.options.sizes:
        folder = bench.heads(size)
        for target in bench.options.shapes:
            job = head_job(folder, size, target)
            rows = [bench.ours(OURS, job), bench.ours(TENT, job, "--filter", "tent"), bench.ours(TWO, job, threads=2),
                    bench.ours(OTHER_CPU, job, cpu=1)]
            if bench.options.old:
                # A release without --redo makes its images again by itself.
                known = subprocess.run([bench.options.old, "transfer", "--help"], capture_output=True, text=True,
                                       check=False).stdout
                command = [bench.options.old, *rows[0].command[1:]]
                rows.append(Row("pounce before", [a for a in command if a != "--redo" or a in known],
                                bench.environment, is_ours=False))
            rows += bench.rivals(f"{folder}/head_src", job[1], job[3], size)
            groups.append(Group(f"{size} x {size}, onto {target}", rows, {"size": size, "target": target}))
    return groups


def triangles(bench):
    """Meshes of few and of many triangles, both of them, at one size."""
    groups, size = [], bench.scale.texture // 2
    for count in bench.options.triangles:
        folder = bench.heads(size, "--triangles", count)
        job = head_job(folder, size)
        rows = [bench.ours(OURS, job), bench.ours(TWO, job, threads=2)]
        rows += [row for row in bench.rivals(f"{folder}/head_src", job[1], job[3], size) if row.name == RIVAL]
        groups.append(Group(f"{count} triangles, {size} x {size}", rows, {"triangles": count}))
    return groups


def splats(bench):
    """A generated splat scene onto its surface."""
    scene, size = bench.path("scene.ply"), bench.scale.texture
    bench.fixture("splats", "-o", scene, "--count", bench.scale.splats, "--floaters", 0.005, "--target-size", size)
    groups = []
    for look in ("normal", "around"):
        job = scene, bench.path("scene_target.glb"), "-o", bench.path(f"{look}.png"), "--size", size, "--look", look
        groups.append(Group(f"{bench.scale.splats} splats, --look {look}, {size} x {size}", bench.budget_rows(job),
                            {"kind": "splats"}))
    return groups


def maps(bench):
    """What further maps cost beside the first."""
    size = bench.scale.texture
    folder = bench.heads(size)
    table_input.write_pngs([f"{folder}/second.png", f"{folder}/third.png"], size)
    table_input.write_pngs([f"{folder}/normal.png"], size, table_input.bent)

    def row(name, out, channels, *bakes, ending="png"):
        job = head_job(folder, size, out=f"{out}/<CHANNEL>.{ending}")
        more = ["--channels", ",".join(channels)] if channels else []
        for channel in channels:
            if channel != "baseColor":
                more += ["--source-texture", f"{channel}={folder}/{channel}.png"]
        return bench.ours(name, job, *more, *bakes)

    return [Group(f"{size} x {size}", [
        row("one map", "one", ["baseColor"]),
        row("two maps", "two", ["baseColor", "second"]),
        row("three maps", "three", ["baseColor", "second", "third"]),
        row("a normal map", "normal", ["normal"]),
        row("one map and a normal map", "both", ["baseColor", "normal"]),
        row("one map, to EXR", "plain", ["baseColor"], ending="exr"),
        row("the same, normals and heights baked", "baked", [], "--bake", "normal,height", ending="exr"),
    ])]


def materials(bench):
    """Many materials, each with an image of its own, onto one image."""
    size, rows = bench.scale.material_size, []
    target = bench.path("target.obj")
    table_input.write_quads(target, 1, lambda k: ((0, 0), 1))
    table_input.write_pngs([bench.path(f"t{k}.png") for k in range(max(bench.scale.materials))], size)
    for count in bench.scale.materials:
        source = bench.path(f"source{count}.obj")
        table_input.write_quads(source, round(count ** 0.5), lambda k: ((0, 0), 1),
                                [f"t{k}.png" for k in range(count)])
        job = source, target, "-o", bench.path(f"{count}.png"), "--size", size
        rows.append(bench.ours(f"{count} material{'s' if count > 1 else ''}", job))
    return [Group(f"images of {size} x {size}, onto {size} x {size}", rows)]


def udims(bench):
    """64 UDIM tiles, in and out, beside one image with as many texels."""
    size = bench.scale.tile_size
    one, tiled = bench.made("one"), bench.made("tiled")
    names = [1001 + k % 10 + 10 * (k // 10) for k in range(64)]
    table_input.write_pngs([f"{tiled}/skin.{number}.png" for number in names], size)
    table_input.write_pngs([f"{one}/skin.png"], 8 * size)
    inset, inner = 0.01, 0.98

    def job(folder, uvs, number, edge):
        table_input.write_quads(f"{folder}/source.obj", 8, uvs, [f"skin{number}.png"])
        table_input.write_quads(f"{folder}/target.obj", 8, uvs)
        return f"{folder}/source.obj", f"{folder}/target.obj", "-o", f"{folder}/out{number}.png", "--size", edge

    def in_one(k):
        return ((k % 8 + inset) / 8, (k // 8 + inset) / 8), inner / 8

    def in_tiles(k):
        return (k % 10 + inset, k // 10 + inset), inner

    jobs = job(one, in_one, "", 8 * size), job(tiled, in_tiles, ".<UDIM>", size)
    return [Group(f"64 tiles of {size} x {size}", [
        bench.ours(f"one image of {8 * size} x {8 * size}", jobs[0]), bench.ours("64 tiles", jobs[1]),
        bench.ours("one image, 2 threads", jobs[0], threads=2), bench.ours("64 tiles, 2 threads", jobs[1], threads=2)])]


def isa(bench):
    """Each instruction set that this processor has."""
    size, rows = bench.scale.texture, []
    job = head_job(bench.heads(size), size)
    with open("/proc/cpuinfo", encoding="utf-8") as file:
        flags = set(next((line for line in file if line.startswith("flags")), "").split())
    for name, needed in (("avx512", {"avx512bw"}), ("avx2", {"avx2", "fma"}), ("sse2", {"sse2"})):
        if needed <= flags:
            rows.append(bench.ours(name, job, environment=dict(bench.environment, POUNCE_ISA=name)))
        else:
            bench.notes.append(f"no {name} on this processor")
    return [Group(f"{size} x {size}", rows)]


def budgets(bench):
    """Heads in small budgets, with caches, by one thread and by two."""
    groups = []
    for size in bench.scale.budget_sizes:
        job = head_job(bench.heads(size), size)
        rows = bench.budget_rows(job)
        rows.insert(1, bench.ours("64 MiB", job, "--memory", "64MiB"))
        groups.append(Group(f"{size} x {size}", rows, {"kind": "heads"}))
    return groups


def formats(bench):
    """Files other than PNG, in and out."""
    size = bench.scale.texture
    folder = bench.heads(size)
    half = bench.heads(size, "--texture-format", "exr")
    rows = [bench.ours("PNG to PNG", head_job(folder, size)),
            bench.ours("PNG to .tx", head_job(folder, size, out="out.tx")),
            bench.ours("EXR half to EXR half", head_job(half, size, out="out.exr")),
            bench.ours("EXR half to .tx", head_job(half, size, out="half.tx"))]
    if shutil.which("maketx"):
        subprocess.run(["maketx", f"{folder}/head_src.png", "-o", f"{folder}/head_src.tx"],
                       stdout=subprocess.DEVNULL, check=True)
        rows.append(bench.ours(".tx to .tx", head_job(folder, size, out="two.tx"), "--source-texture",
                               f"baseColor={folder}/head_src.tx"))
    else:
        bench.notes.append("no maketx: .tx is written, not read")
    return [Group(f"{size} x {size}", rows)]


PARTS = {part.__name__: part for part in
         (heads, triangles, splats, maps, materials, udims, isa, budgets, formats)}
