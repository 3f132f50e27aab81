# SPDX-License-Identifier: Apache-2.0
"""Kills small jobs of every kind at every call that changes a file (kill_point.cpp), then runs the same command again.
With --how eio,... lets calls fail instead, once or from there on.

After a kill every output is absent, as it was before, or right. After the second run all bytes are right, and nothing
else is there: no temporary file, no half-done pack, no part or lock in the cache, whose packs are sound.
A job whose calls fail ends well, with the right bytes, or with a status for trouble of the system and the reason in
its message; where a read or a write does half, or was interrupted before it began, it ends well.

Usage: kill_points.py POUNCE FIXTURE LIBRARY [--most POINTS_PER_JOB] [--only JOB,...] [--how before,half,zeros,short]
       [--twice] [-j PROCESSES]      (--how faults: all kinds of failing)
"""
import argparse, itertools, json, multiprocessing, os, re, shutil, subprocess, sys, tempfile

HOWS = ["before", "half", "zeros", "short"]
FAULTS = {"eio": "Input/output error", "enospc": "No space left on device", "emfile": "Too many open files", "eintr": "", "partial": ""}


def jobs():
    """By name: the arguments, files that are copied into the job's folder beforehand ({name: input}), and commands that
    run in it beforehand."""
    head = ["transfer", "IN/plane.glb", "IN/head.glb", "--size", "72", "--threads", "1"]
    cut = ["--max-distance", "60%"]
    splats = ["transfer", "IN/scene.ply", "IN/scene_target.glb", "--size", "72", "--threads", "1"]
    tiles = ["transfer", "IN/tiles.obj", "IN/tiles.obj", "--source-texture", "baseColor=IN/tiles.<UDIM>.png", "--threads", "1"]
    cached = ["--cache", "cache"]
    none = ["--no-cache"]
    alone = head[:3] + cut + cached + ["-o", "o.png", "--size", "300", "--threads", "1", "--job-folder", "job"]
    shared = tiles + cached + ["-o", "o.<UDIM>.png", "--size", "72", "--job-folder", "job"]
    return {
        "png": (head + cut + cached + ["-o", "o.png", "--coverage", "m.png", "--report", "r.json"], {}),
        "png again": (head + cut + none + ["-o", "o.png", "--coverage", "m.png"], {"o.png": "skin.png", "m.png": "skin.png"}),
        "exr": (head + cut + none + ["-o", "new/folders/o.exr", "--depth", "half"], {}),
        "tiff": (head + cut + none + ["-o", "o.tif", "--depth", "u16"], {}),
        "tx": (head + cut + none + ["-o", "o.tx"], {}),
        "jpeg": (head + cut + cached + ["-o", "o.jpg"], {}),
        "bake": (head + cut + none + ["-o", "<CHANNEL>.exr", "--bake", "normal,position"], {}),
        "map": (head + cut + cached + ["-o", "o.png", "--map", "hits.exr"], {}),
        "onto": (head + cut + none + ["-o", "o.png", "--onto", "IN/skin.png", "--mask", "IN/mask.png"], {}),
        "in place": (head + cut + none + ["-o", "o.png", "--onto", "o.png", "--mask", "IN/mask.png", "--coverage", "m.png",
                                          "--min-coverage", "1"], {"o.png": "skin.png"}),
        "set in place": (tiles + none + ["-o", "o.<UDIM>.png", "--onto", "o.<UDIM>.png", "--mask", "IN/mask.png"],
                         {"o.1001.png": "skin.png", "o.1002.png": "skin.png"}),
        "model": (head + cut + cached + ["-o", "o.glb"], {}),
        "gltf": (head + cut + none + ["-o", "model/o.gltf"], {}),
        "targets": (["transfer", "IN/plane.glb", "IN/head.glb", "IN/plane.glb", "--size", "72", "--threads", "1"] + cut + none +
                    ["-o", "<TARGET>.png", "--skip-existing"], {}),
        "udim": (tiles + cached + ["-o", "o.<UDIM>.png", "--size", "72"], {}),
        "splats": (splats + cached + ["-o", "<CHANNEL>.png", "--channels", "baseColor,confidence"], {}),
        "around": (splats + cached + ["-o", "o.png", "--look", "around", "--views", "6"], {}),
        "splats uncached": (splats + none + ["-o", "o.png"], {}),
        "gaussian": (head + cut + none + ["-o", "o.png", "--method", "gaussian"], {}),
        "apply": (["apply", "IN/hits.exr", "--source-texture", "baseColor=IN/skin.png", "-o", "o.png", "--threads", "1"] + cached, {}),
        "maps": (["maps", "IN/tiles.obj", "-o", "<CHANNEL>.<UDIM>.exr", "--size", "72", "--threads", "1"] + cached, {}),
        "ply": (["gaussians", "IN/plane.glb", "-o", "o.ply", "--threads", "1"] + cached, {}),
        "spz": (["gaussians", "IN/scene.ply", "-o", "o.spz", "--count", "500", "--threads", "1"] + none, {}),
        "glb": (["gaussians", "IN/scene.ply", "-o", "o.glb", "--threads", "1"] + none, {}),
        "prepare": (["prepare"] + [text for text in shared if text != "transfer"] + ["--tasks", "2"], {}),
        "task": (shared + ["--task", "1/2"], {}),
        "part": (alone + ["--task", "2/2"], {}),
        "assemble": (["assemble", "job"], {}, [alone + ["--task", "1/2"], alone + ["--task", "2/2"]]),
    }


class Driver:
    def __init__(self, options, folder):
        self.options, self.folder, self.inputs = options, folder, os.path.join(folder, "in")

    def make_inputs(self):
        os.makedirs(self.inputs)

        def fixture(*arguments):
            subprocess.run([self.options.fixture, *arguments], cwd=self.inputs, check=True, stdout=subprocess.DEVNULL)

        def pounce(*arguments):
            subprocess.run([self.options.pounce, *arguments, "--no-cache", "-q"], cwd=self.inputs, check=True)

        fixture("plane", "-o", "plane.glb", "--triangles", "60", "--texture", "40")
        fixture("plane", "-o", "head.glb", "--triangles", "40", "--texture", "24")
        fixture("plane", "-o", "tiles.obj", "--triangles", "24", "--uv-tiles", "2", "--texture", "40")
        fixture("splats", "-o", "scene.ply", "--count", "2000", "--target-size", "16")
        plain = ["plane.glb", "head.glb", "--max-distance", "60%"]
        pounce("transfer", *plain, "--size", "72", "--filter", "tent", "-o", "skin.png")
        pounce("transfer", *plain, "--size", "72", "-o", "x.png", "--map", "hits.exr")
        os.remove(os.path.join(self.inputs, "x.png"))
        with open(os.path.join(self.inputs, "mask.png"), "wb") as mask:
            mask.write(b"P5\n72 72\n255\n" + bytes(120 for _ in range(72 * 72)))

    def fresh(self, name, files, commands=()):
        folder = os.path.join(self.folder, name)
        shutil.rmtree(folder, ignore_errors=True)
        os.makedirs(folder)
        for to, source in files.items():
            shutil.copy(os.path.join(self.inputs, source), os.path.join(folder, to))
        for arguments in commands:
            status, said, _ = self.run(folder, arguments)
            if status != 0:
                sys.exit("%s: status %d: %s" % (arguments, status, said))
        return folder

    def run(self, folder, arguments, at=None, how="before"):
        """Returns the exit status, what was said, and what the library reports (nothing without it)."""
        command = [self.options.pounce] + [text.replace("IN/", self.inputs + "/") for text in arguments] + ["-q"]
        environment = {**os.environ, "XDG_CACHE_HOME": self.folder}
        report = folder + ".report"
        if at is not None:
            environment.update(LD_PRELOAD=self.options.library, KILL_POINT_AT=str(at), KILL_POINT_HOW=how,
                               KILL_POINT_CLOCK_MS="6000", KILL_POINT_REPORT=report)
        ended = subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True, timeout=100)
        return ended.returncode, ended.stderr, open(report).read() if at is not None and os.path.exists(report) else ""

    def tree(self, folder):
        """Outputs with their bytes; of the cache names alone, and nothing of what depends on the moment."""
        found = {}
        for base, folders, names in os.walk(folder):
            inside = os.path.relpath(base, folder)
            is_cache = inside.split("/")[0] in ("cache", "job")
            if inside == "cache/v3/resume":
                continue  # where half-done packs may be, which it keeps for `cache prune`
            if not is_cache and not folders and not names and inside != ".":
                found[inside + "/"] = b""
            for name in names:
                path = os.path.normpath(os.path.join(inside, name))
                # A part is named after the process that made it. One that died leaves its own, for the next.
                if inside == "job/parts":
                    found[re.sub(r"\.[^.]+\.\d+\.\d+(\.whole)?\.part$", ".part", path)] = b""
                    continue
                with open(os.path.join(folder, path), "rb") as file:
                    found[path] = b"" if is_cache or name == "r.json" else file.read()
                if name == "r.json":
                    json.load(open(os.path.join(folder, path)))
        return found

    def check_killed(self, folder, before, right):
        for path, content in self.tree(folder).items():
            name = os.path.basename(path)
            if path.startswith(("cache/", "job/")) or path.endswith("/") or name.startswith("."):
                continue
            if content not in (before.get(path), right.get(path)):
                return "%s is half written" % path
        for path in before:
            if not path.startswith("job/") and not os.path.exists(os.path.join(folder, path)):
                return "%s, which was there before, is gone" % path
        return ""

    def check_failed(self, folder, how, status, said, before, right):
        """What is wrong after a job whose calls failed."""
        reason = FAULTS[how.rstrip("+")]
        if status not in (0, 5, 75) or (status != 0 and not reason):
            return "status %d: %s" % (status, said.strip())
        if status != 0 and (reason not in said or "error:" not in said):
            return "status %d says no reason: %s" % (status, said.strip())
        if status == 0:
            now = self.tree(folder)
            wrong = sorted(path for path in right if not path.startswith("cache/") and now.get(path) != right[path])
            if wrong:
                return "status 0 with other bytes: " + ", ".join(wrong)
        return self.check_report(folder) or self.check_killed(folder, before, right)

    def check_report(self, folder):
        """What a report says of images that are not there."""
        path = os.path.join(folder, "r.json")
        if not os.path.exists(path):
            return ""
        report = json.load(open(path))
        told = [image["path"] for target in report["targets"] for image in target.get("images", []) if image["state"] == "written"]
        wrong = [path for path in told if path not in report["outputs"]]
        return "the report says written of " + ", ".join(wrong) if wrong else ""

    def check_again(self, folder, arguments, right):
        status, said, _ = self.run(folder, arguments)
        if status != 0:
            return "status %d: %s" % (status, said.strip())
        now = self.tree(folder)
        wrong = sorted(path for path in right if path in now and now[path] != right[path])
        more, less = sorted(now.keys() - right.keys()), sorted(right.keys() - now.keys())
        # Hits and results are stored by a run that made all of a page, labels of packs where they can be.
        less = [path for path in less
                if not path.startswith(("cache/v3/hits/", "cache/v3/results/")) and not path.endswith(".label")]
        if wrong or more or less:
            return "; ".join("%s: %s" % (what, ", ".join(paths))
                             for what, paths in (("other bytes", wrong), ("left", more), ("missing", less)) if paths)
        if "cache" in arguments:
            verified = subprocess.run([self.options.pounce, "cache", "verify", "--cache", "cache"], cwd=folder,
                                      capture_output=True, text=True)
            if verified.returncode != 0:
                return "the cache is damaged: " + verified.stdout + verified.stderr
        return ""

    def one(self, task):
        """A kill; returns what it was, and what is wrong."""
        name, at, how, second, before, right = task
        arguments, *given = jobs()[name]
        folder = self.fresh("killed-%d" % os.getpid(), *given)
        report = folder + ".report"
        if os.path.exists(report):
            os.remove(report)
        status, said, report = self.run(folder, arguments, at, how)
        if report.startswith("ended"):
            return "%s %d %s: ended" % (name, at, how), "" if status == 0 else "status %d: %s" % (status, said)
        what = "%s %s, %s" % (name, report.strip(), how)
        if how.rstrip("+") in FAULTS:
            return what, (self.check_failed(folder, how, status, said, before, right) or
                          self.check_again(folder, arguments, right))
        if status != -9:
            return what, "status %d: %s" % (status, said)
        wrong = self.check_killed(folder, before, right)
        if second and not wrong:
            self.run(folder, arguments, second, how)
            wrong = self.check_killed(folder, before, right)
            what += ", then at %d" % second
        wrong = wrong or self.check_again(folder, arguments, right)
        return what, wrong

    def plan(self, name, number):
        """The quiet run, how many calls there are, and a task for each kill."""
        arguments, *given = jobs()[name]
        folder = self.fresh("quiet", *given)
        before = self.tree(folder)
        status, said, _ = self.run(folder, arguments)
        right = self.tree(folder)
        if status != 0:
            sys.exit("%s: status %d: %s" % (name, status, said))
        points, counted = [], {}
        for how in self.options.how:
            kind = "kill" if how in HOWS else how.rstrip("+")
            if kind in counted:
                points += [(at, how) for at, call in enumerate(counted[kind], 1) if how != "half" or "write" in call]
                continue
            folder = self.fresh("counted", *given)
            status, said, report = self.run(folder, arguments, 0, how)
            calls = counted[kind] = report.splitlines()[1:]
            if status != 0 or self.tree(folder).keys() != right.keys():
                sys.exit("%s with a fast clock: status %d: %s %s" % (name, status, said, sorted(self.tree(folder).keys() ^ right.keys())))
            points += [(at, how) for at, call in enumerate(calls, 1) if how != "half" or "write" in call]
        if self.options.most and len(points) > self.options.most:
            # Spread over all, and over the jobs in another way for each.
            step = len(points) / self.options.most
            points = [points[int((i + number % 7 / 7) * step)] for i in range(self.options.most)]
        print("%-16s %3d calls (%s), %d of %s" % (name, len(calls), " ".join(
            "%d %s" % (len(list(same)), call) for call, same in itertools.groupby(sorted(calls))), len(points),
            ",".join(self.options.how)), flush=True)
        second = lambda at: at * 31 % len(calls) + 1 if self.options.twice else 0
        return [(name, at, how, second(at), before, right) for at, how in points]


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("pounce")
    parser.add_argument("fixture")
    parser.add_argument("library")
    parser.add_argument("--most", type=int, default=0)
    parser.add_argument("--only", default="")
    parser.add_argument("--how", default=",".join(HOWS))
    parser.add_argument("--twice", action="store_true", help="the run that follows is killed as well")
    parser.add_argument("-j", type=int, default=1)
    options = parser.parse_args()
    options.how = ([how + more for how in FAULTS for more in ("", "+") if how != "eintr" or not more]
                   if options.how == "faults" else options.how.split(","))
    for program in ("pounce", "fixture", "library"):
        setattr(options, program, os.path.abspath(getattr(options, program)))
    folder = tempfile.mkdtemp(prefix="pounce-kill-")
    driver = Driver(options, folder)
    failures = kills = 0
    try:
        driver.make_inputs()
        names = options.only.split(",") if options.only else list(jobs())
        tasks = list(itertools.chain.from_iterable(driver.plan(name, i) for i, name in enumerate(names)))
        with multiprocessing.Pool(options.j) as pool:
            for done, (what, wrong) in enumerate(pool.imap_unordered(driver.one, tasks, 4), 1):
                if done % 500 == 0:
                    print("%d of %d" % (done, len(tasks)), flush=True)
                kills += " killed at " in what or " failed at " in what
                failures += bool(wrong)
                if wrong:
                    print("FAILED %s: %s" % (what, wrong), flush=True)
        print("%d points met, %d failed" % (kills, failures))
        return 1 if failures or kills < 0.9 * len(tasks) else 0
    finally:
        shutil.rmtree(folder, ignore_errors=True)


if __name__ == "__main__":
    sys.exit(main())
