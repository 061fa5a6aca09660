"""What the first seconds of a process take: set-up of a scene where many forms have been compiled before, compiling.

    ./fx python3 benchmarks/cold_start.py [--files 4000] [--against CHECKOUT]

Set-up of Treloar's sheet (10 x 1), and of one that relaxes, up to the first state of its path, in a process of its own:
with nothing compiled (processor time, the C compiler's apart), with its own forms, and with so many files of others
beside them; then a second scene like it in the same process.
"""

import argparse
import json
import os
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path

RUNS = 5


def child(kind):
    """{part: seconds}, in this process."""
    import formingx as fx
    from formingx.solve.path_following import Run
    begun, follow = [], Run.follow

    def noted(*given, **more):
        begun.append(time.process_time())
        return follow(*given, **more)
    Run.follow = noted
    material = fx.NeoHookean(c10=2.0)
    found = {}
    for name in ("first", "second"):
        started, others = time.process_time(), resource.getrusage(resource.RUSAGE_CHILDREN)
        scene = fx.Scene(mesh=fx.mesh.disc(radius=1.25, thickness=0.082, elements=(10, 1)),
                         materials=fx.Viscoelastic(material, [(1.0, 1.0)]) if kind == "relaxing" else material,
                         supports=[fx.Symmetry("axis"), fx.SimplySupported("rim")], loads=[fx.Pressure("bottom")])
        fx.trace(scene, until=fx.pole_stretch(1.01), progress=False)
        found[name] = begun[-1] - started
        found[f"{name} C"] = resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime - others.ru_utime
    return found


def fill(cache, files):
    """Make files of so many other modules there, as the compiler of forms leaves three of each."""
    for folder in (cache, *(p for p in cache.iterdir() if p.is_dir())):
        for k in range(files // (3 if folder == cache else 3 * 16)):
            for end in (".c", ".c.cached", ".cpython-313-x86_64-linux-gnu.so"):
                (folder / f"libffcx_forms_{k:040x}{end}").touch()


def measured(kind, checkout, files):
    """{case: medians}: "cold" without compiled forms, "own" with those alone, "full" with files of others."""
    with tempfile.TemporaryDirectory() as place:
        inside = (f"import os, sys, runpy; os.environ['XDG_CACHE_HOME'] = {place!r}\n"
                  f"sys.argv[1:] = ['--child', {kind!r}]; runpy.run_path({__file__!r}, run_name='__main__')")

        def run():
            done = subprocess.run([sys.executable, "-c", inside], env=os.environ | {"PYTHONPATH": str(checkout)},
                                  capture_output=True, text=True, timeout=600, check=True)
            return json.loads(done.stdout.splitlines()[-1])

        def median():
            rows = [run() for _ in range(RUNS)]
            return {part: sorted(row[part] for row in rows)[RUNS // 2] for part in rows[0]}
        found = {"cold": run(), "own": median()}
        fill(Path(place) / "fenics", files)
        return found | {"full": median()}


def main():
    options = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    options.add_argument("--files", type=int, default=4000)
    options.add_argument("--against", type=Path, help="another checkout of the package")
    options.add_argument("--child", help=argparse.SUPPRESS)
    args = options.parse_args()
    if args.child:
        print(json.dumps(child(args.child)))
        return
    versions = {"now": Path(__file__).parents[1], **({"before": args.against.resolve()} if args.against else {})}
    print(f"{'scene':10}{'version':9}{'cached':8}{'set-up, s':>10}{'C, s':>8}{'second, s':>11}{'C, s':>8}")
    for kind in ("treloar", "relaxing"):
        for version, checkout in versions.items():
            for case, row in measured(kind, checkout, args.files).items():
                print(f"{kind:10}{version:9}{case:8}{row['first']:10.3f}{row['first C']:8.2f}{row['second']:11.3f}"
                      f"{row['second C']:8.2f}", flush=True)


if __name__ == "__main__":
    main()
