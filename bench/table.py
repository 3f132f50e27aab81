#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""One table of whole processes in one interleaved run: pounce beside what would be used instead.

  table.py --programs DIR [--old POUNCE] [--blender BLENDER] [--sizes 512,1024,2048,4096]
           [--repetitions 5] [--json FILE] [--keep DIR]

Every row runs in turn with all others, as often as asked for, after one run that warms the system's
caches; figures are medians of CPU time (user + system, of the process and its children) and of the
largest resident size. Compare ratios of one run only. Input is made by pounce-fixture: head_src with a
texture as large as the target, onto head_same (equal shapes) and head_other (different ones), .obj and
PNG in, PNG out.
"""
import argparse
import json
import os
import platform
import shutil
import statistics
import subprocess
import sys
import tempfile
import time

# Row names, and what the ratios are counted in.
OURS, RIVAL = "pounce", "Embree, footprints"


def run(command, environment):
    """CPU seconds, wall seconds and peak MiB of a process and its children."""
    begin = time.monotonic()
    process = subprocess.Popen(command, env=environment, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE)
    error = process.stderr.read()
    _, status, usage = os.wait4(process.pid, 0)
    process.returncode = os.waitstatus_to_exitcode(status)
    if process.returncode != 0:
        sys.exit(f"{' '.join(command)}: ended with {process.returncode}\n{error.decode(errors='replace')}")
    return usage.ru_utime + usage.ru_stime, time.monotonic() - begin, usage.ru_maxrss / 1024


def rows_of(options, size, case, folder):
    """Name -> (command, environment, is it warm?) of one size and one pair of shapes."""
    pounce = os.path.join(options.programs, "pounce")
    embree = os.path.join(options.programs, "pounce_embree")
    source, target = f"{folder}/head_src", f"{folder}/{case}.obj"
    out = f"{folder}/out.png"
    environment = dict(os.environ, XDG_CACHE_HOME=f"{folder}/cache")

    def ours(program, *more):
        return [program, "transfer", f"{source}.obj", target, "-o", out, "--size", str(size), "--quiet",
                "--redo", *more]

    cold = ("--threads", "1", "--no-cache")
    rows = {
        OURS: (ours(pounce, *cold), environment),
        "pounce, --filter tent": (ours(pounce, *cold, "--filter", "tent"), environment),
        "pounce, stores in the cache": (ours(pounce, "--threads", "1"), environment),
        "pounce, 64 MiB": (ours(pounce, *cold, "--memory", "64MiB"), environment),
        "pounce, 2 threads": (ours(pounce, "--threads", "2", "--no-cache"), environment),
    }
    if options.old:
        # A release without --redo makes its images again by itself.
        known = subprocess.run([options.old, "transfer", "--help"], capture_output=True, text=True, check=False)
        rows["pounce before"] = ([a for a in ours(options.old, *cold) if a != "--redo" or a in known.stdout],
                                 environment)
    if os.path.exists(embree):
        for name, kernel in (("tent", "tent"), ("cubic", "cubic"), ("footprints", "footprint")):
            rows[f"Embree, {name}"] = ([embree, f"{source}.obj", f"{source}.png", target, out, str(size), kernel],
                                       environment)
    if options.blender:
        script = os.path.join(os.path.dirname(os.path.abspath(__file__)), "blender_bake.py")
        rows["Blender's bake"] = ([options.blender, "--background", "--factory-startup", "--threads", "1",
                                   "--python", script, "--", f"{source}.obj", target, out, str(size)], environment)
    return rows


def measure(options, size, case, folder):
    rows = rows_of(options, size, case, folder)
    seen = {name: [] for name in rows}
    for repetition in range(options.repetitions + 1):
        for name, (command, environment) in rows.items():
            figures = run(command, environment)
            if repetition > 0:
                seen[name].append(figures)
    return {name: {"cpu_s": statistics.median(run[0] for run in runs), "cpu_s_all": [run[0] for run in runs],
                   "wall_s": statistics.median(run[1] for run in runs),
                   "peak_mib": statistics.median(run[2] for run in runs)}
            for name, runs in seen.items()}


def print_table(size, case, result):
    rival = result.get(RIVAL, {}).get("cpu_s")
    print(f"\n{size} x {size}, onto {case}")
    print(f"{'':<30}{'CPU s':>9}{'of pounce':>11}{'of Embree':>11}{'wall s':>9}{'peak MiB':>10}")
    for name, figures in result.items():
        of_rival = f"{figures['cpu_s'] / rival:>10.2f}x" if rival else f"{'':>11}"
        print(f"{name:<30}{figures['cpu_s']:>9.3f}{figures['cpu_s'] / result[OURS]['cpu_s']:>10.2f}x{of_rival}"
              f"{figures['wall_s']:>9.3f}{figures['peak_mib']:>10.0f}")


def processor():
    with open("/proc/cpuinfo", encoding="utf-8") as lines:
        names = [line.split(":", 1)[1].strip() for line in lines if line.startswith("model name")]
    return names[0] if names else platform.machine()


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--programs", required=True, help="folder of pounce, pounce-fixture and pounce_embree")
    parser.add_argument("--old", help="a pounce of another state, for a row of its own")
    parser.add_argument("--blender", help="a Blender, for a row of its own")
    parser.add_argument("--sizes", default="512,1024,2048,4096")
    parser.add_argument("--shapes", default="head_same,head_other")
    parser.add_argument("--repetitions", type=int, default=5)
    parser.add_argument("--json", help="write all figures there")
    options = parser.parse_args()
    options.programs = os.path.abspath(options.programs)
    all_results = []
    print(f"{processor()}, {os.cpu_count()} CPUs; medians of {options.repetitions}")
    for size in (int(s) for s in options.sizes.split(",")):
        folder = tempfile.mkdtemp(prefix="pounce-bench-")
        try:
            run([os.path.join(options.programs, "pounce-fixture"), "head", "-o", folder, "--format", "obj",
                 "--texture", str(size), "--target-size", "16"], dict(os.environ))
            for case in options.shapes.split(","):
                result = measure(options, size, case, folder)
                print_table(size, case, result)
                sys.stdout.flush()
                all_results.append({"size": size, "target": case, "rows": result})
        finally:
            shutil.rmtree(folder)
    if options.json:
        with open(options.json, "w", encoding="utf-8") as file:
            json.dump({"processor": processor(), "repetitions": options.repetitions, "tables": all_results}, file,
                      indent=1)


if __name__ == "__main__":
    main()
