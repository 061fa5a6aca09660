"""Call all public functions with random arguments and damaged files: each call must end, and end well.

    ./fx python3 benchmarks/fuzz.py [--calls 10000] [--seed 0] [--kinds KIND ...]

A call ends well in a result, an InputError, a ConvergenceError or an OSError, within 10 s. Whole runs, of the kind
`processes`, end well in states that hold (see `fuzz_runs.py`), within 90 s. Call k of a seed is always the same one, so
that a call that ended badly can be repeated: `--only K --seed SEED`. The calls run in a process of their own, which is
started again if a call ends it.
"""

from __future__ import annotations

import argparse
import contextlib
import json
import math
import os
import random
import selectors
import shutil
import subprocess
import sys
import tempfile
import time
import traceback
import warnings
from collections import Counter
from collections.abc import Callable, Iterator
from decimal import Decimal
from fractions import Fraction
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

LIMIT, OF_RUNS = 10.0, 90.0                    # seconds of a processor's time for one call; for a whole run
LONGEST = 6 * OF_RUNS                          # and of any, until the first call too: the machine may be busy


class Ending(NamedTuple):
    """Ending of a call: "result", "InputError", ..., or a fault; `bad` is True for a fault."""

    number: int
    call: str
    how: str
    bad: bool
    text: str = ""


def run(calls: int, seed: int = 0, kinds: tuple[str, ...] = ()) -> list[Ending]:
    """Return the endings of the calls, which run in child processes."""
    return list(_endings(calls, seed, kinds))


def _endings(calls: int, seed: int, kinds: tuple[str, ...]) -> Iterator[Ending]:
    done = 0
    while done < calls:
        for ending in _watched(done, calls, seed, kinds):
            done += 1
            yield ending


def _watched(first: int, last: int, seed: int, kinds: tuple[str, ...]) -> Iterator[Ending]:
    """Yield the endings of the calls of one process, up to the call that ends it or takes too long."""
    options = ["--child", first, last, "--seed", seed, *(["--kinds", *kinds] if kinds else [])]
    child = subprocess.Popen([sys.executable, __file__, *map(str, options)],
                             stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, cwd=Path(__file__).parents[1])
    assert child.stdout is not None
    number, began = first, ""
    with child, selectors.DefaultSelector() as ready:
        ready.register(child.stdout, selectors.EVENT_READ)
        buffer = b""
        while True:
            spent, until = _processor_time(child.pid), time.monotonic() + LONGEST
            while not ready.select(1.0):
                if time.monotonic() > until or began and _processor_time(child.pid) > spent + _limit(began):
                    child.kill()
                    yield Ending(number, began, f"no end within {_limit(began):g} s", True)
                    return
            part = os.read(child.stdout.fileno(), 65536)
            if not part:
                break
            *lines, buffer = (buffer + part).split(b"\n")
            for line in lines:
                found = json.loads(line)
                if isinstance(found, str):
                    began = found
                else:
                    yield Ending(*found)
                    number = found[0] + 1
        if number < last:
            yield Ending(number, began, f"the process died ({child.wait()})", True)


def _limit(call: str) -> float:
    return OF_RUNS if call.startswith("processes") else LIMIT


def _processor_time(process: int) -> float:
    """Return the processor time of a process (s)."""
    words = Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()
    return (int(words[11]) + int(words[12])) / os.sysconf("SC_CLK_TCK")


def child(first: int, last: int, seed: int, kinds: tuple[str, ...]) -> None:
    """Make the calls; print each call before it, and its ending after it."""
    out = os.fdopen(os.dup(1), "w", buffering=1)
    os.dup2(2, 1)                              # what the libraries print goes nowhere
    warnings.simplefilter("ignore")
    import formingx as fx
    with tempfile.TemporaryDirectory() as folder, contextlib.chdir(folder):
        makers = _itself() if kinds == ("itself",) else cases(Path(folder))
        names = [name for name in makers if not kinds or name.split()[0] in kinds]
        for number in range(first, last):
            rng = random.Random(f"{seed} {number}")
            name = rng.choice(names)
            out.write(json.dumps(name) + "\n")
            how, bad, text = "result", False, ""
            try:
                found = makers[name](rng)
                if isinstance(found, float | np.ndarray) and bool(np.any(found != found)):
                    how, bad = "not a number", True
            except (fx.InputError, fx.ConvergenceError, OSError) as error:
                how = type(error).__name__
                if not str(error):
                    how, bad = f"{how} without words", True
            except Exception as error:  # noqa: BLE001  whatever else comes is what is looked for
                how, bad = type(error).__name__, True
                text = f"{error}"[:200] + " | " + " < ".join(
                    f"{Path(f.filename).name}:{f.lineno}" for f in traceback.extract_tb(error.__traceback__)[:-7:-1])
            out.write(json.dumps([number, name, how, bad, text]) + "\n")


# What a user may put in the place of a number or a word.

_EXTREMES: list[Any] = [
    0, -0.0, 1, -1, 0.5, 5e-324, 1e-300, 1e300, -1e300, math.inf, -math.inf, math.nan, 10**400, 10**18, True, False,
    None, "", "1.0", "x", "bottom", "\0", "a" * 10_000, b"1", 1j, [], [1], (), (1.0, 2.0), (1, 2, 3), [[]],
    {}, {"a": 1}, {1: 2.0, 2: 3.0}, {0.5: 0.1}, set(), object(), len, lambda x: x, lambda x: None, int, range(3),
    Decimal("0.5"), Fraction(1, 3), np.float32(0.5), np.int64(3), np.array(1.0), np.array([1.0]), np.array([]),
    np.zeros((2, 2)), np.array("x"), np.complex128(1j), np.nan, Path("x"), Ellipsis, NotImplemented]


def anything(rng: random.Random) -> Any:
    """Return a value that is hardly ever right."""
    return rng.choice(_EXTREMES)


def near(good: Any, rng: random.Random) -> Any:
    """Return a value of the kind of a good one: often allowed, sometimes far out."""
    if isinstance(good, bool) or good is None or isinstance(good, str):
        return good
    if isinstance(good, int):
        return rng.choice([good, 1, 2, 3, rng.randint(1, 30)])
    if isinstance(good, float):
        return rng.choice([good, good * 10 ** rng.uniform(-1, 1), good * 10 ** rng.uniform(-8, 8),
                           10 ** rng.uniform(-320, 300), rng.uniform(-2, 2)])
    if isinstance(good, tuple | list) and good:
        return type(good)(near(g, rng) for g in good) if type(good) in (tuple, list) else good
    if isinstance(good, dict) and good:
        return {k: near(v, rng) for k, v in good.items()}
    return good


def varied(good: dict[str, Any], rng: random.Random) -> dict[str, Any]:
    """Return arguments: some near to good ones, some arbitrary, some left out."""
    given = {}
    for name, value in good.items():
        chance = rng.random()
        if chance < 0.9:
            given[name] = value if chance < 0.35 else near(value, rng) if chance < 0.75 else anything(rng)
    return given


def damaged(data: bytes, rng: random.Random) -> bytes:
    """Return the data of a file with some bytes, words or lines lost, doubled, swapped or replaced."""
    for _ in range(rng.randint(1, 4)):
        at = rng.randrange(len(data) + 1)
        to = min(len(data), at + rng.choice([1, 4, 30, 1000]))
        lines = data.split(b"\n")
        k = rng.randrange(len(lines))
        words = lines[k].split(b" ")
        w = rng.randrange(len(words))
        what = rng.randrange(8)
        if what == 0:
            data = data[:at]
        elif what == 1:
            data = data[:at] + data[to:]
        elif what == 2:
            data = data[:at] + rng.randbytes(to - at) + data[to:]
        elif what == 3:
            data = b"\n".join(lines[:k] + lines[k + 1:])
        elif what == 4:
            data = b"\n".join(lines[:k] + [lines[k]] * rng.choice([2, 3, 1000]) + lines[k + 1:])
        elif what == 5:
            m = rng.randrange(len(lines))
            lines[k], lines[m] = lines[m], lines[k]
            data = b"\n".join(lines)
        else:
            words[w] = rng.choice([b"-1", b"0", b"1", b"2", b"3", b"99999999999999999999", b"nan", b"inf", b"1e300",
                                   b"1e-320", b"", b"0.5", b'"', b"{", b"}", b"$End", b"#", b"\0", b"\xff",
                                   b"[" * 9000])
            data = b"\n".join(lines[:k] + [b" ".join(words)] + lines[k + 1:])
    return data


# What is called.

def _itself() -> dict[str, Callable[[random.Random], Any]]:
    """Return calls that end badly, to test the watch."""
    return {"itself dies": lambda rng: os.abort(), "itself raises": lambda rng: 1 / 0}


def cases(folder: Path) -> dict[str, Callable[[random.Random], Any]]:
    """Return {kind and name: a call}; the first word is the kind."""
    import formingx as fx
    sys.path.insert(0, str(Path(__file__).parent))
    import fuzz_runs
    import reliability
    mesh = fx.mesh.disc(radius=1.0, thickness={"a": 0.05, "b": 0.05}, elements=(4, 1))
    made = reliability._scene()
    fx.trace(made, until=fx.pole_height(0.05), progress=False).save(folder / "run")
    for suffix in ("msh", "txt"):
        fx.mesh.write(mesh, folder / f"mesh.{suffix}")
    found = {}
    for call in reliability.calls(made, str(folder / "run")):
        good = {k: v for k, (_, v) in call.arguments.items()}
        if call.name in ("trace", "Process.run", "solve", "check", "load"):
            found[f"runs {call.name}"] = lambda rng, c=call, g=good: c.make(**_required(c, g, rng))
        elif call.name != "mesh.read":
            found[f"{_kind(call.name)} {call.name}"] = lambda rng, c=call, g=good: _used(c, _required(c, g, rng))
    found |= _of_files(folder) | _of_fits() | _of_answers() | _of_tools() | _of_meshes() | _of_runs(folder, made)
    found |= _of_methods(made) | fuzz_runs.cases()
    return found


def _used(call: Any, given: dict[str, Any]) -> None:
    """Call a function, and use its result up to the solve."""
    import reliability
    with reliability.unsolved(), contextlib.suppress(reliability.ReachedTheSolve):
        made = call.make(**given)
        if call.use:
            call.use(made)


def _kind(name: str) -> str:
    return name.split(".")[0] if name.startswith(("mesh.", "tools.", "Mesh.")) else "constructors"


def _required(call: Any, good: dict[str, Any], rng: random.Random) -> dict[str, Any]:
    """Return varied arguments, but always those without a default: a missing one is a TypeError for any function."""
    import inspect

    import formingx as fx
    make = fx.Process.run if call.name == "Process.run" else call.make
    needed = {name for name, p in inspect.signature(make).parameters.items()
              if p.default is p.empty and p.kind is not p.VAR_KEYWORD}
    given = varied(good, rng)
    return {k: v for k, v in good.items() if k in needed and k not in given} | given


def _of_files(folder: Path) -> dict[str, Callable]:
    import formingx as fx
    from formingx.tools import shapes as tools
    (folder / "tool.geo").write_text("""r = 3; Point(1) = {0, 5, 0}; Point(2) = {r^2, 5, 0}; Point(3) = {9, 4, 0};
Point(4) = {10, 4, 0}; Point(5) = {10, 0, 0};\nLine(1) = {1, 2};\nCircle(2) = {2, 3, 4};\nLine(3) = {4, 5};
Physical Curve("mould") = {1, 2, 3};\n""")
    _cad(folder)

    def read(name: str, reader: Callable) -> Callable:
        data = (folder / name).read_bytes()

        def call(rng):
            file = folder / f"damaged{Path(name).suffix}"
            file.write_bytes(damaged(data, rng))
            return reader(file)
        return call
    meshes = ("mesh.msh", "mesh.txt", "mesh4.msh", "mesh4b.msh", "mesh2b.msh")
    return {f"files {n}": read(n, fx.mesh.read) for n in meshes} | {
        f"files tool {n}": read(n, lambda file: tools.read(file, [1, 2, 3])) for n in ("tool.geo", "mesh4.msh")}


def _cad(folder: Path) -> None:
    """Write files of gmsh: a square of six-node triangles, in its formats."""
    import gmsh
    gmsh.initialize(interruptible=False)
    try:
        gmsh.option.setNumber("General.Terminal", 0)
        gmsh.model.occ.addRectangle(0, 0, 0, 1, 1)
        gmsh.model.occ.synchronize()
        gmsh.model.addPhysicalGroup(2, [1], name="sheet")
        gmsh.model.addPhysicalGroup(1, [1, 2], name="edge")
        gmsh.model.mesh.setSize(gmsh.model.getEntities(0), 0.4)
        gmsh.model.mesh.generate(2)
        gmsh.model.mesh.setOrder(2)
        for name, version, binary in (("mesh4", 4.1, 0), ("mesh4b", 4.1, 1), ("mesh2b", 2.2, 1)):
            gmsh.option.setNumber("Mesh.MshFileVersion", version)
            gmsh.option.setNumber("Mesh.Binary", binary)
            gmsh.write(str(folder / f"{name}.msh"))
    finally:
        gmsh.finalize()


def _of_fits() -> dict[str, Callable]:
    import formingx as fx
    data = fx.treloar1944()

    def call(rng):
        material = rng.choice([fx.NeoHookean, fx.MooneyRivlin, fx.Yeoh, fx.Gent, fx.ArrudaBoyce, fx.Ogden,
                               fx.Gent(mu=1.0, Jm=100.0), anything(rng)])
        modes = rng.sample(list(data), rng.randint(1, 3))
        tests = {mode: tuple(rng.choice([c, c[:rng.randint(0, 9)], c * 10 ** rng.uniform(-320, 300), -c, c.tolist(),
                                         np.full(len(c), rng.choice([1.0, 0.0, math.nan, 5.0])), anything(rng)])
                             if rng.random() < 0.4 else c for c in data[mode]) for mode in modes}
        return str(fx.fit(material, rng.choice([tests, tests, tests, anything(rng)]),
                          rng.choice([None, None, 1, 2, anything(rng)])))
    return {"fits fit": call}


def _of_answers() -> dict[str, Callable]:
    """Return calls that compare curves and check scenes, with mistakes in columns, units, stages and sizes."""
    import reliability

    import formingx as fx

    def side(rng):
        n = rng.randint(0, 6)
        far = [rng.choice([1e308, -1e308, 5e-324, 0.0, 1.0]) for _ in range(n)]
        column = [[near(0.1 * k, rng) for k in range(n)], far]
        return rng.choice([{"a": rng.choice(column), "b": rng.choice(column)}] * 5 + [anything(rng)])

    def compare(rng):
        columns = rng.choice([None, ["a", "b"], {"a": "b", "b": "a"}, anything(rng)])
        str(fx.compare(side(rng), side(rng), columns=columns,
                       units=rng.choice([None, {"a": near(2.0, rng)}, {"b": "mm"}, anything(rng)])))

    def check(rng):
        scene = rng.choice([reliability._scene, reliability._named])()
        target = rng.choice([fx.pressure, fx.travel, fx.pole_height])
        stage = fx.Stage("on", control=rng.choice(scene.drivable), until=target(near(0.1, rng) * rng.choice([1, -1])))
        mixed = rng.choice([[stage], [], anything(rng)])
        str(fx.check(scene, targets=rng.choice([[], [fx.pole_stretch(2.0)], anything(rng)]), stages=mixed,
                     units=rng.choice([fx.Units(length="mm", stress="MPa"), fx.Units(), anything(rng)])))

    def made(rng):
        kind = rng.choice([fx.NeoHookean, fx.MooneyRivlin, fx.Gent, fx.Yeoh, fx.Ogden, fx.Viscoelastic])
        kind(*[rng.choice([1.0, [1.0], anything(rng)]) for _ in range(rng.randint(0, 3))],
             **{name: near(1.0, rng) for name in rng.sample(["c10", "c01", "mu", "alpha", "Jm", "branches"], 2)})
    return {"answers compare": compare, "answers check": check, "answers material": made}


# what laws give the package: of UFL expressions, of a problem
_LAWS = {"strain_energy", "step_energy", "stored_energy", "equilibrium_energy", "elastic_stretches", "damage_energy",
         "dissipation", "updated", "step_error", "check_constants", "constants_at", "guesses", "bind", "shear_limit",
         "column", "in_cells", "together"}


def _of_methods(made: Any) -> dict[str, Callable]:
    """Return calls of methods of scenes, meshes, tools and results."""
    import inspect

    import formingx as fx
    path = fx.trace(made, until=fx.pole_height(0.1), progress=False)
    things = {type(thing).__name__: thing for thing in (
        path, made, made.mesh, fx.MooneyRivlin(c10=1.0, c01=0.2), fx.KBKZ([(1.0, 1.0)]), fx.WLF(10.0, 100.0, 120.0),
        fx.Viscoelastic(fx.NeoHookean(c10=1.0), branches=[(0.5, 1.0)]), fx.fit(fx.NeoHookean, fx.treloar1944()),
        fx.tools.cup(radius=1.0, depth=0.5), path.profile(), path.stress(), path.part(), path.wall(), fx.Units("mm"),
        fx.compare(path, path, columns=["pole_height", "pressure"]))}
    good: list[Any] = [path, path.last, made, made.mesh, "pressure", fx.pressure(0.1), 0.5, 2, "top", (0.1, 0.4)]

    def names_of(thing: Any) -> list[str]:
        return [name for name in dir(thing) if name == "__call__" or not name.startswith("_") and name not in _LAWS
                and name not in dir(tuple) and callable(getattr(thing, name))]

    def one(thing: Any, names: list[str]) -> Callable:
        def call(rng):
            method = getattr(thing, rng.choice(names))
            given = {p.name: rng.choice(good) if rng.random() < 0.4 else anything(rng)
                     for p in inspect.signature(method).parameters.values()
                     if p.kind not in (p.VAR_KEYWORD, p.VAR_POSITIONAL)
                     and rng.random() < (0.95 if p.default is p.empty else 0.4)}
            return method(**given)
        return call
    return {f"methods {name}": one(thing, names) for name, thing in things.items() if (names := names_of(thing))}


def _of_tools() -> dict[str, Callable]:
    from formingx.tools.shapes import Arc, Line, Tool

    def number(rng):
        return rng.choice([rng.uniform(-2, 2), rng.randint(-2, 2), rng.randint(-2, 2), anything(rng)])

    def point(rng):
        return rng.choice([np.array([rng.randint(-2, 2), rng.randint(-2, 2)], float), (number(rng), number(rng))])

    def pieces(rng):
        parts = [Line(point(rng), point(rng)) if rng.random() < 0.6 else
                 Arc(point(rng), number(rng), number(rng), number(rng)) for _ in range(rng.randint(0, 4))]
        return Tool.of_pieces(parts, rng.random() < 0.3).signed_distance(np.ones((3, 2)))

    def points(rng):
        n = rng.randint(0, 6)
        fillets = rng.choice([0.0, 0.1, [rng.choice([0, 0.1, 1]) for _ in range(n)], number(rng)])
        tool = Tool([point(rng) for _ in range(n)], fillets, rng.random() < 0.3)
        tool = rng.choice([tool, tool.mirrored(), tool.moved(r=0.3), tool.turned(20)])
        repr(tool), tool.outline()
        near = tool.nearest(np.random.default_rng(0).uniform(-2, 2, (20, 2)))
        assert np.all(np.isfinite(near.distance)) and np.allclose(np.hypot(*near.normal.T), 1)
    return {"tools Tool.of_pieces": pieces, "tools Tool": points}


def _of_meshes() -> dict[str, Callable]:
    import formingx as fx

    def thickness(rng):
        one = rng.choice([0.1, lambda x: 0.1 + 0.05 * x, {0: 0.1, 1: 0.2}, {-1: 0.1, 0: 0.2, 2: 0.1}, anything(rng)])
        return rng.choice([one, {"a": one, "b": 0.1}])

    def made(make: Callable, **good: Any) -> Callable:
        def call(rng):
            mesh = make(**{k: v for k, v in good.items()} | varied({"thickness": 0.1, **good}, rng)
                        | {"thickness": thickness(rng)})
            mesh.check()
        return call

    def moved(rng):
        mesh = fx.mesh.disc(radius=1.0, thickness=0.3, elements=(4, 2))
        x = mesh.domain.geometry.x
        for _ in range(rng.randint(1, 3)):
            x[rng.randrange(len(x)), rng.randint(0, 1)] += rng.choice([1e-3, 0.1, -0.1, 0.5, 1e300, math.nan])
        mesh.check()
    return {"mesh disc": made(fx.mesh.disc, radius=1.0, elements=(4, 1), grading=1.0),
            "mesh parison": made(fx.mesh.parison, inner_radius=1.0, length=2.0, elements=(6, 1)),
            "mesh sphere": made(fx.mesh.sphere, inner_radius=1.0, elements=(4, 1)), "mesh moved": moved}


def _of_runs(folder: Path, made: Any) -> dict[str, Callable]:
    """Return calls on checkpoints with damaged files, and processes with random tables."""
    import reliability

    import formingx as fx

    def load(rng):
        copy = folder / "copy"
        shutil.rmtree(copy, ignore_errors=True)
        shutil.copytree(folder / "run", copy)
        files = sorted(p for p in copy.rglob("*") if p.is_file())
        for file in rng.sample(files, min(len(files), rng.randint(1, 2))):
            what = rng.randrange(4)
            if what == 0:
                file.unlink()
            elif what == 1:
                file.rename(file.with_name(rng.choice(["0", "²", "x", "00000000000000000001"])))
            else:
                file.write_bytes(damaged(file.read_bytes(), rng))
        fx.load(copy, made)

    def table(rng):
        rows = [(near(0.1 * k, rng) if rng.random() < 0.3 else 0.1 * k, near(0.02 * k, rng) if rng.random() < 0.3
                 else 0.02 * k) for k in range(rng.randint(0, 4))]
        if rng.random() < 0.3:
            rows.append(anything(rng))
        stage = fx.Stage("on", amplitudes=rng.choice([{"air": rows}, {"plug": rows}, {"air": rows, "plug": rows}]))
        fx.Process(reliability._named()).run([stage], progress=False, max_steps=20)
    return {"runs damaged checkpoint": load, "runs table": table}


def main() -> int:
    """Print how the calls ended; 1 if one ended badly."""
    options = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    options.add_argument("--calls", type=int, default=10000)
    options.add_argument("--seed", type=int, default=0)
    options.add_argument("--kinds", nargs="+", default=[], help="first words of what is called: files, runs, ...")
    options.add_argument("--only", type=int, metavar="K", help="make call K of the seed, and no other")
    options.add_argument("--child", type=int, nargs=2, help=argparse.SUPPRESS)     # first and last call
    args = options.parse_args()
    calls = args.child if args.only is None else (args.only, args.only + 1)
    if calls:
        child(*calls, args.seed, tuple(args.kinds))
        return 0
    found: Counter = Counter()
    with contextlib.suppress(KeyboardInterrupt):               # what was found up to there is told
        for e in _endings(args.calls, args.seed, tuple(args.kinds)):
            found[e.how] += 1
            if e.bad:
                found["bad"] += 1
                print(f"call {e.number} of seed {args.seed}: {e.call}: {e.how} {e.text}", flush=True)
    print(*(f"{n:6} {how}" for how, n in found.most_common()), sep="\n")
    return int(found["bad"] > 0)


if __name__ == "__main__":
    sys.exit(main())
