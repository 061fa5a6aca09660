"""Chill a hot sheet on a cold tool that conducts heat: aluminium, syntactic foam, steel.

The sheet is 1 mm thick and at 150 C. The tool is 20 mm thick, its back is kept at 30 C, and the contact has a
conductance of 1000 W/(m2 K); above is air at 25 C. Each temperature is compared with a Laplace transform of sheet and
tool (formingx/exact/heat.py). SI units, temperatures in C.
"""

import numpy as np
from common import parser, summarise
from slab import SHEET, at_times, draw, print_errors, same_slab, slab

import formingx as fx
from formingx.exact import heat as reference
from formingx.results import files

THICKNESS, START, CONDUCTANCE = 1e-3, 150.0, 1000.0
H, AIR = 10.0, 25.0
DEPTH, BACK = 20e-3, 30.0                                           # of the tool
TOOLS = {"aluminium": (167.0, 2.4192e6), "foam": (0.17, 0.84e6), "steel": (40.0, 3.611e6)}   # k, rho c
TIMES = (0.05, 0.2, 1, 3, 10)
NAMES = ("face", "mid", "top", "tool_face")


def chill(mesh, conductivity, capacity, tolerance):
    """Return the run and its temperatures at NAMES, shape (times, 4); k in W/(m K), rho c in J/(m3 K)."""
    tool = fx.ConductingTool(thickness=DEPTH, conductivity=conductivity, heat_capacity=capacity, back=BACK)
    run = fx.heat(mesh, SHEET, [fx.ContactWithTool("bottom", conductance=CONDUCTANCE, tool=tool),
                                fx.Convection("top", h=H, air=AIR)], start=START, times=TIMES, unit="C",
                  tolerance=tolerance)
    sheet = run.at_points([(0.0, 0.0), (0.0, THICKNESS / 2), (0.0, THICKNESS)])
    return run, np.column_stack([sheet, [run.tool_profile("bottom", (0.0, 0.0), t)[1][0] for t in TIMES]])


def exact(conductivity, capacity):
    """Return the temperatures of `chill` by Laplace transform."""
    sheet, tool = reference.sheet_on_tool(
        same_slab(THICKNESS), reference.Slab(DEPTH, conductivity, capacity), CONDUCTANCE, START, BACK, H, AIR,
        [0.0, THICKNESS / 2, THICKNESS], [0.0], TIMES)
    return np.column_stack([sheet, tool])


def draw_tool(axes, _, run):
    """Draw the temperatures of the tool below the sheet, to a depth of two thicknesses."""
    for t, line in zip(TIMES, list(axes.lines)):
        depth, T = run.tool_profile("bottom", (0.0, 0.0), t)
        near = depth < 2 * THICKNESS
        axes.plot(-1e3 * depth[near], T[near], color=line.get_color())
    axes.axvspan(-2e3 * THICKNESS, 0, color="0.92", zorder=0)
    axes.set(xlabel="above the tool's face, mm", xlim=(-2e3 * THICKNESS, 1e3 * THICKNESS))


def main():
    args = parser("chilling", __doc__).parse_args()
    mesh, tolerance = slab(THICKNESS, 10 if args.quick else 24), 1e-3 if args.quick else 5e-5
    summary, errors, runs = {}, {}, {}
    for name, (conductivity, capacity) in TOOLS.items():
        runs[name], found = chill(mesh, conductivity, capacity, tolerance)
        errors[name] = print_errors(name, NAMES, TIMES, found, exact(conductivity, capacity), START - AIR, runs[name])
        summary[name] = at_times(NAMES, TIMES, found)
        runs[name].to_csv(args.out / f"{name}.csv")
    draw(runs, args.out / "through_sheet_and_tool.png", 2, draw_tool)
    summarise(args.out, {**summary, "largest_error_over_span": errors, "versions": files.versions()})


if __name__ == "__main__":
    main()
