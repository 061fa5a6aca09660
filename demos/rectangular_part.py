"""Form a long rectangular part by pressure, in plane strain (Song 1993, section 5.3.2, figs. 5.8 and 5.9).

The thesis prints no dimensions: half width, thickness, depth, fillet, material and pressures are those of demos/cup.py.
A stuck sheet is compared with the membrane law of a trough, which depends on the geometry alone. Lengths in cm,
stresses in psi.
"""

import cup
import numpy as np
from common import parser, say, summarise
from moulding import name_of, report

import formingx as fx
from formingx.results import files


def stuck_membrane(half_width, depth, fillet, points=400):
    """Return R and the thickness ratio of a membrane stuck in a filled trough that is wider than it is deep.

    The free part is an arc of a circle with one thickness t and the length L; parts in contact keep their thickness.
    First the arc touches nothing, then the floor, d(t L) = -t dx. Then it touches floor and wall in the corner, d(t L)
    = 2 t drho, with the radius rho: t is in proportion to rho^(4/pi - 1). It ends on the fillet.
    """
    w = np.linspace(half_width, depth, points)                     # width of the free arc while it comes down the floor
    rho = (w**2 + depth**2) / (2 * depth)
    L = rho * np.arctan2(w, rho - depth)
    laid = np.concatenate([[0.0], np.cumsum(np.diff(w) * (1 / L[1:] + 1 / L[:-1]) / 2)])
    floor = half_width / L * np.exp(laid)
    r = np.linspace(depth, fillet, points)                         # radius of the arc in the corner
    corner = floor[-1] * (r / depth) ** (4 / np.pi - 1)
    s = np.concatenate([half_width - w, half_width - r[1:], half_width + (np.pi / 2 - 2) * fillet + r[::-1]])
    t = np.concatenate([floor, corner[1:], corner[::-1]])
    R = np.concatenate([[0.0], np.cumsum(np.diff(s) * (t[1:] + t[:-1]) / 2)])
    return R, t


def main():
    options = parser("rectangular_part", __doc__, elements=60, layers=2)
    args = options.parse_args()
    elements = (20, 1) if args.quick else (args.elements, args.layers)
    R, ratio = stuck_membrane(cup.RADIUS, cup.DEPTH, cup.FILLET)
    summary = {"membrane": {"floor_thickness_ratio": ratio[0], "least_thickness_ratio": ratio.min()}}
    say(f"Forming a long rectangular part, {elements[0]} x {elements[1]} x 2 triangles for one half",
        f"membrane law, stuck: thickness ratio {ratio[0]:.5f} at the middle, {ratio.min():.5f} at the fillet")
    for friction in cup.LAWS:
        name = name_of(friction)
        path, mould = cup.form(friction, elements, kinematics=fx.PlaneStrain())
        summary[name] = cup.key_numbers(path, mould)
        report(path, mould, summary[name], cup.PRESSURES, args.out, name, along="reference position R",
               curve=(R, ratio, "membrane") if friction == "stick" else None)
        if friction == "stick":
            profile = path.profile()
            inside = profile.reference_radius < cup.RADIUS - cup.THICKNESS              # beyond, the clamp counts
            law = np.interp(profile.reference_radius, R, ratio)
            summary[name]["mean_deviation_from_membrane"] = np.abs(profile.thickness_ratio / law - 1)[inside].mean()
            if not args.quick:
                path.view3d(args.out / "rectangular_part_3d.png")
    summarise(args.out, {**summary, "mesh": {"radius_elements": elements[0], "thickness_elements": elements[1]},
                         "versions": files.versions()})


if __name__ == "__main__":
    main()
