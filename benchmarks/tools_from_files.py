"""States, iterations, processor time and walls on tools from STL and STEP files, over those on the exact tool.

    ./fx python3 benchmarks/tools_from_files.py [SIZE]

A ball is pushed into a disc, and a pressure forms a box tray with a lip: with stick, without friction and with a
coefficient of 0.3. The ball is a `fx.tools.sphere`, an STL file of 80 triangles, and a STEP file; the tray a
`fx.tools.box`, an STL file of 8 pieces an arc, and a STEP file. All runs of one scene have the same mesh. Differences
of walls are between equal triangles. SIZE: size of the triangles of the sheets.
"""

import sys
import time
from pathlib import Path
from tempfile import TemporaryDirectory
from unittest import mock

import numpy as np

import formingx as fx
from formingx.extensions.space import solid_tool
from formingx.mesh import with_gmsh

sys.path.insert(0, str(Path(__file__).parents[1] / "demos"))
from cad_tray import ball_of_triangles, rounded_wire

HELD = [fx.SimplySupported("rim"), fx.Symmetry("x0", "x"), fx.Symmetry("y0", "y")]
RADIUS, PIECES = 0.35, 8
HALF, DEPTH, CORNER, FILLET, LIP = np.array([1.0, 1.4]), 0.8, 0.4, 0.25, 0.15


def push(tool, friction, size):
    """Return the path of a quarter of a disc that a ball pushes."""
    contact = fx.Contact("top", tool, friction, direction=(0, 0, -1), name="ball")
    scene = fx.Scene(mesh=fx.mesh.sheet(fx.mesh.circle(1.0, part="quarter"), size=size), thickness=0.01,
                     materials=fx.NeoHookean(c10=1.0), supports=HELD, contacts=[contact])
    return fx.trace(scene, until=fx.travel(0.6), progress=False)


def form(tool, friction, size):
    """Return the path of a quarter of a sheet that a pressure forms into a tray."""
    sheet = fx.mesh.sheet(fx.mesh.rectangle(*(2.2 * HALF), corner=0.5, part="quarter"), size=size)
    scene = fx.Scene(mesh=sheet, thickness=0.02, materials=fx.NeoHookean(c10=1.0), supports=HELD,
                     loads=[fx.Pressure("top")], model=fx.Membrane(wrinkles=0.01),
                     contacts=[fx.Contact("bottom", tool, friction, name="mould")])
    return fx.trace(scene, until=fx.pressure(0.8), progress=False)


def balls(folder):
    """Return {name: ball}, exact and from files."""
    ball_of_triangles(folder / "ball.stl", RADIUS)
    with with_gmsh.model("ball", {"General.NumThreads": 1.0, "General.Terminal": 0.0}) as gmsh:
        gmsh.model.occ.addSphere(0, 0, RADIUS, RADIUS)
        gmsh.model.occ.synchronize()
        gmsh.write(str(folder / "ball.step"))
    return {"exact": fx.tools.revolved(fx.tools.sphere(radius=RADIUS)), "STL": fx.tools.solid(folder / "ball.stl"),
            "STEP": fx.tools.solid(folder / "ball.step")}


def trays(folder):
    """Return {name: mould}, exact and from files."""
    exact, outline = fx.tools.box(half=HALF, depth=DEPTH, corner=CORNER, fillet=FILLET, lip=LIP), fx.Tool.outline
    with (mock.patch.object(solid_tool, "_CORNER_PIECES", PIECES),
          mock.patch.object(fx.Tool, "outline", lambda self, n=PIECES: outline(self, PIECES))):
        exact.to_stl(folder / "tray.stl", wall=0.3)
    with with_gmsh.model("tray", {"General.NumThreads": 1.0, "General.Terminal": 0.0}) as gmsh:
        occ = gmsh.model.occ
        low, high = -DEPTH - 0.3, 0.0
        block = occ.addBox(*(-HALF - 0.6), low, *(2 * (HALF + 0.6)), high - low)
        wires = [rounded_wire(occ, HALF, CORNER, z) for z in (-DEPTH, 0.1)]
        mould = occ.cut([(3, block)], occ.addThruSections(wires, makeSolid=True, makeRuled=True))[0][0][1]
        for z, radius in ((-DEPTH, FILLET), (0.0, LIP)):
            occ.synchronize()
            faces = gmsh.model.getBoundary([(3, mould)], oriented=False)
            boxes = {tag: np.array(gmsh.model.getBoundingBox(1, tag)).reshape(2, 3)
                     for _, tag in gmsh.model.getBoundary(faces, combined=False, oriented=False)}
            edges = [tag for tag, box in boxes.items()
                     if np.allclose(box[:, 2], z, atol=1e-3) and (np.abs(box[:, :2]) < HALF + 0.3).all()]
            mould = occ.fillet([mould], sorted(set(edges)), [radius])[0][1]
        occ.synchronize()
        gmsh.write(str(folder / "tray.step"))
    return {"exact": exact, "STL": fx.tools.solid(folder / "tray.stl"),
            "STEP": fx.tools.solid(folder / "tray.step", scale=1.0)}


def main():
    size = float(sys.argv[1]) if len(sys.argv) > 1 else 0.08
    print("scene friction tool   states failed iterations     s |  least     rms   worst   force | ratios: states"
          " iterations time")
    with TemporaryDirectory() as name:
        for scene, tools, run in (("ball", balls(Path(name)), push), ("tray", trays(Path(name)), form)):
            for tool in tools.values():                      # compile, and search nearest points once
                run(tool, "stick", 0.3)
            for friction in ("stick", "none", 0.3):
                first = None
                for which, tool in tools.items():
                    begin = time.process_time()
                    path = run(tool, friction, size)
                    found = np.array([len(path), path.counts.iterations, time.process_time() - begin])
                    wall, force = path.wall(), path["tool_force"][-1]
                    ratio = wall.ratio
                    first = first or (found, ratio, force)
                    d = 100 * (ratio / first[1] - 1)
                    rms = np.sqrt(np.average(d**2, weights=wall.reference_area))
                    print(f"{scene}  {friction!s:8} {which:6} {found[0]:6.0f} {path.counts.failures:6}"
                          f" {found[1]:10.0f} {found[2]:5.1f} | {100 * (ratio.min() / first[1].min() - 1):+.2f} %"
                          f" {rms:.2f} % {np.abs(d).max():.2f} % {100 * (force / first[2] - 1):+.3f} % |"
                          f" {' '.join(f'{r:.2f}' for r in found / first[0])}", flush=True)


if __name__ == "__main__":
    main()
