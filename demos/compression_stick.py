"""Press a block with stick and friction, against formulas of Lindley and Tanner (Song 1993, section 7.3.2).

I1 constant 1.0 MPa, I2 constant 0.1 MPa (chapter 7 takes C01 as the I1 constant), and the other way round. The total
deflection is 2 (H - h). If stuck, the side of the block may roll onto the plates (fig. 7.3).
"""

import numpy as np
from common import parser, save, say, summarise
from plates import HALF_HEIGHT, NEWTON, RADIUS, block, draw_grids, force, forces, press

import formingx as fx
from formingx import figures
from formingx.results import files

DEFLECTIONS = (0.1, 0.2, 0.3, 0.4)                           # total, cm
LAWS = ("stick", 0.05, 0.1, 0.2, 0.3, "none")
NAMES = {"none": "frictionless", "stick": "stick"}


def lindley(deflection, c=1.1):
    """Return Lindley's force (N) at a total deflection (cm): eq. (7.9) with k = 1, c = C01 + C10 (MPa)."""
    axial = 1 - deflection / (2 * HALF_HEIGHT)               # 1 / lambda_r^2
    shape = 1 + RADIUS**2 / (8 * HALF_HEIGHT**2)
    return NEWTON * 6 * np.pi * RADIUS**2 * c * shape * (1 - axial) * (2 - axial)


def tanner(deflection, c=1.1):
    """Return Tanner's force (N) at a total deflection (cm).

    Eq. (7.11) gives the force at h = H/2; it is taken as proportional to the deflection.
    """
    at_half = NEWTON * 9 / 16 * np.pi * RADIUS**2 * 6 * c * (RADIUS / (HALF_HEIGHT / 2)) ** 2
    return at_half * deflection / HALF_HEIGHT


def main():
    options = parser("compression_stick", __doc__)
    options.add_argument("--elements", type=int, default=16,
                         help="elements along the radius, and along the half height")
    args = options.parse_args()
    n = 6 if args.quick else args.elements
    travels = [d / 2 for d in DEFLECTIONS]
    summary, curves = {}, {}
    for group, c10, c01 in (("", 1.0, 0.1), ("other_reading", 0.1, 1.0)):
        found = {}
        for law in LAWS:
            path, end = press(block(fx.MooneyRivlin(c10=c10, c01=c01), law, (n, n)), travels)
            name = NAMES.get(law, f"mu_{law}")
            found[name] = forces(path, travels, [f"{d:g}" for d in DEFLECTIONS])
            say(f"{group or 'c10 = 1.0, c01 = 0.1'} {name}: " + "  ".join(f"{v:.2f} N" for v in found[name].values())
                + f"; {path.counts.steps} states, {path.counts.iterations} iterations, {path.counts.failures} cut back"
                + ("" if end == "done" else f"; {end}"))
            if not group:
                curves[name] = path
        target = summary.setdefault("other_reading", {}) if group else summary
        target["force_N_at_total_deflection_cm"] = found
    theirs = {f"{d:g}": lindley(d) for d in DEFLECTIONS}
    stuck = summary["force_N_at_total_deflection_cm"]["stick"]
    summary |= {"lindley_N": theirs, "tanner_N": {f"{d:g}": tanner(d) for d in DEFLECTIONS},
                "stick_over_lindley": {d: stuck[d] / theirs[d] for d in stuck}}
    summary["further"] = numbers_at_largest_deflection(n, args.out)
    say("stick over Lindley: " + "  ".join(f"{d}: {v:.4f}" for d, v in summary["stick_over_lindley"].items()))
    figure, axes = figures.figure(width=6.2)
    for name, path in curves.items():
        axes.plot(2 * path["travel"], NEWTON * path["tool_force"], ".-", label=name.replace("mu_", "$\\mu$ = "))
    fine = np.linspace(0, DEFLECTIONS[-1], 100)
    axes.plot(fine, lindley(fine), "k--", label="Lindley (7.9)")
    axes.plot(fine, tanner(fine), "k:", label="Tanner (7.11)")
    axes.set(xlabel="total deflection, cm", ylabel="force, N", ylim=(0, 2.2 * lindley(fine[-1])))
    axes.legend(frameon=False, loc="upper right")
    save(figure, args.out / "force.png")
    summarise(args.out, {**summary, "mesh": {"elements": [n, n]}, "versions": files.versions()})


def numbers_at_largest_deflection(n, out) -> dict:
    """Return the numbers of stuck blocks at a total deflection of 1.3 cm, the largest of the thesis.

    The blocks have a side that may roll onto the plates or not, on 64 triangles and on n x n elements. A run that ends
    earlier gives its largest deflection, and `reached` is false.
    """
    found = {}
    for elements in dict.fromkeys([(8, 4), (n, n)]):
        for roll_over in (True, False):
            material = fx.MooneyRivlin(c10=1.0, c01=0.1)
            path, end = press(block(material, "stick", elements, roll_over=roll_over), [0.65], max_steps=300)
            name = f"{elements[0]}x{elements[1]}_{'roll_over' if roll_over else 'free'}"
            state = max(path.states, key=lambda s: s.measures["travel"])        # a run may turn back
            at = 2 * state.measures["travel"]
            found[name] = {"reached": end == "done", "total_deflection_cm": at, "force_N": force(state),
                           "over_lindley": force(state) / float(lindley(at)), "ended": end}
            say(f"{name}: {force(state):.1f} N at {at:.3f} cm, {found[name]['over_lindley']:.3f} of Lindley"
                + ("" if end == "done" else f", the furthest that it was pressed; ended: {end[:160]}"))
            side = "side rolls onto the plates" if roll_over else "side without contact"
            draw_grids(path, [state], [f"{elements[0]} x {elements[1]} elements, {side}, {at:.2f} cm"], elements,
                       out / f"grid_{name}.png")
    return found


if __name__ == "__main__":
    main()
