#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Tables of whole processes, each part in one interleaved run: pounce beside what would be used instead.

  table.py --programs DIR [--parts heads,splats|all] [--sizes 1024,4096] [--triangles 1000,1000000]
           [--repetitions 5] [--old POUNCE] [--blender BLENDER] [--json FILE] [--check]
  table.py --check FILE         the goals beside what an earlier run measured

Within a part every row runs in turn with all others, as often as asked for, after one run that warms the
system's caches; figures are medians of CPU time (user + system, of the process and its children) and of the
largest resident size. What has one thread runs on the CPU that is fastest when its group begins. Compare ratios of
one run only. Input is made by pounce-fixture and by
table_input.py. "ns" is CPU time per covered texel of the target.

Parts: heads, triangles, splats, maps, materials, udims, isa, budgets, formats (table_parts.py); all but
materials, for which a thousand images are made, by default. compare.py compares two runs' JSON.
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

import table_goals
import table_parts

SLOW = ("materials",)


class Failed(Exception):
    pass


MOST_CPUS = 8  # that are tried; what has one thread runs on one of them


def cpus_by_speed():
    """The fastest one first, as they are now. One of two virtual CPUs may be much slower than the other one, and not for
    long: so no row of one thread runs on whichever is free."""
    def seconds(cpu):
        os.sched_setaffinity(0, {cpu})
        begin = time.thread_time()
        for _ in range(5):
            sum(range(200_000))
        return time.thread_time() - begin

    there = os.sched_getaffinity(0)
    try:
        return sorted(sorted(there)[:MOST_CPUS], key=lambda cpu: min(seconds(cpu) for _ in range(3)))
    finally:
        os.sched_setaffinity(0, there)


def run(row, report, cpus):
    """CPU seconds, wall seconds, peak MiB, covered texels and CPU seconds by stage of a process."""
    if row.cleared:
        shutil.rmtree(row.cleared, ignore_errors=True)
    command = row.command + (["--report", report] if row.is_ours else [])
    begin = time.monotonic()
    own = os.sched_getaffinity(0) if row.threads > 1 else {cpus[row.cpu % len(cpus)]}
    with subprocess.Popen(command, env=row.environment, stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
                          preexec_fn=lambda: os.sched_setaffinity(0, own)) as process:
        said = process.stdout.read()
        _, status, usage = os.wait4(process.pid, 0)
        process.returncode = os.waitstatus_to_exitcode(status)
    wall = time.monotonic() - begin
    if process.returncode != 0:
        raise Failed(f"ended with {process.returncode}: {said.decode(errors='replace').strip()[-500:]}")
    covered, stages = 0, {}
    if row.is_ours:
        with open(report, encoding="utf-8") as file:
            told = json.load(file)
        covered = told["target"]["covered"]
        for stage in told["stages"]:
            stages[stage["name"]] = stages.get(stage["name"], 0) + stage["cpu_s"]
    elif said.startswith(b"{"):  # Embree's program: milliseconds
        told = json.loads(said)
        covered = told.pop("covered")
        stages = {name: value / 1e3 for name, value in told.items()}
    return {"cpu_s": usage.ru_utime + usage.ru_stime, "wall_s": wall, "peak_mib": usage.ru_maxrss / 1024,
            "covered": covered, "stages": stages}


def medians(row, runs):
    result = {key: statistics.median(r[key] for r in runs) for key in ("cpu_s", "wall_s", "peak_mib")}
    result.update(is_ours=row.is_ours, covered=runs[-1]["covered"], cpu_s_all=[r["cpu_s"] for r in runs],
                  stages={stage: statistics.median(r["stages"][stage] for r in runs) for stage in runs[-1]["stages"]})
    if row.budget_mib:
        result["budget_mib"] = row.budget_mib
    return result


def measure(groups, repetitions, report):
    """The figures of each row, group by group. A row that fails is not run again."""
    seen = {id(row): [] for group in groups for row in group.rows}
    failed = {}
    for repetition in range(repetitions + 1):
        for group in groups:
            cpus = cpus_by_speed()
            # The next one comes first each time: what another group left in caches and memory is not one row's alone.
            first = max(repetition - 1, 0) % len(group.rows)
            for row in group.rows[first:] + group.rows[:first]:
                if id(row) in failed:
                    continue
                try:
                    figures = run(row, report, cpus)
                    if repetition > 0:
                        seen[id(row)].append(figures)
                except Failed as failure:
                    failed[id(row)] = {"is_ours": row.is_ours, "failed": str(failure)}
    return [{row.name: failed.get(id(row)) or medians(row, seen[id(row)]) for row in group.rows} for group in groups]


def print_table(table):
    rows = table["rows"]
    base = next(iter(rows))
    rival = rows.get(table_parts.RIVAL, {}).get("cpu_s")
    wide = max(36, *(len(name) + 2 for name in rows))
    print(f"\n{table['part']}: {table['group']}")
    print(f"{'':<{wide}}{'CPU s':>9}{'of first':>10}{'of Embree' if rival else '':>11}{'wall s':>9}"
          f"{'peak MiB':>10}{'ns':>8}")
    for name, row in rows.items():
        if "failed" in row:
            print(f"{name:<{wide}}{row['failed']}")
            continue
        of_first = f"{row['cpu_s'] / rows[base]['cpu_s']:.2f}x" if "cpu_s" in rows[base] else ""
        of_rival = f"{row['cpu_s'] / rival:.2f}x" if rival else ""
        per_texel = f"{row['cpu_s'] / row['covered'] * 1e9:.1f}" if row["covered"] else ""
        budget = f"   of {row['budget_mib']:.1f} MiB" if "budget_mib" in row else ""
        print(f"{name:<{wide}}{row['cpu_s']:>9.3f}{of_first:>10}{of_rival:>11}{row['wall_s']:>9.3f}"
              f"{row['peak_mib']:>10.0f}{per_texel:>8}{budget}")


def run_part(name, options, scale):
    folder = tempfile.mkdtemp(prefix="pounce-bench-")
    try:
        bench = table_parts.Bench(options, scale, folder)
        groups = table_parts.PARTS[name](bench)
        figures = measure(groups, options.repetitions, os.path.join(folder, "report.json"))
    finally:
        shutil.rmtree(folder)
    tables = [{"part": name, "group": group.title, "facts": group.facts, "rows": rows}
              for group, rows in zip(groups, figures)]
    for table in tables:
        print_table(table)
    for note in dict.fromkeys(bench.notes):
        print(f"{name}: {note}")
    sys.stdout.flush()
    return tables


def processor():
    with open("/proc/cpuinfo", encoding="utf-8") as lines:
        names = [line.split(":", 1)[1].strip() for line in lines if line.startswith("model name")]
    return names[0] if names else platform.machine()


def print_goals(document):
    print("\nGoals")
    for line in table_goals.lines_of(document):
        print(line)


def numbers(text):
    return [int(word) for word in text.split(",")]


def read_options():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--programs", help="folder of pounce, pounce-fixture and pounce_embree")
    parser.add_argument("--parts", help="some of them, by commas, or all")
    parser.add_argument("--old", help="a pounce of another state, for rows of its own")
    parser.add_argument("--blender", help="a Blender, for rows of its own")
    parser.add_argument("--sizes", type=numbers, default="512,1024,2048,4096", help="of heads")
    parser.add_argument("--shapes", type=lambda text: text.split(","), default="head_same,head_other", help="of heads")
    parser.add_argument("--triangles", type=numbers, default="1000,100000,1000000,3000000")
    parser.add_argument("--repetitions", type=int, default=5)
    parser.add_argument("--json", help="write all figures there")
    parser.add_argument("--check", nargs="?", const="", metavar="FILE",
                        help="print the goals beside what was measured, here or in FILE")
    parser.add_argument("--smoke", action="store_true", help="every part once, on small input: does everything run?")
    options = parser.parse_args()
    if options.smoke:
        options.sizes, options.triangles, options.repetitions = [64], [1000], 1
    if options.parts is None:
        options.parts = [part for part in table_parts.PARTS if options.smoke or part not in SLOW]
    else:
        options.parts = list(table_parts.PARTS) if options.parts == "all" else options.parts.split(",")
    for part in options.parts:
        if part not in table_parts.PARTS:
            parser.error(f"--parts: no part {part}; there are {', '.join(table_parts.PARTS)}")
    if not options.check and not options.programs:
        parser.error("--programs is needed")
    return options


def main():
    options = read_options()
    if options.check:
        with open(options.check, encoding="utf-8") as file:
            print_goals(json.load(file))
        return 0
    options.programs = os.path.abspath(options.programs)
    scale = table_parts.SMOKE if options.smoke else table_parts.Scale()
    document = {"processor": processor(), "cpus": os.cpu_count(), "repetitions": options.repetitions, "tables": []}
    print(f"{processor()}, {os.cpu_count()} CPUs; medians of {options.repetitions}")
    for part in options.parts:
        document["tables"] += run_part(part, options, scale)
    if options.json:
        with open(options.json, "w", encoding="utf-8") as file:
            json.dump(document, file, indent=1)
    if options.check is not None:
        print_goals(document)
    return 1 if any("failed" in row for table in document["tables"] for row in table["rows"].values()) else 0


if __name__ == "__main__":
    sys.exit(main())
