"""Push a plug into a clamped PMMA sheet at 160 C (Song 1993, section 6.3, figs. 6.1 to 6.5; test of Williams 1970).

Neo-Hookean, c10 = 0.448 MPa (chapter 6 takes C10 as the I1 constant); r0 = 8.89 cm, h0 = 0.6985 cm, plug radius
1.905 cm. The thesis' plug has a sharp edge; here it is rounded (--fillet). There are four contacts of plug and sheet:
"held", points that touch stay where they touched (the thesis' no slip); "stick", rough, but the sheet may separate;
Coulomb friction; "frictionless" (the thesis' slip). "driven_nodes" is the thesis' own scheme for no slip: nodes within
the plug's radius move with it, as under a sharp edge. It reaches 20 cm on a coarse mesh only (--refine 2: 8 cm),
because the corner is singular. Lengths in cm, forces in N.
"""

import numpy as np
import plugs
from common import parser, save, say, summarise

import formingx as fx
from formingx import figures
from formingx.results import files

RADIUS, THICKNESS, PLUG, C10 = 8.89, 0.6985, 1.905, 0.448
TRAVELS = tuple(float(t) for t in range(2, 21, 2))
PLACES = {"0": 0.0, "rp+h0/2": PLUG + THICKNESS / 2, "rp+h0": PLUG + THICKNESS, "rp+2h0": PLUG + 2 * THICKNESS}
THESIS = {"flat_top_ratio_measured_by_Williams": 0.51, "flat_top_ratio_with_slip": [0.3, 0.7],
          "pole_stretch_with_slip": 1.25, "mean_hoop_deviation_outside_plug_with_slip": 0.062,
          "reached_cm_without_slip": 20.0}
# law: (elements, the pole stretch at which the run ends, or None: 20 cm)
RUNS = {"held": ((60, 2), None), "stick": ((60, 2), None), 0.3: ((120, 2), 3.0), "frictionless": ((80, 3), 3.0)}
QUICK = {"held": ((40, 2), None), "frictionless": ((50, 2), 2.0)}


def main():
    options = parser("williams_plug", __doc__)
    options.add_argument("--fillet", type=float, default=0.35, help="radius of the plug's edge, cm")
    options.add_argument("--refine", type=int, default=1, help="divisor of the size of all elements")
    args = options.parse_args()
    limit = plugs.force_limit(PLUG, THICKNESS, C10)
    summary, paths = {"thesis": THESIS, "force_limit_without_friction_N": limit}, {}
    for law, (elements, stretch) in (QUICK if args.quick else RUNS).items():
        name, elements = plugs.name_of(law), tuple(n * args.refine for n in elements)
        made = plugs.scene(RADIUS, THICKNESS, PLUG, args.fillet, fx.NeoHookean(c10=C10), law, elements)
        path, end = plugs.push(made, TRAVELS, stretch)
        n = plugs.key_numbers(path, end, TRAVELS, PLACES, PLUG, THICKNESS)
        summary[name], paths[name] = n | {"elements": list(elements)}, path
        print_numbers(name, n)
        if law == "frictionless":                                # figures 6.3 and 6.4
            state = path.state_at(fx.pole_stretch(THESIS["pole_stretch_with_slip"]))
            n = plugs.shape_numbers(path, state, PLUG, THICKNESS)
            n |= {"travel_cm": state.measures["travel"], "force_N": plugs.force(state)}
            summary["frictionless_at_pole_stretch_of_thesis"] = n
            flat, off = n["flat_top_thickness_ratio"], n["mean_hoop_deviation_outside_plug"]
            save(draw_stretches(path, state), args.out / "stretches.png")
            say(f"  at the pole stretch of figure 6.4, 1.25: travel {n['travel_cm']:.3f} cm, {n['force_N']:.1f} N, wall"
                f" under the plug over h0 {flat[0]:.3f} to {flat[1]:.3f}, hoop stretch off 1 by {off:.3f}")
        plugs.write(path, args.out, name)
    made = plugs.scene(RADIUS, THICKNESS, PLUG, args.fillet, fx.NeoHookean(c10=C10), "held", RUNS["held"][0],
                       fx.SimplySupported("rim"))
    path, end = plugs.push(made, TRAVELS)                        # figure 6.10
    summary["held_hinged"] = n = plugs.key_numbers(path, end, TRAVELS, PLACES, PLUG, THICKNESS)
    print_numbers("held, hinged rim", n)
    elements = tuple(n * args.refine for n in RUNS["held"][0])
    summary["driven_nodes"] = n = plugs.travel_numbers(*plugs.push(plugs.driven_nodes(
        RADIUS, THICKNESS, PLUG, fx.NeoHookean(c10=C10), elements), TRAVELS), TRAVELS, PLACES)
    print_driven(n, summary["held"])
    tool = plugs.plug(PLUG, THICKNESS, args.fillet)
    save(draw(paths, tool, limit), args.out / "williams_plug.png")
    save(draw_rims(paths["held"], path), args.out / "rims.png")
    if not args.quick:
        paths["held"].view3d(args.out / "plug_3d.png")
    summarise(args.out, {**summary, "fillet_cm": args.fillet, "versions": files.versions()})


def print_numbers(name, n) -> None:
    """Print the numbers of one run."""
    plugs.print_numbers(name, n)
    for t, f in n["force_N_at_travel_cm"].items():
        ratios = "  ".join(f"{v:.4f}" for v in n["wall_ratio_at_travel_cm"][t].values())
        say(f"  {t:>4} cm {f:9.1f} N   wall over h0 at R = 0, rp + h0/2, rp + h0, rp + 2 h0: {ratios}")


def print_driven(n, held) -> None:
    """Print the thesis' own scheme beside the rounded plug that holds the sheet."""
    forces, others = n["force_N_at_travel_cm"], held["force_N_at_travel_cm"]
    walls, other = n["wall_ratio_at_travel_cm"], held["wall_ratio_at_travel_cm"]
    say(f"driven nodes (the thesis' scheme, a sharp edge): to {n['reached_travel_cm']:.4g} cm, {n['steps']} states,"
        f" {n['newton_iterations']} Newton iterations; over the rounded plug, held (force; wall at rp + h0): "
        + ", ".join(f"{t} cm {forces[t] / others[t]:.3f}; {walls[t]['rp+h0'] / other[t]['rp+h0']:.3f}"
                    for t in forces if t in others),
        *([] if n["ended"] == "done" else [f"  ended before its target: {n['ended'][:200]} ..."]))


def draw(paths, tool, limit):
    """Return a figure of shapes, force curves and thickness: figs. 6.1 to 6.3."""
    figure, (shapes, slips, forces, thickness) = figures.figure(4, width=3.9, height=4.6)
    plugs.draw_shapes(shapes, paths["held"], plugs.states(paths["held"], (4, 8, 12, 16, 20)), tool)
    shapes.set(title="held")
    plugs.draw_shapes(slips, paths["frictionless"], plugs.states(paths["frictionless"], (2, 4, 6)), tool)
    slips.set(title="frictionless")
    for k, (name, path) in enumerate(paths.items()):
        forces.plot(path["travel"], plugs.NEWTON * path["tool_force"], color=f"C{k}", label=name.replace("_", " "))
        profile = path.profile()
        thickness.plot(profile.reference_radius, profile.wall_ratio, color=f"C{k}",
                       label=f"{name.replace('_', ' ')}, {path.last.measures['travel']:.3g} cm")
    forces.axhline(limit, color="k", linestyle=":", linewidth=1)
    forces.text(20, limit, r"$4\pi r_p c_{10} h_0$", ha="right", va="bottom")
    forces.set(xlabel="travel, cm", ylabel="force on the plug, N", title="force", ylim=(0, None))
    thickness.set(xlabel="reference radius R, cm", ylabel="wall / original", title="thickness", ylim=(0, 1.02))
    thickness.axvline(PLUG, color="0.7", linewidth=1)
    for axes in (forces, thickness):
        axes.legend(frameon=False, fontsize="small")
    return figure


def draw_stretches(path, state):
    """Return a figure of principal stretches and Lagrange strains of the top face, with slip: figs. 6.4 and 6.5."""
    figure, (stretches, strains) = figures.figure(2, width=5.0)
    R = np.linspace(0, 0.99 * RADIUS, 300)
    F = path.stress(state).at_points(np.column_stack([R, np.full_like(R, THICKNESS)])).deformation_gradient
    plane = np.linalg.svd(F[:, :2, :2], compute_uv=False)
    for k, (n, l) in enumerate(((1, plane[:, 0]), (2, plane[:, 1]), (3, F[:, 2, 2]))):
        stretches.plot(R, l, color=f"C{k}", label=rf"$\lambda_{n}$")
        strains.plot(R, (l**2 - 1) / 2, color=f"C{k}", label=rf"$E_{n} = (\lambda_{n}^2 - 1)/2$")
    stretches.set(ylabel="stretch of the top face", title=f"frictionless, {state.measures['travel']:.3g} cm")
    strains.set(ylabel="Lagrange strain of the top face")
    for axes in (stretches, strains):
        axes.axvline(PLUG, color="0.7", linewidth=1)
        axes.set(xlabel="reference radius R, cm")
        axes.legend(frameon=False)
    return figure


def draw_rims(clamped, hinged):
    """Return a figure of shapes and forces with both rims: fig. 6.10."""
    figure, (shapes, forces) = figures.figure(2, width=4.6, height=4.6)
    for color, path, label in (("C0", clamped, "clamped"), ("C3", hinged, "hinged")):
        for state in plugs.states(path, (1, 2, 4, 8)):
            shapes.plot(*path.profile(state).middle.T, color=color, linewidth=1.2)
        forces.plot(path["travel"], plugs.NEWTON * path["tool_force"], color=color, label=label)
    shapes.set(xlabel="r, cm", ylabel="z of the middle line, cm")
    forces.set(xlabel="travel, cm", ylabel="force on the plug, N")
    forces.legend(frameon=False)
    return figure


if __name__ == "__main__":
    main()
