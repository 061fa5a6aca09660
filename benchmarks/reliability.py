"""Count failures of the package: wrong arguments, ranks, killed runs, and files that cannot be written.

    ./fx python3 benchmarks/reliability.py [bad] [ranks] [restarts] [files]    (damaged files: damaged_files.py)

bad: every public argument wrong in turn; counts how many gave an InputError (or a TypeError, for an unknown or a
missing argument) before any solve. ranks: a free and a formed sheet on 1, 2, 3, 4 ranks; the largest relative
difference of any measure of any state. restarts: runs killed (kill -9) at random moments and continued from their
checkpoints; counts how many reached the same path. files: a full disk, a folder that cannot be written: a clear error,
and the earlier file is kept.
"""

from __future__ import annotations

import argparse
import contextlib
import inspect
import json
import math
import os
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path as FilePath
from typing import Any, NamedTuple

import numpy as np

import formingx as fx
from formingx.solve.arc_length import Curve

_NUMBER = {"a word": "x", "nan": math.nan, "inf": math.inf, "a bool": True, "a list": [], "an array": [1.0, 2.0],
           "huge": 10**400, "a dict": {}}
_NONE = {"None": None}
_WORD = {"a number": 3, "nan": math.nan, "empty": "", "unknown": "nowhere", "a list": [], "a bool": True}
BAD: dict[str, dict[str, Any]] = {
    "number": _NUMBER | _NONE,
    "optional number": _NUMBER,
    "positive": _NUMBER | _NONE | {"0": 0, "negative": -1.0},
    "not negative": _NUMBER | _NONE | {"negative": -1.0},
    "count": _NUMBER | _NONE | {"0": 0, "negative": -1, "a fraction": 1.5},
    "word": _WORD | _NONE,
    "thing": {"a number": 3, "a word": "x", "nan": math.nan, "a list": [], "a bool": True} | _NONE,
    "optional thing": {"a number": 3, "a word": "x", "nan": math.nan, "a list": [[]], "a bool": True},
    "several": {"a number": 3, "nan": math.nan, "a wrong entry": [3], "a list of None": [None]} | _NONE,
    "pair": {"a number": 3, "a word": "x", "one number": (1.0,), "three": (1.0, 2.0, 3.0), "nan": (math.nan, 0.0),
             "words": ("a", "b"), "inf": (math.inf, 0.0)} | _NONE,
    "flag": {},
}
"""{kind of argument: {what is wrong: a value that is not allowed}}."""


class Call(NamedTuple):
    """A public callable, {name: (kind, a good value)} of its arguments, and the use of its result up to the solve."""

    name: str
    make: Callable
    arguments: dict[str, tuple[str, Any]]
    use: Callable | None = None


class Outcome(NamedTuple):
    """Outcome of a wrong argument: "right", "accepted" or "wrong error"."""

    call: str
    argument: str
    bad: str
    outcome: str
    error: str


class ReachedTheSolve(Exception):
    """Raised when a run is about to solve: its arguments were taken as good ones."""


@contextlib.contextmanager
def unsolved() -> Iterator[None]:
    """Within this context, runs end with `ReachedTheSolve` before they solve."""
    def stop(*_: Any) -> None:
        raise ReachedTheSolve
    start, Curve.start = Curve.start, stop
    try:
        yield
    finally:
        Curve.start = start


def _mesh() -> fx.mesh.Mesh:
    return fx.mesh.disc(radius=1.0, thickness=0.1, elements=(4, 1))


def _scene(**change: Any) -> fx.Scene:
    good = {"mesh": _mesh(), "materials": fx.NeoHookean(c10=1.0), "loads": [fx.Pressure("bottom")],
            "supports": [fx.Symmetry("axis"), fx.Clamped("rim")]}
    return fx.Scene(**{**good, **change})


def _run(scene: Any, until: Any = None) -> None:
    fx.trace(scene, until=until or fx.pole_height(0.1), progress=False)


def _named() -> fx.Scene:
    """Return a scene for a process: a pressure and a plug, with names."""
    plug = fx.Contact("top", fx.tools.sphere(radius=0.5, z=0.1), "none", direction=(0, -1), name="plug")
    return _scene(loads=[fx.Pressure("bottom", name="air")], contacts=[plug])


def _processed(stages: Any) -> None:
    fx.Process(_named()).run(stages, progress=False)


def _staged(**stage: Any) -> None:
    _processed([fx.Stage("on", **({"control": "plug"} if "amplitudes" not in stage else {}), **stage)])


def calls(made: fx.Scene, saved: str) -> list[Call]:
    """Return every public callable with arguments that a user types; `saved`: a checkpoint of the scene `made`."""
    positive, number, word, name = ("positive", 1.0), ("number", 0.1), ("word", "bottom"), ("name", None)
    optional = ("positive or None", None)
    materials = [Call(m.__name__, m, {k: (kind, v) for k, (kind, v) in args.items()}, lambda m: _scene(materials=m))
                 for m, args in ((fx.NeoHookean, {"c10": positive}), (fx.MooneyRivlin,
                                  {"c10": ("not negative", 1.0), "c01": ("not negative", 0.1)}),
                                 (fx.Yeoh, {"c10": positive, "c20": number, "c30": number}),
                                 (fx.Gent, {"mu": positive, "Jm": positive}),
                                 (fx.ArrudaBoyce, {"mu": positive, "N": ("positive", 10.0)}))]
    boundary = [Call(s.__name__, s, {"on": ("word", "rim"), **more},
                     lambda s: _run(_scene(supports=[fx.Symmetry("axis"), s]))) for s, more in (
        (fx.Clamped, {}), (fx.SimplySupported, {"weight": ("word", "area")}))]
    targets = [Call(t.__name__, t, {"value": (kind, 0.1), **more}, lambda t: _run(_scene(), t)) for t, kind, more in (
        (fx.pressure, "number", {"of": name}), (fx.pole_height, "number", {}), (fx.pole_stretch, "positive", {}),
        (fx.enclosed_volume, "number", {}))]
    size = {"radius": positive}
    tools = [Call(f"tools.{t.__name__}", t, args) for t, args in (
        (fx.tools.plane, {"z": number}),
        (fx.tools.cup, size | {"depth": positive, "mouth": number, "draft": ("not negative", 0.0),
                               "fillet": ("not negative", 0.1), "lip": ("not negative", 0.1)}),
        (fx.tools.male, size | {"height": positive, "base": number, "draft": ("not negative", 0.0),
                                "fillet": ("not negative", 0.1), "foot": ("not negative", 0.1)}),
        (fx.tools.bottle, size | {"height": positive, "neck": ("positive", 0.5), "shoulder": positive,
                                  "neck_height": positive, "base": number, "fillet": ("not negative", 0.1),
                                  "shoulder_fillet": ("not negative", 0.1)}),
        (fx.tools.cylinder, size | {"z": number, "fillet": ("not negative", 0.1)}),
        (fx.tools.cone, {"half_angle": ("positive", 30.0), "z": number, "tip": ("not negative", 0.0),
                         "size": positive}),
        (fx.tools.sphere, size | {"z": number, "r": number}))]
    disc = {"radius": positive, "thickness": ("positive", 0.1), "accuracy": ("word", "draft"),
            "elements": ("pair or None", (4, 1)), "grading": positive, "inner_radius": ("not negative", 0.0),
            "concentrate": ("optional thing", None)}
    sphere = {"inner_radius": positive, "thickness": positive, "elements": ("pair", (4, 2)), "grading": positive}
    contact = {"on": ("word", "top"), "tool": ("thing", fx.tools.plane(0.3)), "friction": ("friction", "stick"),
               "penalty": optional, "ramp": optional, "nodes_per_step": ("count or None", 1),
               "separates": ("flag", True), "present_area": ("flag", False),
               "direction": ("pair or None", None), "name": name, "points": ("points", "nodes"),
               "elastic_slip": positive}
    stage = {"name": ("label", "up"), "control": ("optional thing", "air"),
             "until": ("optional thing", fx.pressure(0.1)),
             "intermediate": ("several", ()), "inactive": ("several", ()), "step": ("optional thing", None),
             "speed": optional, "duration": optional, "constant": ("optional table", None),
             "at_limit_point": ("optional word", None)}
    table = {"amplitudes": {"air": [(0.0, 0.0), (1.0, 0.1)]}}
    kept = {"record": ("optional thing", None), "resume": ("flag", False), "allow_inadmissible": ("flag", False)}
    process = {"stages": ("several", [fx.Stage("up", control="air", until=fx.pressure(0.1))]),
               "step": ("optional thing", None), "tolerances": ("optional thing", None),
               "max_steps": ("count or None", 200), "progress": ("flag", False), "start": ("optional thing", None),
               "checkpoint": ("folder", None), **kept, "accuracy": ("accuracy", "standard"),
               "adapt_mesh": ("flag", False),
               "remesh": ("optional thing", None)}
    part = {"name": ("label", "plug"), "of": ("word", "top"), "within": ("pair", (0.0, 0.5)), "along": ("word", "r")}
    return [
        *materials, *boundary, *targets, *tools,
        Call("Ogden", fx.Ogden, {"mu": ("terms", (1.0,)), "alpha": ("terms", (2.0,))},
             lambda m: _scene(materials=m)),
        Call("Symmetry", fx.Symmetry,
             {"on": ("word", "axis"), "normal": ("word", "r"), "mirror": ("flag", False), "guide": ("flag", False)},
             lambda s: _run(_scene(supports=[s, fx.Clamped("rim")]))),
        Call("PrescribedDisplacement", fx.PrescribedDisplacement,
             {"on": word, "component": ("word", "z"), "name": name},
             lambda s: _run(_scene(loads=[], supports=[fx.Symmetry("axis"), fx.Clamped("rim"), s]))),
        Call("PinnedNode", fx.PinnedNode, {"r": ("number", 1.0), "z": ("number", 0.0)}),
        Call("Pressure", fx.Pressure, {"on": word, "value": ("optional number", None), "name": name,
                                       "above": ("optional number", None)},
             lambda p: _run(_scene(loads=[p]))),
        Call("displacement", fx.displacement, {"value": number, "at": ("pair", (0.0, 0.0)),
                                               "component": ("word", "z")}, lambda t: _run(_scene(), t)),
        Call("travel", fx.travel, {"value": number, "of": name}, lambda t: _staged(until=t)),
        Call("process_time", fx.process_time, {"value": number}, lambda t: _staged(until=t, **table)),
        Call("Stage", fx.Stage, stage | {"amplitudes": ("optional thing", None)}, lambda s: _processed([s])),
        Call("Stage.follow", fx.Stage, stage | {"control": ("optional thing", None), "until": ("optional thing", None),
                                                "amplitudes": ("table", table["amplitudes"])},
                                                lambda s: _processed([s])),
        Call("Process", fx.Process, {"scene": ("thing", _scene())}),
        Call("Process.run", lambda **given: fx.Process(_named()).run(**given), process),
        Call("Mesh.with_part", _mesh().with_part, part),
        Call("mesh.disc", fx.mesh.disc, disc), Call("mesh.sphere", fx.mesh.sphere, sphere),
        Call("mesh.parison", fx.mesh.parison, sphere | {"thickness": ("positive", 0.1), "length": positive,
                                                        "accuracy": ("optional word", "draft"),
                                                        "elements": ("pair or None", (4, 2))}),
        Call("mesh.read", fx.mesh.read, {"file": ("file", None), "scale": ("positive", 1.0)}),
        Call("Contact", fx.Contact, contact, lambda c: _run(_scene(contacts=[c]))),
        Call("Tool", fx.Tool, {"points": ("several", [(0.0, 0.0), (1.0, 0.0), (2.0, 1.0)]),
                               "fillets": ("not negative", 0.0),
                               "closed": ("flag", False)}),
        Call("MixedPressure", fx.MixedPressure, {"eps": ("not negative", 0.0), "space": ("word", "P1dg"),
                                                 "volume_stiffness": ("not negative", 0.0)}),
        Call("DisplacementPenalty", fx.DisplacementPenalty, {"eps": positive, "points": ("count", 3),
                                                             "stress_free": ("flag", True)}),
        Call("Scene", fx.Scene, {
            "mesh": ("thing", _mesh()), "materials": ("thing", fx.NeoHookean(c10=1.0)),
            "supports": ("several", [fx.Symmetry("axis"), fx.Clamped("rim")]),
            "loads": ("several", [fx.Pressure("bottom")]), "contacts": ("several", []),
            "model": ("optional thing", None), "kinematics": ("optional thing", None),
            "quadrature_degree": ("count or None", 5), "temperature": ("optional number", None),
            "heat": ("optional thing", None), "expansion": ("optional thing", None),
            "thickness": ("optional thing", None), "state_transfer": ("optional thing", None)}, _run),
        Call("StepControl", fx.StepControl, {
            "length": positive, "target": ("count", 4), "growth": positive, "smallest": positive,
            "largest": ("step", 1.0)}, lambda s: fx.trace(_scene(), until=fx.pole_height(0.1), step=s, progress=False)),
        Call("Tolerances", fx.Tolerances, {"correction": positive, "residual": positive, "iterations": ("count", 12),
                                               "settling": ("count", 40)},
             lambda t: fx.trace(_scene(), until=fx.pole_height(0.1), tolerances=t, progress=False)),
        Call("trace", fx.trace, {
            "scene": ("thing", _scene()), "until": ("thing", fx.pole_height(0.1)), "intermediate": ("several", ()),
            "step": ("optional thing", None), "tolerances": ("optional thing", None),
            "max_steps": ("count or None", 200), "progress": ("flag", False), "start": ("optional thing", None),
            "checkpoint": ("folder", None), **kept, "at_limit_point": ("optional word", None),
            "adapt_mesh": ("flag", False),
            "remesh": ("optional thing", None), "stop_at": ("optional thing", None)}),
        Call("load", fx.load, {"folder": ("file", saved), "scene": ("thing", made), "state": ("state", None)}),
        Call("solve", fx.solve, {"scene": ("thing", _scene()), "to": number, "increments": ("count", 1),
                                 "tolerances": ("optional thing", None), "record": ("optional thing", None),
                                 "max_steps": ("count", 1000), "allow_inadmissible": ("flag", False)}),
        *_time_and_heat(),
        Call("check", fx.check, {"scene": ("thing", _scene()), "targets": ("several", ()), "stages": ("several", ()),
                                 "units": ("thing", fx.Units())}),
    ]


def _time_and_heat() -> list[Call]:
    """Return calls of materials that relax, and of heat."""
    positive, number, where = ("positive", 1.0), ("number", 0.1), ("word", "top")
    name = ("name or None", None)
    rubber, material = ("optional thing", fx.NeoHookean(c10=1.0)), ("thing", fx.ThermalProperties(
        conductivity=0.2, density=1e3, heat_capacity=2e3))
    shift = ("optional thing", fx.WLF(c1=10.0, c2=100.0, reference=120.0))
    branches = ("several", [(0.5, 1.0)])

    def relax(m: Any) -> None:
        _scene(materials=m, temperature=120.0)

    def cool(b: Any) -> None:
        _scene(heat=fx.Cooling(material[1], [b], unit="C"), temperature=120.0)

    return [
        Call("Viscoelastic", fx.Viscoelastic, {"equilibrium": rubber, "branches": branches, "order": ("count", 2),
                                               "shift": shift}, relax),
        Call("TransientNetwork", fx.TransientNetwork, {"equilibrium": rubber, "branches": branches, "shift": shift},
             relax),
        Call("WLF", fx.WLF, {"c1": positive, "c2": positive, "reference": number}),
        Call("Arrhenius", fx.Arrhenius, {"activation_energy": ("positive", 5e4), "reference": number,
                                         "unit": ("word", "C")}),
        Call("ThermalProperties", fx.ThermalProperties, {"conductivity": positive, "density": positive,
                                                         "heat_capacity": positive}),
        Call("ThermalExpansion", fx.ThermalExpansion, {"linear": ("number", 1e-4), "stress_free": number,
                                                       "specific_volume": ("optional thing", None)}),
        Call("Cooling", fx.Cooling, {
            "materials": material, "boundaries": ("several", [fx.Convection("top", h=10.0, air=20.0)]),
            "unit": ("word", "C"), "tools": ("optional thing", None), "tolerance": positive,
            "work_to_heat": ("positive or None", None)}, lambda c: _scene(heat=c, temperature=120.0)),
        Call("ConductingTool", fx.ConductingTool, {
            "thickness": positive, "conductivity": positive, "heat_capacity": positive,
            "back": number, "start": ("optional number", None), "elements": ("count", 40),
            "finest": ("positive", 1e-4)}),
        Call("Convection", fx.Convection, {"on": where, "h": ("not negative", 10.0), "air": number,
                                           "name": name}, cool),
        Call("Absorption", fx.Absorption, {"on": where, "flux": number, "coefficient": positive,
                                           "name": name}, cool),
        Call("Radiation", fx.Radiation, {"on": where, "emissivity": ("not negative", 0.9), "heater": number,
                                         "view_factor": ("not negative", 1.0), "stefan_boltzmann": positive,
                                         "name": name}, cool),
        Call("FixedTemperature", fx.FixedTemperature, {"on": where, "temperature": number}, cool),
        Call("HeatFlux", fx.HeatFlux, {"on": where, "flux": number, "name": name}, cool),
        Call("Units", fx.Units, {"length": ("optional word", "mm"), "stress": ("optional word", "MPa"),
                                 "time": ("any word", "s")}),
        Call("tools.clamp_ring", fx.tools.clamp_ring, {
            "radius": positive, "width": ("positive", 0.5), "fillet": ("not negative", 0.1), "z": number,
            "height": ("positive or None", None)}),
        Call("tools.pot", fx.tools.pot, {
            "mouth": ("positive", 3.0), "base": ("positive", 2.0), "depth": ("positive", 3.0),
            "sheet": ("positive", 0.1), "fillet": ("not negative", 0.3), "lip": ("not negative", 0.0),
            "plug": ("positive or None", None), "nose": ("positive or None", None)}),
    ]


BAD["name or None"] = {k: v for k, v in _WORD.items() if k not in ("unknown", "None")}
BAD["name"] = {k: v for k, v in _WORD.items() if k not in ("unknown",)}
BAD["label"] = BAD["name"] | _NONE
BAD["table"] = {"a number": 3, "a word": "x", "a list": [[]], "unknown": {"nobody": [(0.0, 0.0)]}, "empty": {},
                "back in time": {"air": [(0.0, 0.0), (2.0, 0.1), (1.0, 0.2)]}, "no pair": {"air": [0.0, 1.0]},
                "nan": {"air": [(0.0, 0.0), (math.nan, 0.1)]}, "leaps": {"air": [(0.0, 0.5)]}}
BAD["positive or None"] = {k: v for k, v in BAD["positive"].items() if k != "None"}
BAD["count or None"] = {k: v for k, v in BAD["count"].items() if k != "None"}
BAD["optional word"] = dict(_WORD)
BAD["optional table"] = {"a number": 3, "a word": "x", "a list": [[]], "unknown": {"nobody": 1.0}}
BAD["any word"] = {k: v for k, v in BAD["word"].items() if k not in ("empty", "unknown")}
BAD["points"] = BAD["word"] | {"a number": -1, "0": 0, "a fraction": 1.5, "huge": 10**400}
BAD["accuracy"] = BAD["word"] | {"0": 0, "negative": -1.0, "inf": math.inf}
BAD["pair or None"] = {k: v for k, v in BAD["pair"].items() if k != "None"}
BAD["friction"] = {"unknown": "slippery", "nan": math.nan, "negative": -0.1, "a bool": True, "a list": [], "None": None}
BAD["file"] = {"None": None, "a number": 3.5, "not there": "/nowhere/at all.msh", "a folder": "/", "empty": ""}
BAD["folder"] = {"a number": 3.5, "nan": math.nan, "a list": [], "empty": "", "a bool": True, "not empty": "/"}
BAD["state"] = {"a word": "x", "negative": -1, "a fraction": 0.5, "nan": math.nan, "too large": 1000, "a list": []}
BAD["terms"] = {k: v for k, v in BAD["several"].items() if k not in ("a number", "a wrong entry")}
BAD["step"] = {k: v for k, v in BAD["positive"].items() if k != "inf"}
_LEFT_OUT = {"comm", "self"}


def bad_input() -> list[Outcome]:
    """Return the outcomes of all calls with every argument wrong in turn, one left out, one unknown."""
    made, found = _scene(), []
    with tempfile.TemporaryDirectory() as folder:
        saved = os.path.join(folder, "run")
        fx.trace(made, until=fx.pole_height(0.05), progress=False).save(saved)
        with unsolved():
            for call in calls(made, saved):
                found += _bad_calls(call)
    return found


def _bad_calls(call: Call) -> Iterator[Outcome]:
    """Yield one call with every argument wrong in turn, one left out, one unknown."""
    parameters = inspect.signature(fx.Process.run if call.name == "Process.run" else call.make).parameters
    left = set(parameters) - set(call.arguments) - _LEFT_OUT
    assert not left, f"{call.name}: no bad values are known for {left}"
    good = {k: v for k, (_, v) in call.arguments.items()}
    if call.name != "mesh.read" and _try(call, good)[0] != "accepted":
        raise AssertionError(f"{call.name}: the good values are refused: {_try(call, good)}")
    for name, (kind, _) in call.arguments.items():
        for what, value in BAD[kind].items():
            yield Outcome(call.name, name, what, *_try(call, good | {name: value}))
        if parameters[name].default is inspect.Parameter.empty:
            rest = {k: v for k, v in good.items() if k != name}
            yield Outcome(call.name, name, "missing", *_try(call, rest, TypeError))
    yield Outcome(call.name, "no_such_argument", "unknown", *_try(call, good | {"no_such_argument": 1}, TypeError))


def _try(call: Call, arguments: dict, also: type = fx.InputError) -> tuple[str, str]:
    try:
        made = call.make(**arguments)
        if call.use:
            call.use(made)
    except (fx.InputError, also) as error:
        return "right", str(error)
    except ReachedTheSolve:
        return "accepted", ""
    except Exception as error:  # noqa: BLE001  whatever else comes is what is counted
        return "wrong error", f"{type(error).__name__}: {error}"
    return "accepted", ""


_RANKS = """
import json, sys
from mpi4py import MPI
sys.path.insert(0, "tests")
from conftest import treloar
import formingx as fx
free = fx.trace(treloar(elements=(12, 2)), until=fx.pole_stretch(3.0), progress=False)
tool = fx.tools.cup(radius=1.25, depth=0.4, mouth=0.082, fillet=0.15)
made = treloar(elements=(16, 1), support=fx.Clamped("rim"), contacts=[fx.Contact("top", tool, 0.3)])
formed = fx.trace(made, until=fx.pressure(2.0), progress=False)
if MPI.COMM_WORLD.rank == 0:
    print(json.dumps([{c: list(map(float, p[c])) for c in p.columns} for p in (free, formed)]))
"""


def ranks(counts: tuple[int, ...] = (1, 2, 3, 4)) -> dict[str, float]:
    """Return {sheet: largest difference of a measure from one rank, over its largest value (mass_error: absolute)}."""
    root = FilePath(__file__).parents[1]
    results = []
    for n in counts:
        done = subprocess.run(["mpirun", "-n", str(n), sys.executable, "-c", _RANKS], cwd=root, capture_output=True,
                              text=True, check=True, env=os.environ | {"OMPI_MCA_mpi_yield_when_idle": "1"})
        results.append(json.loads(done.stdout.strip().splitlines()[-1]))
    worst = {}
    for k, name in enumerate(("free", "formed")):
        worst[name] = 0.0
        for other in results[1:]:
            for column, a in results[0][k].items():
                b = other[k][column]
                if len(a) != len(b):
                    worst[name] = math.inf                   # another number of states: not the same path
                    continue
                size = 1.0 if column == "mass_error" else max(map(abs, a)) or 1.0    # that is round-off already
                worst[name] = max(worst[name], max(abs(x - y) for x, y in zip(a, b, strict=True)) / size)
    return worst


def restarts(kills: int = 50) -> tuple[int, float]:
    """Return how many of the killed runs reached the same path, and the largest relative difference."""
    sys.path.insert(0, str(FilePath(__file__).parents[1] / "tests"))
    from test_restart import SCENES, killed_after, numbers
    make, until = SCENES["stick"]
    scene = make()
    whole, same, worst = fx.trace(scene, until=until, progress=False), 0, 0.0
    for seconds in np.random.default_rng(0).uniform(0, 1.2 * whole.counts.seconds, kills):
        with tempfile.TemporaryDirectory() as folder:
            run = FilePath(folder) / "run"
            killed_after(seconds, run)
            path = fx.trace(scene, until=until, start=fx.load(run, scene), progress=False)
        a, b = numbers(whole), numbers(path)
        if a.shape == b.shape:
            same += 1
            worst = max(worst, float((np.abs(a - b).max(0) / np.abs(a).max(0)).max()))
    return same, worst


def files() -> dict[str, str]:
    """Return {attempt: "right" or the fault}: an error must name the file, and the earlier file must be kept."""
    path = fx.trace(_scene(), until=fx.pole_height(0.05), progress=False)
    writers: dict[str, Callable] = {
        "path.to_csv": path.to_csv,
        "path.save": path.save, "path.report": path.report,
        "path.animate": lambda file: path.animate(file.with_suffix(".gif"), frames=3),
        "path.to_vtk": lambda file: path.to_vtk(file.with_suffix(".pvd"), "all"),
        "write_summary": lambda file: fx.results.files.write_summary(file, {"a": "x" * 200_000}, path.problem.comm)}
    found = {}
    for name, write in writers.items():
        with tempfile.TemporaryDirectory() as folder:
            for what, place in (("full disk", _full_disk(folder)), ("a file for a folder", _file_as_folder(folder))):
                if place is None:
                    found[f"{name}, {what}"] = "not tried: no right to mount"
                    continue
                found[f"{name}, {what}"] = _write(write, place, FilePath(folder) / what)
            _unmount(folder)
    return found


def _write(write: Callable, place: FilePath, _: Any) -> str:
    file = place / "old.csv"
    before = file.read_bytes() if file.exists() else None
    try:
        for _k in range(3):
            write(file)
    except (OSError, fx.InputError) as error:
        after = file.read_bytes() if before is not None else None
        left = [p.name for p in place.glob("*.part")] if place.is_dir() else []
        if after != before:
            return "the earlier file was lost"
        if left:
            return f"{left[0]} was left behind"
        return "right" if "old." in str(error) or str(place) in str(error) else f"the file is not named: {error}"
    except Exception as error:  # noqa: BLE001
        return f"{type(error).__name__}: {error}"
    return "no error"


def _full_disk(folder: str) -> FilePath | None:
    place = FilePath(folder) / "full"
    place.mkdir()
    if subprocess.run(["mount", "-t", "tmpfs", "-o", "size=64k", "tmpfs", place], capture_output=True).returncode:
        return None
    (place / "old.csv").write_text("an earlier file\n")
    with open(place / "filler", "wb") as stream:
        try:
            while True:
                stream.write(b"x" * 4096)
                stream.flush()
        except OSError:
            pass
    return place


def _unmount(folder: str) -> None:
    subprocess.run(["umount", os.path.join(folder, "full")], capture_output=True)


def _file_as_folder(folder: str) -> FilePath:
    place = FilePath(folder) / "plain"
    place.write_text("not a folder")
    return place


def main(what: list[str]) -> None:
    """Print the counts."""
    if not what or "bad" in what:
        found = bad_input()
        right = sum(o.outcome == "right" for o in found)
        print(f"bad input: {len(found)} tried, {right} gave the right kind of error before any solve")
        for o in found:
            if o.outcome != "right":
                print(f"  {o.call}({o.argument} = {o.bad}): {o.outcome} {o.error[:90]}")
    if not what or "ranks" in what:
        for name, worst in ranks().items():
            print(f"ranks 1, 2, 3, 4: {name} sheet: largest difference of a measure {worst:.1e}")
    if not what or "restarts" in what:
        same, worst = restarts()
        print(f"50 runs killed at random moments: {same} went on to the same path; largest difference {worst:.1e}")
    if not what or "files" in what:
        for name, outcome in files().items():
            print(f"{name}: {outcome}")


if __name__ == "__main__":
    options = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    options.add_argument("parts", nargs="*", choices=["bad", "ranks", "restarts", "files", []], metavar="PART",
                         help="bad, ranks, restarts or files (default: all)")
    main(options.parse_args().parts)
