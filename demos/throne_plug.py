"""Push a plug into thin and thick rubber sheets (Song 1993, section 6.4; tests of Throne 1989).

Mooney rubber, C10 the I1 constant; r0 = 7.62 cm. Thin: h0 = 0.0254 cm (r0/h0 = 300), plug radius 1.05 cm, with Throne's
constants (0.1213, 0.03327 MPa) and with Treloar's (0.143, 0.03327 MPa). Thick: h0 = 0.076 cm (100), plug radius 2.30 cm
(0.1731, 0.004006 MPa). "held": points that touch the plug stay on it (no slip), to 10 cm. "frictionless": to a pole
stretch of 3. Both are run with a clamped and with a hinged rim, beside the membrane under a plug with a sharp edge
(`formingx.exact.plug`, up to the travel at which it would touch the plug's side). With mu = 0.3: to 10 cm. The edge of
the plug is rounded here (--fillet); with smaller fillets the force tends to the force on the membrane. Lengths in cm,
forces in N.

The text of the thesis has no forces (figs. 6.6 to 6.10 show them). It says this: for the thick sheet its curve seems
better than Throne's own. For the thin one Throne's constants give much softer curves than measured; Treloar's compare
well. Outside the plug the strain is plane only in part, so Throne's plane-strain analysis is worse. The rim matters
little to the force.
"""

from functools import cache
from typing import NamedTuple

import plugs
from common import parser, save, say, summarise

import formingx as fx
from formingx import figures
from formingx.exact.plug import membrane_under_plug
from formingx.results import files

RADIUS = 7.62
TRAVELS = tuple(float(t) for t in range(1, 11))
QUICK_TRAVELS = (3.0, 7.0)


class Sheet(NamedTuple):
    """Sheet and plug: lengths in cm, constants in MPa."""

    thickness: float
    plug: float
    c10: float
    c01: float
    label: str


SHEETS = {"thin_throne": Sheet(0.0254, 1.05, 0.1213, 0.03327, "thin, Throne's constants"),
          "thin_treloar": Sheet(0.0254, 1.05, 0.143, 0.03327, "thin, Treloar's constants"),
          "thick": Sheet(0.076, 2.30, 0.1731, 0.004006, "thick")}
THESIS = {"thin_throne": "much softer than measured", "thin_treloar": "compares well with the test",
          "thick": "seems better than Throne's", "rims": "small differences of the force",
          "plane_strain_outside_plug": "only approximately"}
# law: (elements, the pole stretch at which the run ends, or None: 10 cm, friction)
RUNS = {"held": ((120, 1), None, "stick"), "frictionless": ((100, 1), 3.0, "none")}
QUICK = {"held": ((48, 1), None, "stick"), "frictionless": ((48, 1), 1.3, "none")}
FILLETS = (0.18, 0.06, 0.02)                                 # over the plug's radius, against the membrane
MU, FACE_STRETCH = 0.3, 25.0                                 # of friction, and of the face that elements are made for


def press(sheet, law, elements, travels, stretch=None, fillet=FILLETS[0], rim="clamped"):
    """Return the path to a pole stretch or to the last travel, and how it ended; fillet: over the plug's radius."""
    support = fx.Clamped("rim") if rim == "clamped" else fx.SimplySupported("rim")
    made = plugs.scene(RADIUS, sheet.thickness, sheet.plug, fillet * sheet.plug,
                       fx.MooneyRivlin(c10=sheet.c10, c01=sheet.c01), law, elements, support)
    return plugs.push(made, travels, stretch)


def slide(sheet, travels, fillet, refine):
    """Return the path of a sheet that slides over the edge with Coulomb friction, how it ended, and the elements."""
    made, elements = plugs.sliding(RADIUS, sheet.thickness, sheet.plug, fillet * sheet.plug,
                                   fx.MooneyRivlin(c10=sheet.c10, c01=sheet.c01), MU, FACE_STRETCH, refine,
                                   (1,) * refine, penalty=2e4, ramp=0.1, elastic_slip=0.02)
    return *plugs.push(made, travels, smallest=1e-4), elements


@cache
def membrane(sheet, law, travel):
    """Return the membrane under a plug with a sharp edge, or None where there is none."""
    if law not in RUNS:
        return None
    try:
        return membrane_under_plug(travel, radius=RADIUS, plug_radius=sheet.plug, thickness=sheet.thickness,
                                   c10=sheet.c10, c01=sheet.c01, friction=RUNS[law][2])
    except fx.InputError:
        return None


def key_numbers(sheet, law, path, end, travels) -> dict:
    """Return the numbers of `plugs.key_numbers`, and the force of the membrane."""
    rp, h0 = sheet.plug, sheet.thickness
    places = {"0": 0.0, "rp/2": rp / 2, "1.5rp": 1.5 * rp, "2rp": 2 * rp, "3rp": 3 * rp}
    n = plugs.key_numbers(path, end, travels, places, rp, h0)
    exact: dict = {}
    for t in n["force_N_at_travel_cm"]:
        found = membrane(sheet, law, float(t))
        if not found:                                        # nor is there one beyond
            break
        exact[t] = plugs.NEWTON * found.force
    return n | {"reached_plug_radii": n["reached_travel_cm"] / rp, "membrane_force_N_at_travel_cm": exact,
                "force_over_membrane_at_travel_cm": {t: n["force_N_at_travel_cm"][t] / f for t, f in exact.items()}}


def main():
    options = parser("throne_plug", __doc__)
    options.add_argument("--fillet", type=float, default=FILLETS[0], help="radius of the edge over that of the plug")
    options.add_argument("--refine", type=int, default=1, help="factor on the number of elements along the radius")
    args = options.parse_args()
    sheets = {k: s for k, s in SHEETS.items() if not args.quick or k != "thin_throne"}
    travels = QUICK_TRAVELS if args.quick else TRAVELS
    summary: dict = {"thesis": THESIS}
    paths = {}
    for name, sheet in sheets.items():
        summary[name] = {}
        for law, ((along, through), stretch, _) in (QUICK if args.quick else RUNS).items():
            elements = (along * args.refine, through)
            for rim in ("clamped", "hinged"):
                path, end = press(sheet, law, elements, travels, stretch, args.fillet, rim)
                key = law if rim == "clamped" else f"{law}_hinged"
                summary[name][key] = n = key_numbers(sheet, law, path, end, travels) | {
                    "elements": list(elements)}
                paths[name, key] = path
                print_numbers(f"{sheet.label}, {law}, {rim} rim", n)
                plugs.write(path, args.out, f"{name}_{key}")
        key = plugs.name_of(MU)
        path, end, elements = slide(sheet, travels, args.fillet, args.refine)
        summary[name][key] = n = key_numbers(sheet, key, path, end, travels) | {
            "elements": list(elements), "jumps": len(path.jumps)}
        paths[name, key] = path
        print_numbers(f"{sheet.label}, mu = {MU:g}, clamped rim", n)
        plugs.write(path, args.out, f"{name}_{key}")
    summary["force_over_membrane_at_fillet_over_rp"] = sharpen(args.refine)
    summary["comparison"] = compare(summary)
    save(draw_forces(paths, summary), args.out / "forces.png")
    save(draw_shapes(paths, args.fillet), args.out / "profiles.png")
    if not args.quick:
        paths["thin_treloar", "held"].view3d(args.out / "throne_plug_3d.png")
    summarise(args.out, {**summary, "fillet_over_rp": args.fillet, "versions": files.versions()})


def sharpen(refine) -> dict:
    """Return the force on the thin sheet, held, over that of the membrane at about three plug radii, by fillet."""
    sheet, travel = SHEETS["thin_treloar"], 3.0
    found = {}
    for fillet in FILLETS:
        path, _ = press(sheet, "held", (120 * refine, 1), (travel,), fillet=fillet)
        found[f"{fillet:g}"] = plugs.force(path.last) / (plugs.NEWTON * membrane(sheet, "held", travel).force)
    say(f"{sheet.label}, held, {travel:g} cm: force over that of the membrane under a sharp edge, fillet/rp = "
        + ", ".join(f"{k}: {v:.4f}" for k, v in found.items()))
    return found


def compare(found) -> dict:
    """Return the findings of the thesis as numbers: ratios of forces at the travels that both runs reached."""
    def ratio(a, b):
        a, b = (n["force_N_at_travel_cm"] for n in (a, b))
        return {t: a[t] / b[t] for t in a if t in b}
    compared = {"hinged_over_clamped": {f"{name}_{law}": ratio(found[name][f"{law}_hinged"], found[name][law])
                                        for name in found if name in SHEETS for law in RUNS}}
    most = max(abs(v - 1) for ratios in compared["hinged_over_clamped"].values() for v in ratios.values())
    compared["largest_difference_of_rims"] = most
    say(f"a hinged rim changes the force by {100 * most:.2g} % at the most (thesis: {THESIS['rims']})")
    if "thin_throne" in found:
        compared["treloar_over_throne"] = both = {law: ratio(found["thin_treloar"][law], found["thin_throne"][law])
                                                  for law in RUNS}
        values = [v for ratios in both.values() for v in ratios.values()]
        say(f"thin sheet: with Treloar's constants the force is {min(values):.3f} to {max(values):.3f} of that with"
            f" Throne's (between 1 and {SHEETS['thin_treloar'].c10 / SHEETS['thin_throne'].c10:.3f} it must be: c01 is"
            f" the same). The thesis: with Throne's {THESIS['thin_throne']}, with Treloar's it"
            f" {THESIS['thin_treloar']}")
    return compared


def print_numbers(name, n) -> None:
    """Print the numbers of one run."""
    plugs.print_numbers(name, n)
    for t, f in n["force_N_at_travel_cm"].items():
        exact = n["membrane_force_N_at_travel_cm"].get(t)
        say(f"  {t:>4} cm {f:9.3f} N" + (f"   membrane {exact:9.3f} N" if exact else ""))


def draw_forces(paths, summary):
    """Return a figure of forces on the thick and the thin sheet, with those of the membrane: figs. 6.8 and 6.9."""
    figure, both = figures.figure(2, width=5.0, height=4.4)
    for axes, title, names in zip(both, ("thick sheet", "thin sheet"), (["thick"], ["thin_treloar", "thin_throne"])):
        laws = (*RUNS, plugs.name_of(MU))
        for k, (law, name) in enumerate((law, name) for law in laws for name in names if name in summary):
            path, constants = paths[name, law], SHEETS[name].label.partition(", ")[2]
            axes.plot(path["travel"], plugs.NEWTON * path["tool_force"], color=f"C{k}",
                      label=(law if law in RUNS else f"$\\mu$ = {MU:g}") + (f", {constants}" if constants else ""))
            exact = summary[name][law]["membrane_force_N_at_travel_cm"]
            axes.plot([float(t) for t in exact], list(exact.values()), "o", color=f"C{k}", fillstyle="none")
        axes.plot([], [], "o", color="0.3", fillstyle="none", label="membrane, sharp edge")
        axes.set(xlabel="travel, cm", ylabel="force on the plug, N", title=title, xlim=(0, None), ylim=(0, None))
        axes.legend(frameon=False, fontsize="small")
    return figure


def draw_shapes(paths, fillet):
    """Return a figure of profiles and thickness of the thin and the thick sheet: fig. 6.6."""
    figure, (thin, thick, walls) = figures.figure(3, width=4.4, height=4.8)
    for axes, name in ((thin, "thin_treloar"), (thick, "thick")):
        sheet, path = SHEETS[name], paths[name, "held"]
        plugs.draw_shapes(axes, path, plugs.states(path, (2, 4, 6, 8, 10)),
                          plugs.plug(sheet.plug, sheet.thickness, fillet * sheet.plug))
        axes.set(title=f"{name.split('_')[0]}, held")
        for law, style in (("held", "-"), ("frictionless", "--")):
            profile = paths[name, law].profile()
            walls.plot(profile.reference_radius, profile.wall_ratio, style, color="C0" if axes is thin else "C3",
                       label=f"{name.split('_')[0]}, {law}, {paths[name, law].last.measures['travel']:.3g} cm")
    walls.set(xlabel="reference radius R, cm", ylabel="wall / original", title="thickness", ylim=(0, 1.02))
    walls.legend(frameon=False, fontsize="small")
    return figure


if __name__ == "__main__":
    main()
