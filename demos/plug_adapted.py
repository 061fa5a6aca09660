"""Push Williams' plug on meshes that first runs adapt, under four coefficients of friction (Song 1993, 6.3).

The sheet and the plug are those of `plug_friction`, but no formula gives the elements. A run on 30 columns of one size
to 8 cm gives the lengths of the columns that lie on the plug's edge (`fx.mesh.adapted`). For little friction a run on
these columns to 12 cm adapts them once more; the next run is the result. For comparison there is a membrane that slides
over the same edge (it has neither bending nor shear stiffness), and at mu = 0.3 a run to 8 cm on uniform columns, twice
as many.

At 8 cm the forces are within 3 % of those of the membrane. Then each snap lowers the force by 1 to 3 %, and between
snaps it rises again: the force at one travel depends on the distance from the last snap, which differs from mesh to
mesh. The mean force from 8 to 12 cm, which is the work over the travel, is within 3 % (with mu = 1: 4 %). Beyond 12 cm,
the face penetrates itself (`first_verdict`). The runs continue with `allow_inadmissible=True`; the forces rise and fall
as points leave the edge, and at 20 cm they are 5 to 23 % off those of the membrane. Last, to 10 cm, the edge has a
radius of an eighth of the thickness, after two first runs (118 columns): 1112 N at 8 cm and 1258 N at 10 cm, where a
membrane takes 991 and 1162 N. Lengths in cm, forces in N. (The thesis recommends such meshes: recommendation 2.)
"""

import numpy as np
import plugs
from common import parser, save, say, summarise, sweep
from mpi4py import MPI
from plug_friction import ROUGH, THROUGH, membrane_curve
from williams_plug import C10, PLUG, RADIUS, THICKNESS

import formingx as fx
from formingx import figures
from formingx.results import files

FILLET, SHARP = 0.35, THICKNESS / 8
TRAVELS, SHARP_TRAVELS = (8.0, 12.0, 16.0, 20.0), (8.0, 10.0)
FRICTIONS = (1.0, 0.1, 0.5, 0.3)            # begun in this order, two processes are busy to the end
MEAN = 8.0, 12.0                            # travels between which forces are averaged
FIRST, SHARE = 30, 1 / 3
COMPARED = 0.3, FILLET                      # the case that has uniform columns beside it


def main():
    args = parser("plug_adapted", __doc__).parse_args()
    args.out.mkdir(parents=True, exist_ok=True)
    cases = [(mu, FILLET, TRAVELS) for mu in FRICTIONS] + [(0.3, SHARP, SHARP_TRAVELS)]
    if args.quick:
        cases = [(0.3, FILLET, (2.0, 4.0))]
    found = list(map(run, cases)) if args.quick else sweep(run, cases)
    summary: dict = {}
    ran = sorted(zip(cases, found), key=lambda case: (-case[0][1], case[0][0]))
    for (mu, fillet, _), (numbers, _) in ran:
        summary["fillet_h0/8" if fillet == SHARP else f"mu_{mu:g}"] = numbers
        print_numbers(mu, fillet, numbers)
    save(draw(ran), args.out / "plug_adapted.png")
    summarise(args.out, {**summary, "share": SHARE, "versions": files.versions()})


def sheet(columns, mu):
    """Return a mesh with columns of one size; friction shears the face, so elements there are flat."""
    through = THROUGH if mu >= ROUGH else (1,)
    return fx.mesh.disc(radius=RADIUS, thickness=THICKNESS, elements=(columns, through), comm=MPI.COMM_SELF)


def push(mesh, mu, fillet, travels):
    """Return the path of a sheet under the plug through the travels, and how it ended."""
    scene = fx.Scene(
        mesh=mesh, materials=fx.NeoHookean(c10=C10), model=fx.MixedPressure(space="P1"),
        supports=[fx.Symmetry("axis"), fx.Clamped("rim")],
        contacts=[fx.Contact("top", plugs.plug(PLUG, THICKNESS, fillet), mu, direction=(0, -1), points=4,
                             nodes_per_step=16, penalty=2e5, ramp=2e-2, elastic_slip=5e-3)])
    return plugs.push(scene, travels, smallest=1e-3, progress=False, allow_inadmissible=True)


def run(case):
    """Return the numbers of one coefficient of friction, and the curves to be drawn."""
    mu, fillet, travels = case
    pilots = [travels[:1]] if mu >= ROUGH or len(travels) < 3 else [travels[:1], travels[:2]]
    if fillet == SHARP:
        pilots = [travels[:1], travels]
    mesh, columns = sheet(FIRST, mu), []
    for on_the_way in pilots:
        path, _ = push(mesh, mu, fillet, on_the_way)
        mesh = fx.mesh.adapted(path, max_rotation=SHARE)
        columns.append(len(path.problem.scene.mesh.columns.ends) - 1)
    path, end = push(mesh, mu, fillet, travels)
    n = len(mesh.columns.ends) - 1
    membrane = membrane_curve(mu, fillet, travels[-1])
    numbers = {
        "force_N": forces(path, travels),
        "membrane_force_N": {f"{t:g}": float(np.interp(t, membrane.travel, membrane.force)) for t in travels},
        "columns": n, "columns_of_pilots": columns, "jumps": len(path.jumps), "ended": end,
        "reached_travel_cm": float(path["travel"].max()),
        "first_verdict": next((f"{s.measures['travel']:.4g} cm: {s.inadmissible_reason}" for s in path.states
                               if s.inadmissible_reason), ""),
        **plugs.cost(path)}
    if path["travel"].max() >= MEAN[1]:
        numbers["mean_force_N"] = mean_force(path["travel"], plugs.NEWTON * path["tool_force"])
        numbers["membrane_mean_force_N"] = mean_force(membrane.travel, membrane.force)
    if (mu, fillet) == COMPARED:
        uniform, end = push(sheet(2 * n, mu), mu, fillet, travels[:1])
        numbers["uniform"] = {"force_N": forces(uniform, travels[:1]), "columns": 2 * n, "jumps": len(uniform.jumps),
                              "ended": end, **plugs.cost(uniform)}
    return numbers, (path["travel"], plugs.NEWTON * path["tool_force"], *membrane[:2], mesh.columns.ends)


def forces(path, travels) -> dict:
    """Return {travel as text: force in N} at the travels that a path met."""
    met = {f"{t:g}": path.target_state(fx.travel(t)) for t in travels}
    return {t: plugs.force(state) for t, state in met.items() if state is not None}


def mean_force(travel, force) -> float:
    """Return the mean of forces, shape (n,), over the travel between the two of `MEAN`; travel: shape (n,)."""
    at = np.linspace(*MEAN, 2001)
    return float(np.interp(at, travel, force).mean())


def print_numbers(mu, fillet, n) -> None:
    """Print the numbers of one run."""
    uniform = [n["uniform"]] if "uniform" in n else []
    say(f"mu = {mu:g}, edge {fillet:.3g} cm: {n['columns']} columns (pilots {n['columns_of_pilots']}), {n['jumps']}"
        f" jumps, {n['steps']} states, {n['solve_seconds']:.1f} s; force (membrane), N: " + ", ".join(
            f"{t} cm {f:.1f} ({n['membrane_force_N'][t]:.0f})" for t, f in n["force_N"].items()),
        *(f"  {one['columns']} uniform columns: {one['force_N']}, {one['jumps']} jumps, {one['solve_seconds']:.1f} s"
          for one in uniform),
        *(f"  ended before its target: {one['ended'][:200]} ..." for one in (n, *uniform) if one["ended"] != "done"))


def draw(ran):
    """Return a figure: force over travel, the membrane dashed, and the columns of the adapted meshes."""
    figure, (left, right) = figures.figure(2, width=5.0)
    for k, ((mu, fillet, _), (_, (travel, force, at, membrane, ends))) in enumerate(ran):
        label = f"$\\mu$ = {mu:g}" + (", edge $h_0/8$" if fillet == SHARP else "")
        left.plot(travel, force, color=f"C{k}", label=label)
        left.plot(at, membrane, "--", color=f"C{k}", linewidth=1)
        right.stairs(np.diff(ends), ends, baseline=None, color=f"C{k}", label=f"{label}: {len(ends) - 1} columns")
    left.set(xlabel="travel, cm", ylabel="force on the plug, N", title="force (dashed: membrane)", xlim=(0, None),
             ylim=(0, None))
    right.set(xlabel="reference radius R, cm", title="meshes", yscale="log",
              ylabel="reference length of a column, cm")
    right.axvline(PLUG, color="0.7", linewidth=1)
    for axes in (left, right):
        axes.grid(alpha=0.3)
        axes.legend(frameon=False, fontsize="small")
    return figure


if __name__ == "__main__":
    main()
