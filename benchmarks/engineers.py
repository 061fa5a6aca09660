"""Measure the cost of engineers' runs by part: moulds, plugs, bottles, with friction, time and heat.

    ./fx python3 benchmarks/engineers.py [--against CHECKOUT] [--turns 3] [--finest] [--only pot cup] [--json FILE]

Each run is a process of its own. Its row has accepted states, failed steps, Newton iterations and jumps. Then it has
seconds of processor time while paths are followed, in all and by part, with forms compiled before: contact (laws, gap
closures, local problems), tangents, LU factors, solves, rest. Last are the reasons for which steps were shorter or
failed. The limit is the time of tangents, LU factors and solves, one of each per iteration; "over" is the run over this
limit.

`--against` runs another version of the package, too, even one that is older than this script. Both run in turns,
`--turns` times; the fastest run counts. `--finest` adds the largest difference of the walls, farther than a thickness
from the rim, to a run with one node a step in steps of at most `LARGEST`.
"""

import argparse
import functools
import importlib
import inspect
import json
import os
import subprocess
import sys
import tempfile
import time
from collections import Counter
from pathlib import Path

import numpy as np

import formingx as fx

SECONDS = 1500                                               # that a run may take
LARGEST = 0.02                                               # dimensionless, of the finest steps
PARTS = ("contact", "tangents", "LU", "solves", "rest")
OLDER = {"control": "drive", "direction": "moves", "inactive": "without"}
"""Names of arguments in versions before these."""
CLASSES = {                                                  # (module, class) in this version and in older ones
    "path": [("solve.path_following", "Run"), ("solve.follow", "Run")],
    "contact": [("contact.face", "FaceContact"), ("contact.step_limit", "Approach"),
                ("contact.approach", "Approach"),
                ("discrete.contact.face", "FaceContact"), ("discrete.contact.approach", "Approach"),
                ("discrete.contact_nodes", "ContactNodes"),
                ("extensions.contact_events.prediction", "ContactEventPrediction")],
    "local": [("solve.local_contact", "LocalSolve"), ("solve.settle", "Settling")],
    "problem": [("problem.problem", "Problem"), ("discrete.problem", "Problem")],
    "solver": [("solve.linear", "DirectSolver"), ("solve.direct", "DirectSolver")]}


def called(function, *given, **more):
    """Return the value of a function of the package, called with the argument names of the version at hand."""
    known = inspect.signature(function).parameters
    return function(*given, **{name if name in known else OLDER.get(name, name): v for name, v in more.items()})


def classes(what):
    """Return those of `CLASSES` that the version at hand has."""
    found = []
    for module, name in CLASSES[what]:
        try:
            found.append(getattr(importlib.import_module(f"formingx.{module}"), name))
        except (ImportError, AttributeError):
            continue
    return found


def contact(finest, *given, **more):
    """Return a contact; with `finest` it takes one node a step."""
    return called(fx.Contact, *given, **more, **({"nodes_per_step": 1} if finest else {}))


def step(finest, target=8):
    return fx.StepControl(target=target, length=LARGEST, largest=LARGEST) if finest else fx.StepControl(target=target)


def disc(radius, thickness, elements, material, contacts, **more):
    return fx.Scene(mesh=fx.mesh.disc(radius=radius, thickness=thickness, elements=elements), materials=material,
                    supports=[fx.Symmetry("axis"), fx.Clamped("rim")], loads=[fx.Pressure("bottom", name="air")],
                    contacts=contacts, **more)


def plug_then_air(scene, travel, pressure, finest):
    return fx.Process(scene).run([called(fx.Stage, "plug", control="plug", until=fx.travel(travel)),
                                  called(fx.Stage, "air", control="air", until=fx.pressure(pressure))],
                                 step=step(finest), progress=False)


def pot(finest):
    """Return the path of the README's pot."""
    tools = fx.tools.pot(mouth=38.0, base=28.0, depth=40.0, sheet=1.2, fillet=8.0, lip=3.0, nose=20.0)
    return plug_then_air(disc(40.0, 1.2, (30, 1), fx.NeoHookean(c10=0.4), [
        contact(finest, "top", tools.mould, "stick", separates=False, name="mould"),
        contact(finest, "bottom", tools.plug, "none", direction=(0, 1), name="plug")]), 22.0, 0.09, finest)


def study(finest):
    """Return the path of a run of demos/pot_study.py."""
    mould = fx.tools.cup(radius=38.0, depth=60.0, mouth=1.2, draft=6.0, fillet=5.0, lip=2.0)
    plug = fx.tools.male(radius=22.0, height=120.0, base=-120.0, draft=3.0, fillet=6.0)
    return plug_then_air(disc(40.0, 1.2, (30, 1), fx.MooneyRivlin(c10=0.35, c01=0.05), [
        contact(finest, "top", mould, "stick", separates=False, name="mould"),
        contact(finest, "bottom", plug, 0.3, direction=(0, 1), name="plug")]), 48.0, 0.4, finest)


def relaxing_pot(finest):
    """Return the path of a run of demos/relaxing_pot.py."""
    mould = fx.tools.cup(radius=10.0, depth=10.0, mouth=0.3, fillet=1.0)
    plug = fx.tools.male(radius=5.0, height=40.0, base=-40.0, fillet=1.5)
    scene = disc(10.0, 0.3, (30, 1), fx.Viscoelastic(fx.NeoHookean(c10=6.5), branches=[(117.0, 1.0)]), [
        contact(finest, "top", mould, "stick", name="mould"),
        contact(finest, "bottom", plug, 0.3, direction=(0, 1), name="plug")])
    return fx.Process(scene).run([
        called(fx.Stage, "plug", control="plug", until=fx.travel(6.0), speed=6.0),
        called(fx.Stage, "hold", duration=1.0),
        called(fx.Stage, "vacuum", control="air", until=fx.pressure(160.0), step=step(finest)),
        called(fx.Stage, "in the mould", duration=5.0, inactive=["plug"])], accuracy=1e-2, progress=False,
        step=step(True) if finest else None)


def blown(friction, finest):
    mesh = fx.mesh.parison(inner_radius=1.1, thickness=0.3, length=10.6, elements=(40, 1))
    mould = fx.tools.bottle(radius=3.0, height=10.0, neck=1.5, shoulder=2.0, neck_height=1.5, base=-2.9, fillet=0.8,
                            shoulder_fillet=0.8)
    scene = fx.Scene(mesh=mesh, materials=fx.MooneyRivlin(c10=50.0, c01=15.0),
                     supports=[fx.Symmetry("axis"), fx.Clamped("neck")], loads=[fx.Pressure("inner")],
                     contacts=[contact(finest, "outer", mould, friction)])
    return fx.trace(scene, until=fx.pressure(200.0), step=step(finest), progress=False)


def bottle(finest):
    """Return the path of demos/parison.py."""
    return blown("stick", finest)


def sliding_bottle(finest):
    return blown(0.3, finest)


def in_cup(friction, finest):
    mould = fx.tools.cup(radius=10.0, depth=5.0, mouth=0.3, fillet=1.0)
    scene = disc(10.0, 0.3, (60, 2), fx.MooneyRivlin(c10=50.0, c01=15.0), [contact(finest, "top", mould, friction)])
    return fx.trace(scene, until=fx.pressure(160.0), step=step(finest), progress=False)


def cup(finest):
    """Return the path of demos/cup.py."""
    return in_cup("stick", finest)


def slippery_cup(finest):
    return in_cup("none", finest)


def williams(finest):
    """Return the path of demos/williams_plug.py to 8 cm, with friction."""
    tool = fx.tools.male(radius=1.905, height=60.0, base=-60.0, fillet=0.35).mirrored().moved(z=0.6985)
    scene = fx.Scene(mesh=fx.mesh.disc(radius=8.89, thickness=0.6985, elements=(120, 2), concentrate={1.23825: 0.2}),
                     materials=fx.NeoHookean(c10=0.448), supports=[fx.Symmetry("axis"), fx.Clamped("rim")],
                     contacts=[contact(finest, "top", tool, 0.3, direction=(0, -1))])
    return fx.trace(scene, until=fx.travel(8.0), step=step(finest, 6), progress=False)


def blister(finest, target=None):
    """Return the path of a blister: a cavity of 8 mm in a warm film that relaxes, with a colder plug and mould.

    Lengths in mm, stresses in MPa; an invented film. target: argument of `StepControl`; None: its default.
    """
    tools = fx.tools.pot(mouth=4.0, base=3.5, depth=4.0, sheet=0.25, fillet=0.8, lip=0.4, plug=2.6, nose=0.8)
    stiffness = fx.table({20: 500.0, 40: 300.0, 60: 100.0, 80: 20.0, 100: 3.0, 120: 1.0, 140: 0.6})

    def warm(value):
        return fx.of_temperature(lambda T: value * stiffness(T))
    film = fx.Viscoelastic(fx.NeoHookean(c10=warm(0.177)), branches=[(warm(0.375), 0.216), (warm(0.288), 5.22)],
                           shift=fx.WLF(9.82, 91.6, 120.0))
    heat = fx.Cooling(fx.ThermalProperties(conductivity=0.17e-3, density=1.38e-3, heat_capacity=1.6), [], unit="C",
                      tools={"plug": (0.4e-3, 60.0), "mould": (0.5e-3, 40.0)})
    scene = disc(5.0, 0.25, (36, 1), film, [contact(finest, "top", tools.mould, "stick", name="mould"),
                                            contact(finest, "bottom", tools.plug, 0.3, direction=(0, 1), name="plug")],
                 temperature=120.0, heat=heat)
    return fx.Process(scene).run([called(fx.Stage, "plug", control="plug", until=fx.travel(3.0), speed=30.0),
                                  called(fx.Stage, "air", control="air", until=fx.pressure(0.3), duration=0.2),
                                  called(fx.Stage, "hold", duration=1.0)], accuracy="draft", progress=False,
                                 step=step(finest, target or 8) if finest or target else None)


RUNS = {run.__name__: run for run in (pot, study, relaxing_pot, bottle, cup, williams, blister, slippery_cup,
                                      sliding_bottle)}
USUAL = list(RUNS)
RUNS |= {f"blister_{n}": functools.partial(blister, target=n) for n in (4, 8, 12)}


class Clock:
    """Processor time of methods, each without the time of the watched methods that it calls."""

    def __init__(self):
        self.seconds, self._on, self._last = Counter(), [], 0.0
        self.calls = {}                                     # seconds of each call, by (part, name)

    def _switch(self):
        now = time.thread_time()                            # process_time takes the kernel several microseconds
        if self._on:
            self.seconds[self._on[-1]] += now - self._last
        self._last = now

    def watch(self, part, owner, *names, within=True):
        """Count the time of methods as that of a part; within: only while another part runs."""
        for name in names:
            if hasattr(owner, name):
                setattr(owner, name, self._watched(getattr(owner, name), part, within, name))

    def _watched(self, function, part, within, name):
        calls = self.calls.setdefault((part, name), [])

        @functools.wraps(function)
        def timed(*given, **more):
            if within and not self._on:
                return function(*given, **more)
            self._switch()
            self._on.append(part)
            began = self._last
            try:
                return function(*given, **more)
            finally:
                self._switch()
                self._on.pop()
                calls.append(self._last - began)
        return timed


def measured(name, finest):
    """Return the row of one run, in this process."""
    clock = Clock()
    for owner in classes("path"):
        clock.watch("rest", owner, "follow", within=False)
    for owner in classes("contact"):
        clock.watch("contact", owner, *(n for n, f in vars(owner).items() if callable(f) and n[0] != "_"))
    for owner in classes("local"):
        clock.watch("contact", owner, "correct")
    for owner in classes("problem"):
        clock.watch("tangents", owner, "tangent")
    for owner in classes("solver"):
        clock.watch("LU", owner, "factorise")
        clock.watch("solves", owner, "solve", "solve_all", "solve_transposed")
    ended = ""
    try:
        path = RUNS[name](finest)
    except fx.ConvergenceError as error:
        path, ended = error.path, str(error)[:200]
    counts, profile = path.counts, path.profile()
    R, t = profile.reference_length, profile.thickness
    inside = R[-1] - profile.original_thickness[0] > R
    return {"states": counts.steps, "failures": counts.failures, "iterations": counts.iterations,
            "jumps": len(path.jumps), "seconds": sum(clock.seconds.values()),
            "limit": counts.iterations * (np.mean(clock.calls["tangents", "tangent"])
                                          + np.mean(clock.calls["LU", "factorise"])
                                          + np.median(clock.calls["solves", "solve_all"])),
            "parts": {part: clock.seconds[part] for part in PARTS}, "limits": getattr(counts, "limits", []),
            "ended": ended, "length": R[inside].tolist(), "wall": t[inside].tolist()}


def in_child(name, finest, checkout, first=True):
    """Return the row of one run with the package of a checkout; a run that failed has the reason instead."""
    with tempfile.TemporaryDirectory() as place:
        file = Path(place) / "row.json"
        command = [sys.executable, __file__, "--row", name, "--json", str(file), *["--finest"] * finest]
        for _ in range(2 if first and not finest else 1):   # the first compiles forms
            try:
                done = subprocess.run(command, env=os.environ | {"PYTHONPATH": str(checkout)}, capture_output=True,
                                      text=True, timeout=SECONDS)
            except subprocess.TimeoutExpired:
                return {"ended": f"took more than {SECONDS} s"}
            if done.returncode:
                return {"ended": (done.stderr.strip().splitlines() or ["it crashed"])[-1]}
            row = json.loads(file.read_text())
            if row["seconds"] > 20:
                break
        return row


def apart(row, other):
    """Return the largest relative difference of two walls."""
    if row.get("ended") or other.get("ended"):
        return None
    return float(np.abs(np.array(row["wall"]) / np.interp(row["length"], other["length"], other["wall"]) - 1).max())


def seconds(row):
    """Return the seconds of a row; infinite for a run that could not be made."""
    return row.get("seconds", np.inf)


def line(name, version, row):
    if "states" not in row:
        return f"{name:15}{version:8}{row['ended']}"
    off = row.get("to_finest")
    limits = ", ".join(f"{why} {n}" for why, n in Counter(row["limits"]).most_common(4))
    return (f"{name:15}{version:8}{row['states']:7}{row['failures']:7}{row['iterations']:7}{row['jumps']:6}"
            f"{row['seconds']:8.2f}{row['seconds'] / row['limit']:7.1f}"
            + "".join(f"{100 * row['parts'][p] / row['seconds']:11.0f}" for p in PARTS)
            + (f"{off:9.1e}" if off is not None else f"{'-':>9}") + f"  {limits}  {row['ended']}")


def main():
    options = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    options.add_argument("--against", type=Path, help="another checkout of the package, for the same runs")
    options.add_argument("--turns", type=int, default=1, help="runs of each, in turns: the fastest counts")
    options.add_argument("--finest", action="store_true", help="compare walls with one node a step in finest steps")
    options.add_argument("--only", nargs="+", choices=RUNS, default=USUAL)
    options.add_argument("--json", type=Path)
    options.add_argument("--row", choices=RUNS, help=argparse.SUPPRESS)
    args = options.parse_args()
    if args.row:
        args.json.write_text(json.dumps(measured(args.row, args.finest)))
        return
    versions = {"now": Path(fx.__file__).parents[1], **({"before": args.against.resolve()} if args.against else {})}
    found = {}
    print(f"{'run':15}{'':8} states failed   iter jumps       s   over" + "".join(f"{p + ' %':>11}" for p in PARTS)
          + "   finest  limits of steps")
    for name in args.only:
        found[name] = rows = {version: in_child(name, False, checkout) for version, checkout in versions.items()}
        for _ in range(args.turns - 1):
            for version, checkout in versions.items():
                if "states" in rows[version]:
                    rows[version] = min(rows[version], in_child(name, False, checkout, first=False), key=seconds)
        if args.finest:
            rows["finest"] = in_child(name, True, versions["now"])
        for version, row in rows.items():
            row["to_finest"] = apart(row, rows["finest"]) if args.finest and version != "finest" else None
            print(line(name, version, row), flush=True)
    for version in versions:
        rows = [rows[version] for rows in found.values() if "states" in rows[version]]
        states, failures, iterations, spent = (sum(row[key] for row in rows) for key in (
            "states", "failures", "iterations", "seconds"))
        print(f"{'total':15}{version:8}{states:7}{failures:7}{iterations:7}{'':6}{spent:8.2f}")
    if args.json:
        args.json.write_text(json.dumps(found, indent=1))


if __name__ == "__main__":
    main()
