"""Measure the processor time of the first run of a script, with nothing and with all forms compiled before.

    ./fx python3 benchmarks/cold_start.py [--runs 3] [--against CHECKOUT] [--out DIR]

* README's pot with its picture and its report: the whole process with its child processes, and its parts;
* set-up of Treloar's sheet (10 x 1), elastic and relaxing, up to the first state of its path; then a second scene
  like it in the same process.

Every process is a fresh one; "cold" has an empty cache of its own. The numbers are medians of several runs.
"""

import argparse
import json
import os
import re
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path

HERE = Path(__file__).resolve().parents[1]
CASES = {"pot": ("process", "import", "run", "picture", "report", "compiler"),
         "treloar": ("first", "first compiler", "second"), "relaxing": ("first", "first compiler", "second")}


def own():
    """Return the processor time of this process, s."""
    return time.process_time()


def compiler():
    """Return the processor time of the child processes that have ended (the compiler), s."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def pot():
    """Return {part: seconds} of README's script, run in this process and its working folder."""
    (script,) = re.findall(r"```python\n(.*?)```", (HERE / "README.md").read_text(), flags=re.S)
    began = own()
    import formingx as fx
    found = {"import": own() - began}

    def timed(name, method):
        def measured(*given, **more):
            start = own()
            try:
                return method(*given, **more)
            finally:
                found[name] = own() - start
        return measured
    for name, method in (("picture", "view3d"), ("report", "report")):
        setattr(fx.Path, method, timed(name, getattr(fx.Path, method)))
    fx.Process.run = timed("run", fx.Process.run)
    exec(compile(script, "README.md", "exec"), {"__name__": "__main__"})
    return found | {"compiler": compiler(), "process": own() + compiler()}


def sheet(relaxes):
    """Return {part: seconds} of the set-up of a sheet, in this process."""
    import formingx as fx
    from formingx.solve.path_following import Run
    begun, follow = [], Run.follow

    def noted(*given, **more):
        begun.append(own())
        return follow(*given, **more)
    Run.follow = noted
    material = fx.NeoHookean(c10=2.0)
    found = {}
    for name in ("first", "second"):
        started, before = own(), compiler()
        scene = fx.Scene(mesh=fx.mesh.disc(radius=1.25, thickness=0.082, elements=(10, 1)),
                         materials=fx.Viscoelastic(material, [(1.0, 1.0)]) if relaxes else material,
                         supports=[fx.Symmetry("axis"), fx.SimplySupported("rim")], loads=[fx.Pressure("bottom")])
        fx.trace(scene, until=fx.pole_stretch(1.01), progress=False)
        found[name] = begun[-1] - started
        found[f"{name} compiler"] = compiler() - before
    return found


def measured(case, checkout, runs):
    """Return {"cold" and "warm": {part: median of the runs, s}}."""
    def run(cache):
        with tempfile.TemporaryDirectory() as folder:
            done = subprocess.run([sys.executable, str(Path(__file__).resolve()), "--child", case], cwd=folder,
                                  env=os.environ | {"PYTHONPATH": str(checkout), "XDG_CACHE_HOME": cache},
                                  capture_output=True, text=True, timeout=600, check=True)
        return json.loads(done.stdout.splitlines()[-1])

    def medians(rows):
        return {part: sorted(row[part] for row in rows)[len(rows) // 2] for part in CASES[case]}
    cold = []
    for _ in range(runs):
        with tempfile.TemporaryDirectory() as cache:
            cold.append(run(cache))
            warm = [run(cache) for _ in range(runs)] if len(cold) == runs else []
    return {"cold": medians(cold), "warm": medians(warm)}


def main():
    options = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    options.add_argument("--runs", type=int, default=3)
    options.add_argument("--against", type=Path, help="another checkout of the package")
    options.add_argument("--out", type=Path, default=Path("results/cold_start"))
    options.add_argument("--child", choices=CASES, help=argparse.SUPPRESS)
    args = options.parse_args()
    if args.child:
        print(json.dumps(pot() if args.child == "pot" else sheet(args.child == "relaxing")))
        return
    versions = {"now": HERE, **({"before": args.against.resolve()} if args.against else {})}
    summary = {}
    for case in CASES:
        for version, checkout in versions.items():
            summary[f"{case} {version}"] = found = measured(case, checkout, args.runs)
            for cache, row in found.items():
                parts = ", ".join(f"{part} {seconds:.2f} s" for part, seconds in row.items())
                print(f"{case:9}{version:7} {cache}: {parts}", flush=True)
    args.out.mkdir(parents=True, exist_ok=True)
    (args.out / "summary.json").write_text(json.dumps(summary, indent=1))


if __name__ == "__main__":
    main()
