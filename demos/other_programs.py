"""Solve problems of other programs' verification manuals: their results, ours and the deviation.

Each case is as its source states it; the definitions are those of the input files that the programs publish:

* Ansys, `src/ansys/mapdl/core/examples/verif/vm56.dat`, `vm201.dat` and `vm218.dat` of github.com/ansys/pymapdl;
* code_aster, `astest/ssnv187a.comm` and the page v6.04.187 of its manual;
* solids4foam, `tutorials/solids/hyperelasticity/cylindricalPressureVessel` of github.com/solids4foam/solids4foam, and
  the results of github.com/solids4foam/soids4foam-tutorials-benchmark-data.
"""

import numpy as np
from common import COMM, parser, save, say, summarise
from scipy.interpolate import CubicSpline

import formingx as fx
from formingx import figures
from formingx.exact.inflation import membrane_inflation
from formingx.results import files

VM218 = [(1.25, 1.25), (1.8, 2.5), (2.25, 4.0), (2.6, 5.9), (2.9, 7.8), (3.2, 9.8), (3.5, 11.6), (3.62, 12.6),
         (4.1, 15.3), (4.9, 18.8), (5.7, 22.1), (6.2, 24.0), (7.2, 27.9), (8.3, 31.2), (8.9, 32.9), (9.9, 35.8),
         (10.9, 38.0), (13.1, 42.9), (14.4, 45.0), (15.2, 46.0)]    # in, psi: the graph that its input file plots
PLATE = {"radius": 7.5, "thickness": 0.5, "c10": 80.0, "c01": 20.0}                             # in, psi


def row(ours, theirs, unit):
    """Return one row of the summary: a number of ours and theirs, and ours over theirs less 1."""
    return {"ours": float(ours), "theirs": theirs, "deviation": float(ours) / theirs - 1, "unit": unit}


def tube(inner, outer, material, pressure, n):
    """Return the path of a long tube in plane strain to an inner pressure; n elements through its wall."""
    mesh = fx.mesh.disc(radius=outer, inner_radius=inner, thickness=2 * (outer - inner) / n, elements=(n, 2))
    scene = fx.Scene(mesh=mesh, materials=material, loads=[fx.Pressure("inner")],
                     supports=[fx.Symmetry("bottom", normal="z"), fx.Symmetry("top", normal="z")])
    return fx.trace(scene, until=fx.pressure(pressure), progress=False)


def in_wall(path, R):
    """Return (displacement, radial stress, hoop stress) of a tube at reference radius R."""
    Z = path.problem.scene.mesh.nodes_of("top")[0, 1]
    bound = fx.displacement(0.0, at=(R, Z), component="r").bind(path.problem)
    stress = path.stress().at_points([(R, Z / 2)]).cauchy[0]
    return path.value(bound, path.last), stress[0, 0], stress[2, 2]


def vm56(fine):
    """Solve Ansys VM56: a thick tube, Mooney 80 and 20 psi, 7 to 18.625 in, under 150 psi.

    The stress is taken in the middle of the inner fifth of the wall. The target is from Oden (1972), pages 325 to 331.
    """
    path = tube(7.0, 18.625, fx.MooneyRivlin(c10=80.0, c01=20.0), 150.0, fine)
    inner, middle = in_wall(path, 7.0), in_wall(path, 7.0 + 11.625 / 10)
    return {"inner_displacement": row(inner[0], 7.180, "in"), "radial_stress": row(middle[1], -122.0, "psi")}


def solids4foam(fine):
    """Solve solids4foam's tubes at 100 MPa: neo-Hookean, 8 to 16 m, and Mooney, 7 to 18.625 m.

    E = 1000 MPa of an incompressible solid is c10 = 500/3 MPa; the program has its exact solution. For the second tube
    it has a finite-volume result with Poisson's ratio 0.49, here in the innermost cell, centred at R = 7.1527 m.
    """
    path = tube(8.0, 16.0, fx.NeoHookean(c10=500 / 3), 100.0, fine)
    exact = in_wall(path, 8.0), in_wall(path, 12.0)
    cell = in_wall(tube(7.0, 18.625, fx.MooneyRivlin(c10=80.0, c01=20.0), 100.0, fine), np.hypot(5.04792, 5.06754))
    return {"exact_inner_displacement": row(exact[0][0], 2.252601910, "m"),
            "exact_radial_stress_at_12": row(exact[1][1], -30.99156160, "MPa"),
            "exact_hoop_stress_at_12": row(exact[1][2], 138.2202518, "MPa"),
            "nu_0.49_displacement": row(cell[0], float(np.hypot(2.19809, 2.20665)), "m"),
            "nu_0.49_radial_stress": row(cell[1], -96.0717, "MPa"),
            "nu_0.49_hoop_stress": row(cell[2], 218.104, "MPa")}


def quarter(radius, size, file):
    """Return a quarter of a round bar: six-node triangles of a size, half of it at the top."""
    if COMM.rank == 0:
        import gmsh
        gmsh.initialize()
        gmsh.option.setNumber("General.Terminal", 0)
        geo = gmsh.model.geo
        middle, right = (geo.addPoint(x, 0, 0, 2 * size) for x in (0, radius))
        top = geo.addPoint(0, radius, 0, size)
        lines = [geo.addLine(middle, right), geo.addCircleArc(right, middle, top), geo.addLine(top, middle)]
        geo.addPlaneSurface([geo.addCurveLoop(lines)])
        geo.synchronize()
        for line, name in zip(lines, ("bottom", "outer", "axis")):
            gmsh.model.addPhysicalGroup(1, [line], name=name)
        gmsh.model.addPhysicalGroup(2, [1], name="rubber")
        gmsh.model.mesh.generate(2)
        gmsh.model.mesh.setOrder(2)
        file.parent.mkdir(parents=True, exist_ok=True)
        gmsh.write(str(file))
        gmsh.finalize()
    COMM.Barrier()
    return fx.mesh.read(file)


def vm201(size, out):
    """Solve Ansys VM201: a rubber bar, radius 200 mm, between plates without friction: force per mm of length.

    The plates approach by 0.1 and 0.2 m. A quarter is meshed: its plate moves half of that, and the force is that on
    the whole plate. The targets are read from a graph of Sussman and Bathe (1987).
    """
    scene = fx.Scene(mesh=quarter(200.0, size, out / "bar.msh"), materials=fx.MooneyRivlin(c10=0.293, c01=0.177),
                     kinematics=fx.PlaneStrain(), supports=[fx.Symmetry("axis"), fx.Symmetry("bottom", normal="z")],
                     contacts=[fx.Contact("outer", fx.tools.plane(200.0), "none", direction=(0, -1))])
    path = fx.trace(scene, until=fx.travel(100.0), intermediate=[fx.travel(50.0)], progress=False)
    force = [path.target_state(fx.travel(half)).measures["tool_force"] for half in (50.0, 100.0)]
    return {"force_at_0.1": row(force[0], 250.0, "N"), "force_at_0.2": row(force[1], 1400.0, "N")}


def vm218(elements, out):
    """Solve Ansys VM218: a hinged circular plate, Mooney 80 and 20 psi: height of the pole at 4, 24 and 38 psi.

    Its targets are read from a graph. Membrane theory is given beside them, because the graph deviates from it.
    """
    scene = fx.Scene(mesh=fx.mesh.disc(radius=7.5, thickness=0.5, elements=elements), loads=[fx.Pressure("bottom")],
                     materials=fx.MooneyRivlin(c10=80.0, c01=20.0),
                     supports=[fx.Symmetry("axis"), fx.SimplySupported("rim")])
    path = fx.trace(scene, until=fx.pressure(46.0), progress=False)

    states = [membrane_inflation(s, **PLATE) for s in 1 + np.geomspace(1e-3, 2.3, 60)]
    heights, pressures = np.array([(state.height, state.pressure) for state in states]).T
    height, pressure = CubicSpline(pressures, heights), CubicSpline(heights, pressures)
    found = {f"height_at_{p:g}": row(path.state_at(fx.pressure(p)).measures["pole_height"], theirs, "in") | {
        "membrane": (exact := float(height(p))), "theirs_over_membrane": theirs / exact - 1}
        for theirs, p in VM218 if p in (4.0, 24.0, 38.0)}
    found["graph_pressure_over_membrane"] = {f"{w:g}": p / float(pressure(w)) - 1 for w, p in VM218}
    figure, axes = figures.figure()
    axes.plot(*np.array(VM218).T, "o", color="C1", fillstyle="none", label="VM218's graph")
    axes.plot(*path.curve("pole_height", "pressure"), label="formingx, solid")
    axes.plot(heights, pressures, "k--", linewidth=1, label="membrane theory")
    axes.set(xlabel="height of the pole, in", ylabel="pressure, psi", xlim=(0, 16), ylim=(0, 50))
    axes.legend(frameon=False)
    save(figure, out / "other_programs.png")
    return found


def ssnv187a(n):
    """Solve code_aster SSNV187A: a unit square in plane strain under a dead pressure of .876 on top: its displacement.

    Its reference is exact for an incompressible square; the run of half of it is homogeneous.
    """
    def signorini(I1, I2, c10, c01, c20):
        return c10 * (I1 - 3) + c01 * (I2 - 3) + c20 * (I1 - 3) ** 2
    laws = {"mooney_rivlin": (fx.MooneyRivlin(c10=0.709, c01=2.3456), 0.034009),
            "neo_hookean": (fx.NeoHookean(c10=1.2345), 0.07818),
            "signorini": (fx.Hyperelastic(signorini, c10=0.1234, c01=1.2345, c20=0.456), 0.070936)}
    found = {}
    for name, (law, theirs) in laws.items():
        scene = fx.Scene(mesh=fx.mesh.disc(radius=0.5, thickness=1.0, elements=(n, n)), materials=law,
                         kinematics=fx.PlaneStrain(), supports=[fx.Symmetry("axis"), fx.Symmetry("bottom", normal="z"),
                                                                fx.PrescribedDisplacement("top", name="press")])
        path = fx.trace(scene, until=fx.force(0.876), progress=False)
        found[name] = row(-path.last.measures["travel"], theirs, "")
    return found


def main():
    args = parser("other_programs", __doc__).parse_args()
    quick = args.quick
    summary = {"ansys_vm56": vm56(8 if quick else 32), "ansys_vm201": vm201(20.0 if quick else 5.0, args.out),
               "ansys_vm218": vm218((20, 1) if quick else (60, 2), args.out), "code_aster_ssnv187a": ssnv187a(2),
               "solids4foam": solids4foam(8 if quick else 32)}
    for problem, rows in summary.items():
        for name, numbers in rows.items():
            if "ours" not in numbers:
                continue
            say(f"{problem}, {name}: {numbers['ours']:.6g} {numbers['unit']}, theirs {numbers['theirs']:g},"
                f" deviation {numbers['deviation']:+.2e}" + (
                    f"; theirs is {numbers['theirs_over_membrane']:+.1%} off membrane theory"
                    if "membrane" in numbers else ""))
    graph = summary["ansys_vm218"]["graph_pressure_over_membrane"].values()
    say(f"VM218's graph is {min(graph):+.1%} to {max(graph):+.1%} off the pressure of membrane theory")
    summarise(args.out, {**summary, "versions": files.versions()})


if __name__ == "__main__":
    main()
