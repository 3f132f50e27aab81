#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Compares two runs of pounce_bench or of table.py, or gives the ratio of two benchmarks of one run.

  compare.py old.json new.json             what changed, benchmark by benchmark; of tables, which rows are slower
  compare.py run.json --ratio A B          how many times longer A takes than B, e.g.
                                           --ratio literal_same/1024 transfer_in_core/same/1024/threads:1

Times are medians over repetitions (5 at least, else nothing is concluded) of CPU time per iteration:
on a machine that others use, too, wall time measures the others. --real takes wall time, --counter C
the counter C (one that is better when smaller, e.g. kernel). With --ratio, A:counter names a counter for
one side: --ratio literal_same/1024:per_texel transfer_in_core/same/1024/threads:1:kernel

A change counts when it is larger than the noise: the two runs' spreads (half the distance between the
quartiles, scaled to a normal deviation) put together, twice over, and 2 % at least. Else the answer is
"hidden in the noise". Exit status: 0, or 1 if something became slower.

Of two tables each row of pounce is compared, by the median of its CPU time (or with --real its wall time): one
that takes more than 1.1 times of the old, or fails where it did not, is listed, and the exit status is 1. So it
is if no row is in both.
"""
import argparse
import json
import re
import statistics
import sys

LEAST_REPETITIONS = 5
LEAST_CHANGE = 0.02
MOST_OF_OLD = 1.1
NS = {"ns": 1.0, "us": 1e3, "ms": 1e6, "s": 1e9}


def plain_name(name):
    """The name without what the library adds for how it was measured."""
    return re.sub(r"/(real_time|process_time|repeats:\d+|min_time:[\d.]+)", "", name)


def read_runs(document, key):
    """Benchmark name -> the values of its repetitions."""
    runs = {}
    for entry in document["benchmarks"]:
        if entry.get("run_type", "iteration") != "iteration" or key not in entry:
            continue
        scale = NS[entry["time_unit"]] if key in ("cpu_time", "real_time") else 1.0
        runs.setdefault(plain_name(entry["name"]), []).append(entry[key] * scale)
    return runs


def spread(values):
    """A robust standard deviation of the median's estimate, relative to the median."""
    low, _, high = statistics.quantiles(values, n=4, method="inclusive")
    median = statistics.median(values)
    return (high - low) / 1.349 * 1.2533 / len(values) ** 0.5 / median if median > 0 else 0.0


def judge(old, new):
    """(change, noise, verdict) of two lists of values, smaller is better."""
    if min(len(old), len(new)) < LEAST_REPETITIONS:
        return None, None, f"fewer than {LEAST_REPETITIONS} repetitions"
    before, after = statistics.median(old), statistics.median(new)
    if not before > 0:
        return None, None, "nothing measured"
    change = after / before - 1
    noise = 2 * (spread(old) ** 2 + spread(new) ** 2) ** 0.5
    if abs(change) <= max(noise, LEAST_CHANGE):
        return change, noise, "hidden in the noise" if noise > LEAST_CHANGE else "same"
    return change, noise, "SLOWER" if change > 0 else "faster"


def shown(value, key):
    if key not in ("cpu_time", "real_time"):
        return f"{value:.4g}"
    for unit, size in (("s", 1e9), ("ms", 1e6), ("us", 1e3)):
        if value >= size:
            return f"{value / size:.4g} {unit}"
    return f"{value:.4g} ns"


def compare(old, new, key):
    slower = False
    before, after = read_runs(old, key), read_runs(new, key)
    print(f"{'benchmark':<52} {'old':>10} {'new':>10} {'change':>8} {'noise':>7}")
    for name in sorted(before):
        if name not in after:
            print(f"{name:<52} only in the old run")
            continue
        change, noise, verdict = judge(before[name], after[name])
        medians = [shown(statistics.median(runs[name]), key) for runs in (before, after)]
        numbers = f"{change:+8.1%} {noise:7.1%}" if change is not None else " " * 16
        print(f"{name:<52} {medians[0]:>10} {medians[1]:>10} {numbers}  {verdict}")
        slower = slower or verdict == "SLOWER"
    for name in sorted(after):
        if name not in before:
            print(f"{name:<52} only in the new run")
    return slower


def values_of(document, wanted, default_key):
    """The values of "name" or "name:counter"."""
    runs = read_runs(document, default_key)
    if wanted in runs:
        return runs[wanted]
    name, _, counter = wanted.rpartition(":")
    runs = read_runs(document, counter) if name else {}
    if name not in runs:
        sys.exit(f"compare.py: this run has no benchmark {wanted}")
    return runs[name]


def ratio(document, names, key):
    values = [values_of(document, name, key) for name in names]
    result = statistics.median(values[0]) / statistics.median(values[1])
    if min(map(len, values)) < LEAST_REPETITIONS:
        print(f"{result:.2f} (fewer than {LEAST_REPETITIONS} repetitions: not to be relied on)")
        return
    noise = 2 * (spread(values[0]) ** 2 + spread(values[1]) ** 2) ** 0.5
    print(f"{result:.2f} +- {result * noise:.2f}")


def rows_of(document):
    """(part, group, row) -> figures of pounce's own rows of a table."""
    if not all("part" in table for table in document["tables"]):
        sys.exit("compare.py: a table without parts, of an earlier table.py: measure that release again")
    return {(table["part"], table["group"], name): row for table in document["tables"]
            for name, row in table["rows"].items() if row["is_ours"]}


def compare_tables(old, new, key):
    """The lines to print of two tables, and whether a row is slower."""
    before, after = rows_of(old), rows_of(new)
    lines, slower, faster, compared = [], 0, 0, 0
    if old["processor"] != new["processor"]:
        lines.append(f"other processors: {old['processor']}, then {new['processor']}; times say little")
    for place, row in after.items():
        name, past = ": ".join(place), before.get(place)
        if past is None or "failed" in past:
            lines.append(f"{name}: only in the new run")
            continue
        compared += 1
        if "failed" in row:
            lines.append(f"{name}: FAILED: {row['failed']}")
            slower += 1
            continue
        ratio_of_old = row[key] / past[key]
        if ratio_of_old > MOST_OF_OLD:
            lines.append(f"{name}: {past[key]:.3f} s, now {row[key]:.3f} s: {ratio_of_old:.2f}x  SLOWER")
            slower += 1
        elif ratio_of_old < 1 / MOST_OF_OLD:
            faster += 1
    lines += [f"{': '.join(place)}: only in the old run" for place in before if place not in after]
    lines.append(f"{compared} rows: {slower} slower than {MOST_OF_OLD}x or failed, {faster} faster by as much")
    return lines, slower > 0 or compared == 0


def self_test_of_tables():
    def table(processor="p", **rows):
        return {"processor": processor, "tables": [{"part": "heads", "group": "1024", "rows": {
            name: {"is_ours": name != "rival", **(row if isinstance(row, dict) else {"cpu_s": row, "wall_s": 1.0})}
            for name, row in rows.items()}}]}
    failed = {"failed": "ended with 4"}
    old = table(a=1.0, b=2.0, rival=1.0)
    assert compare_tables(old, table(a=1.09, b=2.19, rival=9.0), "cpu_s")[1] is False
    lines, slower = compare_tables(old, table(a=1.11, b=1.0, rival=1.0), "cpu_s")
    assert slower and lines[0] == "heads: 1024: a: 1.000 s, now 1.110 s: 1.11x  SLOWER"
    assert lines[-1] == "2 rows: 1 slower than 1.1x or failed, 1 faster by as much" and len(lines) == 2
    assert compare_tables(old, table(a=1.11, b=2.0), "wall_s")[1] is False
    assert compare_tables(old, table(a=1.0, b=failed), "cpu_s")[1] is True
    assert compare_tables(table(a=failed, b=1.0), table(a=1.0, b=1.0), "cpu_s")[1] is False
    assert compare_tables(table(a=1.0), table(c=1.0), "cpu_s")[1] is True  # nothing that could be compared
    lines, slower = compare_tables(old, table("q", a=1.0, c=1.0), "cpu_s")
    assert not slower and "other processors" in lines[0]
    assert "heads: 1024: c: only in the new run" in lines and "heads: 1024: b: only in the old run" in lines


def self_test():
    def run(name, times, **counters):
        return [{"name": name, "run_type": "iteration", "cpu_time": t, "real_time": 2 * t,
                 "time_unit": "ms", **counters} for t in times]
    steady, noisy = [100, 101, 99, 100, 100], [100, 150, 60, 120, 80]
    assert judge(steady, [110, 111, 109, 110, 110])[2] == "SLOWER"
    assert judge(steady, [90, 91, 89, 90, 90])[2] == "faster"
    assert judge(steady, [101, 101, 100, 101, 101])[2] == "same"
    assert judge(noisy, [x * 1.1 for x in noisy])[2] == "hidden in the noise"
    assert judge(steady, steady[:4])[2] == "fewer than 5 repetitions"
    old = {"benchmarks": run("a/1/real_time", steady, kernel=50) + run("b/threads:2", noisy)}
    aggregate = {"name": "a/1_mean", "run_type": "aggregate", "cpu_time": 7, "time_unit": "ms"}
    old["benchmarks"].append(aggregate)
    assert read_runs(old, "cpu_time")["a/1"] == [t * 1e6 for t in steady]
    assert read_runs(old, "real_time")["a/1"][0] == 200e6
    assert values_of(old, "a/1:kernel", "cpu_time") == [50] * 5
    assert values_of(old, "b/threads:2", "cpu_time")[1] == 150e6
    self_test_of_tables()
    print("ok")


def main():
    parser = argparse.ArgumentParser(description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("runs", nargs="*", metavar="run.json")
    parser.add_argument("--ratio", nargs=2, metavar=("A", "B"))
    parser.add_argument("--real", action="store_true", help="wall time instead of CPU time")
    parser.add_argument("--counter", help="a counter instead of time")
    parser.add_argument("--self-test", action="store_true")
    options = parser.parse_args()
    if options.self_test:
        self_test()
        return 0
    key = options.counter or ("real_time" if options.real else "cpu_time")
    if len(options.runs) != (1 if options.ratio else 2):
        parser.error("two runs are compared; --ratio takes one")
    documents = []
    for path in options.runs:
        with open(path, encoding="utf-8") as file:
            documents.append(json.load(file))
    if options.ratio:
        ratio(documents[0], options.ratio, key)
        return 0
    are_tables = ["tables" in document for document in documents]
    if all(are_tables):
        if options.counter:
            parser.error("tables have no counters")
        lines, slower = compare_tables(*documents, "wall_s" if options.real else "cpu_s")
        print("\n".join(lines))
        return 1 if slower else 0
    if any(are_tables):
        parser.error("a table is compared with a table")
    return 1 if compare(*documents, key) else 0


if __name__ == "__main__":
    sys.exit(main())
