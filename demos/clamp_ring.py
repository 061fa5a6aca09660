"""Grip Treloar's sheet between two rings with rounded edges, and compare with a clamped and a supported rim.

The question is for which rim the stress converges. Neo-Hookean, c10 = 2.0 kg/cm2; opening of radius 1.25 cm,
h0 = 0.082 cm. The edges of the rings have the radius h0 and no friction. The sheet ends 2 h0 behind them, where the
mean displacement of its rim is constrained. Each case is run on meshes of 30 n x 2 n elements, small at the rim. The
peak is the largest principal stress at the rim. Lengths in cm, stresses in kg/cm2.
"""

import logging

from common import COMM, parser, save, say, summarise
from matplotlib.collections import PolyCollection

import formingx as fx
from formingx import figures
from formingx.results import files
from formingx.results.files.fields import Fields

RADIUS, THICKNESS, C10 = 1.25, 0.082, 2.0
FILLET, GRIPPED = THICKNESS, 2 * THICKNESS
STRETCH, END = 1.5, 2.6                                # of the pole: where stresses are read; beyond the maximum
RING = fx.tools.clamp_ring(radius=RADIUS, width=2 * FILLET + GRIPPED, fillet=FILLET)
UPPER, LOWER = RING.moved(z=THICKNESS), RING.mirrored()
COLOURS = {"rings": "tab:green", "clamped": "tab:red", "simply_supported": "tab:blue"}


def sheet(n, radius, *small):
    """Return the mesh of 30 n x 2 n elements, small at some radii."""
    return fx.mesh.disc(radius=radius, thickness=THICKNESS, elements=(30 * n, 2 * n),
                        concentrate=dict.fromkeys(small, 0.25))


def scene(held, n):
    """Return the scene of the sheet on the n-th mesh; `held` is one of its three supports."""
    if held == "rings":
        flat = RADIUS + FILLET
        mesh = sheet(n, flat + GRIPPED, RADIUS, flat).with_part("blown", "bottom", within=(0, RADIUS))
        contacts = [fx.Contact("top", UPPER, "none", name="upper ring"),
                    fx.Contact("bottom", LOWER, "none", name="lower ring")]
        support, load = fx.SimplySupported("rim"), fx.Pressure("blown")
    else:
        mesh, contacts, load = sheet(n, RADIUS, RADIUS), [], fx.Pressure("bottom")
        support = fx.Clamped("rim") if held == "clamped" else fx.SimplySupported("rim")
    return fx.Scene(mesh=mesh, materials=fx.NeoHookean(c10=C10), supports=[fx.Symmetry("axis"), support], loads=[load],
                    contacts=contacts)


def inflate(held, n):
    """Return the path beyond the maximum of the pressure, or up to the crease of a clamped corner."""
    try:
        return fx.trace(scene(held, n), until=fx.pole_stretch(END), intermediate=[fx.pole_stretch(STRETCH)],
                        progress=False)
    except fx.ConvergenceError as error:
        if error.path.target_state(fx.pole_stretch(STRETCH)) is None:
            raise
        return error.path


def key_numbers(path):
    """Return the numbers of the summary of one path; the peak is taken in the outer part of the sheet."""
    state, limit = path.target_state(fx.pole_stretch(STRETCH)), path.limit_points
    peak = path.stress(state).peak(radii=(0.9 * RADIUS, 2 * RADIUS))
    return {"limit_pressure_kg_per_cm2": limit[0].measures["pressure"] if limit else None,
            "arrived": path.target_state(fx.pole_stretch(END)) is not None,
            "pressure_kg_per_cm2_at_stretch_1.5": state.measures["pressure"],
            "peak_stress_kg_per_cm2_at_stretch_1.5": peak.value, "peak_at_R_Z_cm": list(map(float, peak.point)),
            "peak_converged": peak.converged, "newton_iterations": path.counts.iterations}


def table(numbers):
    """Return the lines of a table of all runs."""
    lines = [f"{'':18}{'n':>3}{'limit pressure':>16}{'peak stress':>13}  at (R, Z)        converged  arrived"]
    for held, runs in numbers.items():
        for n, found in runs.items():
            limit, at = found["limit_pressure_kg_per_cm2"], found["peak_at_R_Z_cm"]
            lines.append(f"{held.replace('_', ' '):18}{n:>3}{f'{limit:.5f}' if limit else '-':>16}"
                         f"{found['peak_stress_kg_per_cm2_at_stretch_1.5']:>13.3f}  ({at[0]:.4f}, {at[1]:.3f})"
                         f"{'yes' if found['peak_converged'] else 'no':>11}{'yes' if found['arrived'] else 'no':>9}")
    return lines


def draw(numbers, paths, out):
    """Draw the peaks against the refinement, and the sheet at the rim, clamped and between the rings."""
    figure, (left, *right) = figures.figure(3, width=4.6, height=4.2)
    for held, runs in numbers.items():
        left.plot([int(n) for n in runs], [r["peak_stress_kg_per_cm2_at_stretch_1.5"] for r in runs.values()], ".-",
                  color=COLOURS[held], label=held.replace("_", " "))
    left.set(xlabel="n, of meshes of 30 n x 2 n elements", ylabel="largest $\\sigma_1$ at the rim, kg/cm$^2$",
             title=f"peak at a pole stretch of {STRETCH}", ylim=(0, None))
    left.xaxis.get_major_locator().set_params(integer=True)
    left.legend(frameon=False)
    for axes, held in zip(right, ("clamped", "rings")):
        shades = draw_stress(axes, paths[held], held)
    figure.colorbar(shades, ax=right, label="$\\sigma_1$, kg/cm$^2$", shrink=0.8)
    save(figure, out / "clamp_ring.png")


def draw_stress(axes, path, held):
    """Draw the deformed elements at the rim; return their colours by the largest principal stress."""
    fields = Fields(path)
    found = fields.evaluate(path.target_state(fx.pole_stretch(STRETCH)))
    corners = (fields.points + found["displacement"])[:, :3]
    shades = PolyCollection(corners, array=found["principal_stresses"][:, :3, 0].mean(1), cmap="viridis",
                            edgecolors="white", linewidths=0.2, clim=(0, 12))
    axes.add_collection(shades)
    if held == "rings":
        for tool in (UPPER, LOWER):
            axes.fill(*tool.outline().T, color="0.8")
    axes.set(xlim=(RADIUS - 0.22, RADIUS + 0.28), ylim=(-0.2, 0.3), aspect="equal", xlabel="r, cm", ylabel="z, cm",
             title=held)
    axes.grid(False)
    return shades


def main():
    options = parser("clamp_ring", __doc__)
    options.add_argument("--refinements", nargs="+", type=int, default=[1, 2, 3], help="numbers n of the meshes")
    args = options.parse_args()
    logging.getLogger("formingx").setLevel(logging.ERROR)      # the table says which peaks have not converged
    refinements = [1, 2] if args.quick else args.refinements
    numbers, paths = {held: {} for held in COLOURS}, {}
    for held in COLOURS:
        for n in refinements:
            paths[held] = inflate(held, n)
            numbers[held][str(n)] = key_numbers(paths[held])
    say(*table(numbers))
    if COMM.size == 1:                                         # a rank has its own elements only
        draw(numbers, paths, args.out)
    summarise(args.out, {**numbers, "versions": files.versions()})


if __name__ == "__main__":
    main()
