# SPDX-License-Identifier: Apache-2.0
"""What bench/table.py should show: the goals, as far as the parts that were run tell."""
import statistics
import sys

from table_parts import BLENDER, COLD, EIGHTH, OTHER_CPU, OURS, RIVAL, TENT, TWO, WARM

OUR_CORE = ("precondition", "vectorize", "project")
RIVALS_CORE = ("build", "transfer")


def ratio(rows, over, under, figure=lambda row: row["cpu_s"]):
    """None where one of them was not run, or failed."""
    if "cpu_s" not in rows.get(over, {}) or "cpu_s" not in rows.get(under, {}):
        return None
    below = figure(rows[under])
    return figure(rows[over]) / below if below else None


def core_of(stages):
    return lambda row: sum(row["stages"].get(stage, 0) for stage in stages)


def project(row):
    return row["stages"].get("project", 0)


def per_texel(row):
    return row["cpu_s"] / row["covered"]


def of_heads(tables):
    start = next((t["rows"][OURS].get("wall_s", 0) for t in tables if t["facts"].get("start")), 0)
    firsts = {}
    for table in tables:
        size, rows, title = table["facts"].get("size"), table["rows"], table["group"]
        if size is None or "cpu_s" not in rows[OURS]:
            continue
        most = {1024: 1.2, 4096: 0.9}.get(size)
        if most:
            yield f"{title}: pounce to {RIVAL}", ratio(rows, OURS, RIVAL), "<=", most
            yield f"{title}: pounce to Blender", ratio(rows, OURS, BLENDER), "<=", 1 / 9
        yield f"{title}: default filter to tent", ratio(rows, OURS, TENT), "<=", 1.3
        if size >= 1024 and "stages" in rows.get(RIVAL, {}):
            ours, rivals = core_of(OUR_CORE)(rows[OURS]), core_of(RIVALS_CORE)(rows[RIVAL])
            yield f"{title}: core, pounce to {RIVAL}", ours / rivals, "<=", 0.5
        if size >= 2048 and "wall_s" in rows.get(TWO, {}):
            # Of one thread on a CPU of the mean speed of both.
            alone = [rows[name]["wall_s"] - start for name in (OURS, OTHER_CPU) if "wall_s" in rows.get(name, {})]
            gain = statistics.harmonic_mean(alone) / (rows[TWO]["wall_s"] - start)
            yield f"{title}: 2 threads, times faster without start-up", gain, ">=", 1.85
        target = table["facts"]["target"]
        if size == 1024:
            firsts[target] = per_texel(rows[OURS])
        if size == 8192 and target in firsts:
            yield f"{title}: per texel, to 1024 x 1024", per_texel(rows[OURS]) / firsts[target], "<=", 1.0


def of_triangles(tables):
    for table in tables:
        if table["facts"]["triangles"] == 1_000_000:
            yield f"{table['group']}: pounce to {RIVAL}", ratio(table["rows"], OURS, RIVAL), "<=", 1.0


def of_budgets(tables):
    for table in tables:
        rows, title = table["rows"], table["group"]
        yield f"{title}: {EIGHTH} to in memory", ratio(rows, EIGHTH, OURS), "<=", 1.3
        yield f"{title}: {WARM} to {COLD}", ratio(rows, WARM, COLD), "<=", 0.6


def of_maps(tables):
    for table in tables:
        share = ratio(table["rows"], "two maps", "one map", project)
        yield "a second map, share of the project stage", share - 1 if share else None, "<=", 0.35


def of_isa(tables):
    for table in tables:
        yield "project stage, AVX2 to AVX-512", ratio(table["rows"], "avx2", "avx512", project), "<=", 1.2
        yield "project stage, SSE2 to AVX-512", ratio(table["rows"], "sse2", "avx512", project), "<=", 2.0


def of_materials(tables):
    for table in tables:
        row = table["rows"].get("1024 materials", {})
        yield "1024 materials, CPU seconds", row.get("cpu_s"), "<=", 3.0


GOALS = {"heads": of_heads, "triangles": of_triangles, "splats": of_budgets, "maps": of_maps,
         "materials": of_materials, "isa": of_isa, "budgets": of_budgets}


def lines_of(document):
    """What was measured beside what is asked for, a line each."""
    for part, goals in GOALS.items():
        tables = [table for table in document["tables"] if table["part"] == part]
        for name, measured, relation, asked in goals(tables):
            if measured is not None:
                met = measured <= asked if relation == "<=" else measured >= asked
                yield f"{part}: {name}: {measured:.3f}, asked {relation} {asked:.3g}{'' if met else '  MISSED'}"


def self_test():
    def row(cpu_s, wall_s=1.0, covered=100, **stages):
        return {"cpu_s": cpu_s, "wall_s": wall_s, "covered": covered, "stages": stages}

    def lines(part, rows, **facts):
        return list(lines_of({"tables": [{"part": part, "group": "g", "facts": facts, "rows": rows}]}))

    heads = {OURS: row(2.0, precondition=0.5, vectorize=0.25, project=0.25, encode=1.0), TENT: row(1.0),
             RIVAL: row(2.0, build=0.5, transfer=1.5, read=3.0), TWO: row(2.1, wall_s=0.5)}
    assert lines("heads", heads, size=1024, target="t") == [
        "heads: g: pounce to Embree, footprints: 1.000, asked <= 1.2",
        "heads: g: default filter to tent: 2.000, asked <= 1.3  MISSED",
        "heads: g: core, pounce to Embree, footprints: 0.500, asked <= 0.5"]
    assert lines("heads", heads, size=2048, target="t")[-1] == (
        "heads: g: 2 threads, times faster without start-up: 2.000, asked >= 1.85")
    heads[OTHER_CPU] = row(2.0, wall_s=0.5)  # twice as fast: both together do three in a second
    assert lines("heads", heads, size=2048, target="t")[-1] == (
        "heads: g: 2 threads, times faster without start-up: 1.333, asked >= 1.85  MISSED")
    assert lines("maps", {"one map": row(9.0, project=1.0), "two maps": row(9.0, project=1.25)}) == [
        "maps: a second map, share of the project stage: 0.250, asked <= 0.35"]
    assert lines("maps", {"one map": row(9.0, project=1.0), "two maps": {"failed": "ended with 4"}}) == []
    assert lines("budgets", {OURS: row(1.0), EIGHTH: row(1.5), COLD: row(1.0), WARM: row(0.5)}) == [
        "budgets: g: an eighth of the stores to in memory: 1.500, asked <= 1.3  MISSED",
        "budgets: g: warm cache to empty cache: 0.500, asked <= 0.6"]
    assert lines("formats", {"PNG to PNG": row(1.0)}) == []
    print("ok")


if __name__ == "__main__":
    sys.exit(self_test())
