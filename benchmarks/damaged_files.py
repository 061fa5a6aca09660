"""Read damaged files of every format: each must end in a right reading or an InputError, in time.

    ./fx python3 benchmarks/damaged_files.py [--files 5000] [--seed 0] [--kinds KIND ...]

A kind is a format (msh22, msh41, msh22b, msh41b, text, geo, dxf, step, brep, mshtool, csv, tests, heat, checkpoint).
File k of a seed is always the same. A file that lost its end, or in which a line is lost or there twice, must be
refused or read as it was, where the format counts or closes its contents. A changed digit cannot be known to be wrong;
such readings are only counted ("another").
"""

from __future__ import annotations

import argparse
import random
import re
import shutil
import signal
import sys
import tempfile
import traceback
import warnings
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

import formingx as fx
from formingx.extensions.fits.measured import read_tests
from formingx.io import csv_files
from formingx.scene.fields import values_at

LIMIT = 300                                                      # seconds for one file; CAD has a limit of its own
COUNTED = ("msh22", "msh41", "text", "dxf", "step", "checkpoint", "mshtool")
_WORDS = ["nan", "inf", "-1", "0", "1e308", "1e-308", "99999999999999999999", "1_0", "0x10", "1.5", "\u0661", "",
          "-", "1e400"]
STRUCTURE = ("cut", "line lost", "line twice")


def damage(data: bytes, rng: random.Random) -> tuple[str, bytes]:
    """Return the kind of damage, and the damaged data."""
    how = rng.choice([*STRUCTURE, *STRUCTURE, "swapped", "byte", "bytes", "number", "digit", "zeros", "moved"])
    n, lines = len(data), data.split(b"\n")
    k, m = rng.randrange(n), rng.randrange(len(lines))
    if how == "cut":
        return how, data[:k]
    if how in ("line lost", "line twice"):
        return how, b"\n".join(lines[:m] + [lines[m]] * 2 * (how == "line twice") + lines[m + 1:])
    if how == "swapped":
        j = rng.randrange(len(lines))
        lines[m], lines[j] = lines[j], lines[m]
        return how, b"\n".join(lines)
    if how in ("byte", "bytes"):
        out = bytearray(data)
        for _ in range(1 if how == "byte" else rng.randrange(2, 9)):
            out[rng.randrange(n)] = rng.randrange(256)
        return how, bytes(out)
    if how in ("number", "digit"):
        found = list(re.finditer(rb"[0-9][0-9.eE+-]*" if how == "number" else rb"[0-9]", data))
        if not found:
            return how, data
        at, word = rng.choice(found), rng.choice(_WORDS) if how == "number" else str(rng.randrange(10))
        return how, data[:at.start()] + word.encode() + data[at.end():]
    width, to = rng.randrange(1, 64), rng.randrange(n)
    piece = data[k:k + width]
    if how == "zeros":
        return how, data[:k] + bytes(len(piece)) + data[k + width:]
    rest = data[:k] + data[k + width:]
    return how, rest[:to] + piece + rest[to:]


def sources(folder: Path) -> dict[str, tuple[Path, Callable[[Path], Any]]]:
    """Return {kind: (a good file, a function that reads one and returns numbers of its contents)}."""
    sheet = fx.mesh.disc(radius=1.0, thickness={"a": 0.1, "b": 0.05}, elements=(6, 1))
    fx.mesh.write(sheet, folder / "msh22.msh")
    fx.mesh.write(sheet, folder / "text.txt")
    _with_gmsh(folder)
    (folder / "geo.geo").write_text("""r = 1; // a cup
Point(1) = {0, 5, 0}; Point(2) = {10 - r, 5, 0};\nPoint(3) = {10 - r, 5 - r, 0};
Point(4) = {10, 4, 0}; Point(5) = {10, 0, 0};\nLine(1) = {1, 2};\nCircle(2) = {2, 3, 4};\nLine(3) = {4, 5};
Physical Curve("mould") = {1, 2, 3};\n""")
    import ezdxf
    drawing = ezdxf.new()
    drawing.modelspace().add_line((0, 5), (9, 5))
    drawing.modelspace().add_arc((9, 4), 1, 0, 90)
    drawing.modelspace().add_lwpolyline([(10, 4, 0), (10, 2, 0.2), (10, 1, 0), (10, 0, 0)], format="xyb")
    drawing.modelspace().add_spline([(10, 0), (11, -1), (12, -1), (13, 0)])
    drawing.saveas(folder / "dxf.dxf")
    scene = fx.Scene(mesh=sheet, materials=fx.NeoHookean(c10=1.0), loads=[fx.Pressure("bottom")],
                     supports=[fx.Symmetry("axis"), fx.Clamped("rim")])
    path = fx.trace(scene, until=fx.pole_height(0.1), checkpoint=folder / "checkpoint", progress=False)
    path.to_csv(folder / "csv.csv")
    data = fx.treloar1944()
    (folder / "tests.csv").write_text("test,stretch,stress [MPa]\n" + "\n".join(
        f"{mode},{x!r},{y!r}" for mode, (l, P) in data.items() for x, y in zip(l.tolist(), P.tolist())) + "\n")
    (folder / "heat.csv").write_text("R;Z;T\n" + "\n".join(f"{R};{Z};{150 - 10 * R}".replace(".", ",")
                                                          for R in (0, 0.5, 1) for Z in (0, 0.1, 0.2)) + "\n")

    def body(file):
        grid = fx.mesh.to_grid(fx.mesh.read(file))
        return [_numbers(grid.points[np.unique(rows)]) for rows in (*grid.layers.values(), *grid.boundaries.values())]

    def tool(file):
        return fx.tools.read(file, tolerance=1e-3).outline()

    def table(file):
        return [np.nan_to_num(column) for column in csv_files.read(file).columns.values()]
    readers: dict[str, Callable] = {
        "msh22": body, "msh41": body, "msh22b": body, "msh41b": body, "text": body, "geo": tool, "dxf": tool,
        "step": tool, "brep": tool, "csv": table,
        "tests": lambda file: [np.array([test.stretch, test.stress]) for test in read_tests(file)],
        "mshtool": lambda file: fx.tools.read(file, [1, 2, 3]).outline(),
        "heat": lambda file: values_at(file, np.array([[0.2, 0.03], [0.9, 0.11]]), sheet),
        "checkpoint": lambda run: [_numbers(s.x) for s in fx.load(run, scene).states]}
    return {kind: (next(folder.glob(f"{kind}*")), reader) for kind, reader in readers.items()}


def _numbers(points: np.ndarray) -> np.ndarray:
    """Return a few numbers that change with any point, whatever the order of the points."""
    return np.array([len(points), *np.sum(points, axis=0, keepdims=True).ravel(), np.sum(np.sin(points * 7))])


def _with_gmsh(folder: Path) -> None:
    import gmsh
    gmsh.initialize(interruptible=False)
    try:
        gmsh.option.setNumber("General.Terminal", 0)
        for kind in ("body", "tool"):
            gmsh.model.add(kind)
            occ = gmsh.model.occ
            if kind == "body":
                occ.addRectangle(0, 0, 0, 2, 1)
                occ.synchronize()
                gmsh.model.addPhysicalGroup(2, [1], name="sheet")
                gmsh.model.addPhysicalGroup(1, [1], name="bottom")
                gmsh.option.setNumber("Mesh.MeshSizeMax", 0.5)
                gmsh.model.mesh.generate(2)
                gmsh.model.mesh.setOrder(2)
            else:
                a, b, c, d, e = (occ.addPoint(*p, 0) for p in ((0, 5), (9, 5), (9, 4), (10, 4), (10, 0)))
                occ.addLine(a, b), occ.addCircleArc(b, c, d), occ.addLine(d, e)
                occ.addSpline([e, occ.addPoint(11, -1, 0), occ.addPoint(12, -1, 0)])
                occ.synchronize()
                gmsh.write(str(folder / "step.step")), gmsh.write(str(folder / "brep.brep"))
                gmsh.model.mesh.generate(1)
            for version, binary in ((4.1, 0), (4.1, 1), (2.2, 1)):
                gmsh.option.setNumber("Mesh.MshFileVersion", version)
                gmsh.option.setNumber("Mesh.Binary", binary)
                name = f"msh{version:g}".replace(".", "") + "b" * binary if kind == "body" else "mshtool"
                gmsh.write(str(folder / f"{name}.msh"))
    finally:
        gmsh.finalize()


def run(files: int, seed: int = 0, kinds: tuple[str, ...] = (), found: Any = None) -> dict[str, Counter]:
    """Return {kind: {ending: count}}; print each ending that must not be: other errors, no end, another reading."""
    found = {} if found is None else found
    signal.signal(signal.SIGALRM, _too_long)
    with tempfile.TemporaryDirectory() as name, warnings.catch_warnings():
        warnings.simplefilter("ignore")
        folder = Path(name)
        for kind, (good, read) in sources(folder).items():
            if kinds and kind not in kinds:
                continue
            whole, found[kind] = read(good), Counter()
            for number in range(files):
                rng = random.Random(f"{seed} {kind} {number}")
                file = folder / f"damaged{good.suffix}"
                how = _damaged(good, file, rng)
                signal.alarm(LIMIT)
                try:
                    ending, bad = ("same", "") if _same(read(file), whole) else ("another", "")
                    if ending == "another" and how in STRUCTURE and kind in COUNTED:
                        bad = "read as something else"
                except fx.InputError as error:
                    ending, bad = "InputError", "" if str(error) else "without words"
                except Exception as error:  # noqa: BLE001  whatever else comes is what is looked for
                    last = traceback.extract_tb(error.__traceback__)[-1]
                    ending = "wrong"
                    bad = f"{type(error).__name__}: {error} ({Path(last.filename).name}:{last.lineno})"[:200]
                signal.alarm(0)
                found[kind][ending] += 1
                if bad:
                    found[kind]["bad"] += 1
                    print(f"{kind} {number} ({how}): {bad}", flush=True)
            print(f"{kind}: {dict(found[kind])}", flush=True)
    return found


def _damaged(good: Path, file: Path, rng: random.Random) -> str:
    """Write a damaged copy of a file, or of a folder in which one file is damaged; what was done."""
    if not good.is_dir():
        how, data = damage(good.read_bytes(), rng)
        file.write_bytes(data)
        return how
    shutil.rmtree(file, ignore_errors=True)
    shutil.copytree(good, file)
    one = rng.choice(sorted(p for p in file.rglob("*") if p.is_file() and p.stat().st_size))
    how, data = damage(one.read_bytes(), rng)
    one.write_bytes(data)
    return how


def _same(a: Any, b: Any) -> bool:
    return len(a) == len(b) and all(np.shape(x) == np.shape(y) and np.allclose(x, y, rtol=1e-9, atol=1e-12)
                                    for x, y in zip(a, b, strict=True))


def _too_long(*_: Any) -> None:
    raise TimeoutError(f"no end within {LIMIT} s")


def main() -> int:
    """Print the figures; 1 if anything ended badly."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--files", type=int, default=5000, help="files of each kind")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--kinds", nargs="*", default=[])
    options = parser.parse_args()
    found: dict[str, Counter] = {}
    try:
        run(options.files, options.seed, tuple(options.kinds), found)
    except KeyboardInterrupt:                                    # what was found up to there is told
        print({kind: dict(endings) for kind, endings in found.items()}, flush=True)
    return int(any(endings["bad"] for endings in found.values()))


if __name__ == "__main__":
    sys.exit(main())
