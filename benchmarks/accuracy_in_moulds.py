"""Error of the wall and cost of `accuracy=` for sheets that tools touch, in twelve moulds, beside uniform meshes.

    ./fx python3 benchmarks/accuracy_in_moulds.py [--only cup tub] [--again] [--references FILE]

The error is the largest relative difference of the wall at a node, farther than a thickness from the constrained end,
to a mesh with columns of half the length of "fine" and two more elements through the sheet. The cost is processor time
of the whole run, forms compiled before, and iterations times unknowns. The cheapest uniform mesh is the one of
`UNIFORM` with the lowest iterations times unknowns among those that keep the promise. A coarse mesh may keep it by
chance. The cheapest safe one is therefore sought among those whose finer meshes keep it, too. --only keeps the other
moulds' numbers, --again their references and uniform meshes.
"""

import argparse
import json
import time
from pathlib import Path

import numpy as np
from mpi4py import MPI

import formingx as fx
from formingx.results import files

PROMISED = {"draft": 0.03, "standard": 0.01, "fine": 0.003}
UNIFORM = [(20, 1), (20, 2), (30, 1), (30, 2), (40, 1), (40, 2), (60, 1), (60, 2), (80, 2), (120, 2), (160, 2)]


BODIES = {"cup": {"radius": 10.0, "thickness": 0.3}, "trough": {"radius": 10.0, "thickness": 0.3},
          "pot": {"radius": 40.0, "thickness": 1.2}, "bottle": {"inner_radius": 1.1, "thickness": 0.3, "length": 10.6},
          "dish": {"radius": 50.0, "thickness": 1.0}, "tub": {"radius": 32.0, "thickness": 1.2},
          "stepped": {"radius": 34.0, "thickness": 1.0}, "ribbed": {"radius": 42.0, "thickness": 1.0},
          "thin": {"radius": 57.0, "thickness": 0.19}, "tray": {"radius": 48.0, "thickness": 2.5},
          "sliding_cup": {"radius": 10.0, "thickness": 0.3}, "slippery_dish": {"radius": 50.0, "thickness": 1.0}}


def body(name, **given):
    """Return the mesh of a body; given: its accuracy or its elements."""
    return (fx.mesh.parison if name == "bottle" else fx.mesh.disc)(**BODIES[name], **given)


def in_mould(mesh, material, tool, pressure, kinematics=None, friction="stick", step=None, nodes_per_step=None):
    """Return the path of a sheet that is blown into a mould above it, up to a pressure."""
    scene = fx.Scene(mesh=mesh, materials=material, kinematics=kinematics,
                     supports=[fx.Symmetry("axis"), fx.Clamped("rim")], loads=[fx.Pressure("bottom")],
                     contacts=[fx.Contact("top", tool, friction, nodes_per_step=nodes_per_step)])
    return fx.trace(scene, until=fx.pressure(pressure), step=step, progress=False)


def cup(mesh, kinematics=None, friction="stick"):
    """Return the path of demos/cup.py; cm, psi."""
    return in_mould(mesh, fx.MooneyRivlin(c10=50.0, c01=15.0),
                    fx.tools.cup(radius=10.0, depth=5.0, mouth=0.3, fillet=1.0), 160.0, kinematics, friction)


def trough(mesh):
    """Return the path of the cup in plane strain."""
    return cup(mesh, fx.PlaneStrain())


def pot(mesh):
    """Return the path of the README's pot, with a plug; mm, MPa."""
    tools = fx.tools.pot(mouth=38.0, base=28.0, depth=40.0, sheet=1.2, fillet=8.0, lip=3.0, nose=20.0)
    scene = fx.Scene(mesh=mesh, materials=fx.NeoHookean(c10=0.4),
                     supports=[fx.Symmetry("axis"), fx.Clamped("rim")], loads=[fx.Pressure("bottom", name="air")],
                     contacts=[fx.Contact("top", tools.mould, "stick", separates=False, name="mould"),
                               fx.Contact("bottom", tools.plug, "none", direction=(0, 1), name="plug")])
    return fx.Process(scene).run([fx.Stage("plug", control="plug", until=fx.travel(22.0)),
                                  fx.Stage("air", control="air", until=fx.pressure(0.09))], progress=False)


def bottle(mesh):
    """Return the path of demos/parison.py."""
    mould = fx.tools.bottle(radius=3.0, height=10.0, neck=1.5, shoulder=2.0, neck_height=1.5, base=-2.9, fillet=0.8,
                            shoulder_fillet=0.8)
    scene = fx.Scene(mesh=mesh, materials=fx.MooneyRivlin(c10=50.0, c01=15.0), loads=[fx.Pressure("inner")],
                     supports=[fx.Symmetry("axis"), fx.Clamped("neck")], contacts=[fx.Contact("outer", mould, "stick")])
    return fx.trace(scene, until=fx.pressure(200.0), progress=False)


def dish(mesh, friction="stick"):
    """Return the path of a conical dish with a rounded step half-way up; mm, MPa."""
    tool = fx.tools.Tool([(0.0, 26.0), (22.0, 26.0), (30.0, 14.0), (38.0, 14.0), (48.0, 1.0), (100.0, 1.0)],
                         [0.0, 4.0, 3.0, 3.0, 2.0, 0.0])
    return in_mould(mesh, fx.NeoHookean(c10=0.3), tool, 0.3, friction=friction)


def tub(mesh):
    """Return the path of a deep narrow tub with a small fillet, of a material that stiffens; mm, MPa."""
    tool = fx.tools.cup(radius=30.0, depth=36.0, mouth=1.2, draft=4.0, fillet=2.5, lip=2.0)
    return in_mould(mesh, fx.Gent(mu=0.5, Jm=60.0), tool, 1.0)


def stepped(mesh):
    """Return the path of a cup with a step half-way up, over which the sheet is bent; mm, MPa."""
    tool = fx.tools.Tool([(0.0, 31.0), (16.0, 31.0), (18.0, 17.0), (29.0, 16.0), (32.0, 1.0), (80.0, 1.0)],
                         [0.0, 4.0, 4.0, 4.0, 2.5, 0.0])
    return in_mould(mesh, fx.MooneyRivlin(c10=0.3, c01=0.05), tool, 0.3)


def ribbed(mesh):
    """Return the path of a cup whose floor has a rib, with edges about as sharp as the sheet is thick; mm, MPa."""
    tool = fx.tools.Tool([(0.0, 20.0), (12.0, 20.0), (14.0, 16.0), (18.0, 16.0), (20.0, 20.0), (36.0, 20.0),
                          (40.0, 1.0), (90.0, 1.0)], [0.0, 1.5, 1.2, 1.2, 1.5, 3.5, 2.0, 0.0])
    return in_mould(mesh, fx.NeoHookean(c10=0.4), tool, 0.25)


def thin(mesh):
    """Return the path of a thin sheet (r0/h0 = 300) in a wide shallow cup; mm, MPa."""
    tool = fx.tools.cup(radius=55.0, depth=22.0, mouth=0.2, draft=6.0, fillet=5.0, lip=2.0)
    return in_mould(mesh, fx.NeoHookean(c10=0.4), tool, 0.03)


def tray(mesh):
    """Return the path of a thick sheet (r0/h0 = 19) in a shallow mould; mm, MPa."""
    tool = fx.tools.cup(radius=46.0, depth=7.0, mouth=2.5, draft=10.0, fillet=4.0, lip=3.0)
    return in_mould(mesh, fx.NeoHookean(c10=0.4), tool, 0.4)


def sliding_cup(mesh):
    """Return the path of the cup with a coefficient of friction of 0.3."""
    return cup(mesh, friction=0.3)


def slippery_dish(mesh):
    """Return the path of the dish without friction."""
    return dish(mesh, friction="none")


MOULDS = {run.__name__: run for run in (cup, pot, bottle, trough, dish, tub, stepped, ribbed, thin, tray, sliding_cup,
                                        slippery_dish)}


def wall(path):
    """Return the material coordinates of the nodes that count and the wall there, shape (n,) each, length."""
    profile = path.profile()
    s = profile.reference_length
    counts = s <= s[-1] - profile.original_thickness[-1]
    return s[counts], profile.wall_thickness[counts]


def error(path, reference):
    """Return the largest relative error of the wall; reference: from `wall`."""
    s, found = wall(path)
    return float(np.abs(found / np.interp(s, *reference) - 1).max())


def elements(path):
    """Return the numbers of elements along and through the sheet."""
    columns = path.problem.scene.mesh.columns
    return len(columns.ends) - 1, len(columns.place(columns.ends[:1])) // 2


def finest(path, preset):
    """Return the mesh of a reference: half as long columns, two more elements through the sheet."""
    ends = path.problem.scene.mesh.columns.ends
    both = np.sort(np.concatenate([ends, (ends[1:] + ends[:-1]) / 2]))
    return preset.make(both, [elements(path)[1] + 2])


def measured(name, mesh):
    """Return the path of a run, and a row of its cost."""
    began = time.process_time()
    path = MOULDS[name](mesh)
    seconds = time.process_time() - began
    along, through = elements(path)
    unknowns, iterations = path.problem.n_unknowns, path.counts.iterations
    return path, {"along": along, "through": through, "unknowns": unknowns, "iterations": iterations,
                  "states": path.counts.steps, "million": unknowns * iterations / 1e6, "seconds": seconds}


def in_one_mould(name, stored=None, accuracies=tuple(PROMISED)):
    """Return the rows of a mould: its reference, all uniform meshes, and each accuracy beside the cheapest of them.

    stored: rows of an earlier call; its reference and uniform meshes are kept.
    """
    measured(name, body(name, elements=(10, 1)))                     # compile the forms
    paths, rows = {}, dict(stored or {})
    for accuracy in accuracies:
        paths[accuracy], rows[accuracy] = measured(name, body(name, accuracy=accuracy))
    if stored is None:
        fine = paths[accuracies[-1]]
        path, row = measured(name, finest(fine, body(name, accuracy="fine").preset))
        s, h = wall(path)
        rows["reference"] = {**row, "length": s.tolist(), "wall": h.tolist()}
    reference = rows["reference"]["length"], rows["reference"]["wall"]
    for accuracy, path in paths.items():
        rows[accuracy]["error"] = error(path, reference)
    for given in UNIFORM if stored is None else ():
        path, row = measured(name, body(name, elements=given))
        rows.setdefault("uniform", []).append({**row, "error": error(path, reference)})
        print(f"{name:8}{line(rows['uniform'][-1])}", flush=True)
    return with_cheapest(rows)


def with_cheapest(rows):
    """Return the rows of a mould with the cheapest uniform mesh that keeps each promise, and the ratios of costs.

    "safe" is the cheapest uniform mesh of which all finer ones, with at least as many elements in both directions, keep
    the promise; "safe_ratio" is the ratio of iterations times unknowns to it.
    """
    for accuracy in (name for name in PROMISED if name in rows):
        row, keeps = rows[accuracy], [row for row in rows["uniform"] if row["error"] <= PROMISED[accuracy]]
        best = min(keeps, key=lambda row: row["million"], default=None)
        fails = [row for row in rows["uniform"] if row["error"] > PROMISED[accuracy]]
        lasting = [row for row in keeps if not any(finer["along"] >= row["along"] and finer["through"] >= row["through"]
                                                   for finer in fails)]
        safe = min(lasting, key=lambda row: row["million"], default=None)
        row["safe"] = safe and f"{safe['along']} x {safe['through']}"
        row["safe_ratio"] = safe and row["million"] / safe["million"]
        row["elements"] = f"{row['along']} x {row['through']}"
        row["cheapest"] = best and f"{best['along']} x {best['through']}: {best['error']:.2%}, {best['seconds']:.2f} s"
        row["million_ratio"], row["seconds_ratio"] = (best and row[key] / best[key] for key in ("million", "seconds"))
    return rows


def line(row):
    """Return a row as text."""
    return (f"{row['along']:5} x {row['through']}{100 * row['error']:8.2f} %{row['seconds']:8.2f} s"
            f"{row['million']:8.3f} million{row['iterations']:5} iterations")


def main():
    options = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    options.add_argument("--only", nargs="+", choices=MOULDS, default=list(MOULDS))
    options.add_argument("--again", action="store_true", help="keep stored references and uniform meshes")
    options.add_argument("--references", type=Path, help="also write the walls on the finest meshes, to 6 digits")
    options.add_argument("--out", type=Path, default=Path("results/accuracy_in_moulds"), help="folder for summary.json")
    args = options.parse_args()
    file = args.out / "summary.json"
    found = json.loads(file.read_text()) if file.is_file() else {}
    for name in args.only:
        found[name] = rows = in_one_mould(name, found.get(name) if args.again else None)
        for accuracy in PROMISED:
            row = rows[accuracy]
            print(f"{name:8}{line(row)}  {accuracy}; cheapest uniform mesh {row['cheapest']}: ratio of costs"
                  f" {row['million_ratio'] or 0:.2f}, of times {row['seconds_ratio'] or 0:.2f}; cheapest safe mesh"
                  f" {row['safe']}: ratio of costs {row['safe_ratio'] or 0:.2f}", flush=True)
        files.write_summary(file, {key: found[key] for key in MOULDS if key in found}, MPI.COMM_WORLD)
    if args.references:
        args.references.write_text(json.dumps({name: {key: [float(f"{x:.6g}") for x in found[name]["reference"][key]]
                                                      for key in ("length", "wall")} for name in found}) + "\n")


if __name__ == "__main__":
    main()
