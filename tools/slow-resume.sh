#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Jobs that are killed and go on: a 16384² image killed at 90 %, and ten times in a row; then random kills of jobs of
# every kind (mesh, splats, UDIM tiles, model, .tx, painting over), one to seven in a row, each followed by the same
# command. Same bytes, nothing left, and how much of the work is done twice. Generated input, in
# build/release/slow/resume.
# Usage: tools/slow-resume.sh [KILLS] [SEED] [small]
# (default 200 and 1: jobs of half a minute on two cores, hours; small: 2/7 of the texels)
set -euo pipefail
cd "$(dirname "$0")/.."
[[ -x build/release/pounce && -x build/release/pounce-fixture ]] || { echo "build first: tools/test.sh" >&2; exit 2; }
exec python3 - "$PWD" "${1:-200}" "${2:-1}" "${3:-large}" <<'PY'
import filecmp, json, os, random, resource, shutil, signal, subprocess, sys, time

root, kills, seed = sys.argv[1], int(sys.argv[2]), int(sys.argv[3])
edge = 8192 if sys.argv[4] == "small" else 15360
pounce, fixture = root + "/build/release/pounce", root + "/build/release/pounce-fixture"
work = root + "/build/release/slow/resume"
shutil.rmtree(work, ignore_errors=True)
os.makedirs(work)
os.chdir(work)
failures = 0

def check(what, good):
    global failures
    failures += not good
    print("%s  %s" % ("ok    " if good else "FAILED", what), flush=True)

def make(*arguments):
    subprocess.run([fixture, *arguments], check=True, stdout=subprocess.DEVNULL)

def run(job, kill_at=None, later_s=0):
    """Runs a job, kills it some time after its progress is beyond a fraction; returns CPU seconds, whether it was
    killed, and its status."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    process = subprocess.Popen([pounce, *job, "--progress", "json"], stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)
    said = []
    for line in process.stderr:
        said.append(line)
        try:
            fraction = json.loads(line).get("fraction", 0)
        except ValueError:
            continue
        if kill_at is not None and fraction > kill_at:
            time.sleep(later_s)
            process.kill()
            break
    process.stderr.close()
    status = process.wait()
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    cpu = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    killed = status == -signal.SIGKILL
    if not killed and status != 0:
        print("status", status, said[-3:])
    return cpu, killed, status

def outputs(folder):
    found = {}
    for base, _, names in os.walk(folder):
        for name in names:
            found[os.path.relpath(os.path.join(base, name), folder)] = os.path.join(base, name)
    return found

def same(a, b):
    a, b = outputs(a), outputs(b)
    return a.keys() == b.keys() and all(filecmp.cmp(a[name], b[name], shallow=False) for name in a)

make("plane", "-o", "plane.glb", "--triangles", "200000", "--texture", "2048")
make("head", "-o", "head", "--texture", "1024", "--target-size", "64")
make("splats", "-o", "scene/scene.ply", "--count", "400000", "--target-size", "64")
make("plane", "-o", "tiles.obj", "--triangles", "20000", "--uv-tiles", "6", "--texture", "512")

def fresh(folder):
    shutil.rmtree(folder, ignore_errors=True)
    os.makedirs(folder)

# --- one large image -----------------------------------------------------------------------------

def large(folder):
    return ["transfer", "plane.glb", "plane.glb", "-o", folder + "/o.png", "--size", "16384", "--cache", "cache"]

fresh("quiet")
run(large("quiet"))  # fills the cache
fresh("quiet")
quiet, _, _ = run(large("quiet"))
fresh("one")
first, killed, _ = run(large("one"), 0.9)
second, _, _ = run(large("one"))
check("16384², killed at 90 %%: the second run takes %.0f %% of a quiet one's %.1f s" % (100 * second / quiet, quiet),
      killed and second <= 0.15 * quiet)
check("the same bytes, nothing left", same("quiet", "one"))
fresh("ten")
total, met = 0, 0
for i in range(10):
    cpu, killed, _ = run(large("ten"), 0.05 + 0.09 * i)
    total += cpu
    met += killed
total += run(large("ten"))[0]
check("killed %d times in a row: all runs take %.2f times the quiet one" % (met, total / quiet), met == 10 and total <= 1.3 * quiet)
check("the same bytes, nothing left", same("quiet", "ten"))

# --- kills at random -----------------------------------------------------------------------------

scene = [name for name in outputs("scene").values() if name.endswith((".glb", ".obj"))]
def kinds(folder):
    head, other = "head/head_src.glb", "head/head_other.glb"
    jobs = {
        "mesh": ["transfer", head, other, "-o", folder + "/o.png", "--size", str(edge), "--coverage", folder + "/m.png"],
        "UDIM": ["transfer", "tiles.obj", "tiles.obj", "--source-texture", "baseColor=tiles.<UDIM>.png", "-o", folder + "/o.<UDIM>.png", "--size", str(edge * 3 // 8)],
        "model": ["transfer", head, other, "-o", folder + "/o.glb", "--size", str(edge)],
        ".tx": ["transfer", head, other, "-o", folder + "/o.tx", "--size", str(edge)],
        "EXR": ["transfer", head, other, "-o", folder + "/o.exr", "--depth", "half", "--size", str(edge)],
        "onto": ["transfer", head, other, "-o", folder + "/o.png", "--onto", "below.png"],
        # A set that is painted over in place, under a soft mask: painted twice it is another set.
        "in place": ["transfer", "tiles.obj", "tiles.obj", "--source-texture", "baseColor=tiles.<UDIM>.png",
                     "-o", folder + "/o.<UDIM>.png", "--onto", folder + "/o.<UDIM>.png", "--mask", "soft.pgm"],
        "normals": ["transfer", head, other, "--bake", "normal", "-o", folder + "/o.png", "--size", str(edge)],
        "maps": ["maps", other, "-o", folder + "/o.<CHANNEL>.exr", "--size", str(edge // 2)],
        "splats": ["transfer", "scene/scene.ply", scene[0], "-o", folder + "/o.png", "--size", str(edge // 2)],
    }
    return jobs

def begin(folder, kind):
    fresh(folder)
    if kind == "in place":
        for name in below:
            shutil.copy(name, folder)

run(["transfer", "head/head_src.glb", "head/head_other.glb", "-o", "below.png", "--size", str(edge), "--filter", "tent"])
below = ["below/o.%d.png" % udim for udim in range(1001, 1007)]
run(["transfer", "tiles.obj", "tiles.obj", "--source-texture", "baseColor=tiles.<UDIM>.png", "-o", "below/o.<UDIM>.png",
     "--size", str(edge * 3 // 8), "--filter", "tent"])
with open("soft.pgm", "wb") as mask:
    mask.write(b"P5\n%d %d\n255\n" % (edge * 3 // 8, edge * 3 // 8))
    for row in range(edge * 3 // 8):
        mask.write(b"\x60" * (edge * 3 // 8))
dice = random.Random(seed)
references, done, met, most_lost = {}, 0, 0, 0
for i in range(10 * kills):
    if done >= kills:
        break
    kind = sorted(kinds("x"))[i % len(kinds("x"))]
    if kind not in references:
        begin("reference." + kind, kind)
        began = time.monotonic()
        cpu, _, status = run(kinds("reference." + kind)[kind] + ["--no-cache"])
        references[kind] = cpu, time.monotonic() - began
        check("%s: %.1f s, %.1f s of CPU" % (kind, references[kind][1], cpu), status == 0)
    begin("killed", kind)
    job, (quiet, quiet_s) = kinds("killed")[kind] + ["--no-cache"], references[kind]
    ends, total = [], 0
    for at in sorted(dice.random() for _ in range(min(dice.randint(1, 7), kills - done))):
        # Progress is said at moments of the program's choice: from there on, any moment.
        cpu, killed, status = run(job, at, dice.random() * quiet_s / 20)
        done, met, total = done + 1, met + killed, total + cpu
        ends.append("%.0f%s" % (100 * at, "" if killed else "-"))
        if not killed and status != 0:
            check("%s ended with %d" % (kind, status), False)
    cpu, _, status = run(job)
    lost = (total + cpu - quiet) / len(ends)
    most_lost = max(most_lost, lost)
    good = status == 0 and same("reference." + kind, "killed")
    check("%-8s killed at %s %%: all runs %.2f of a quiet one, %.1f s of CPU lost by each kill" %
          (kind, " ".join(ends), (total + cpu) / quiet, lost), good and lost <= 30)
check("a kill cost at most %.1f s of CPU" % most_lost, most_lost <= 30)
check("%d of %d kills met a job at work" % (met, done), met >= 0.8 * done)
print("%d failed" % failures)
sys.exit(failures > 0)
PY
