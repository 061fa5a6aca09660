"""Find the thickness, or the stiffness, over the width of a sheet from which an even trough is blown.

Plane strain: a neo-Hookean sheet of half width 1 and mean thickness 0.01 is hinged at its rims. It is blown into a
trough with vertical walls, 1.5 deep, with sharp corners, and sticks to it. The run ends when the free arc in the corner
has a radius below 0.05. The goal is an even wall h: by the reference thickness h0(R), or by the constant C(R) = c10
with a uniform h0. The logarithm of the profile is a table over the sheet. The 3 % at the rim, where the hinge shears
the wall, do not count.

Material points are named by their places in the trough. "rim", "half_wall" and "mouth" are 0, 0.25 and 0.5 below the
rim on the wall; the ends of the free arc are at "mouth" when it first touches the floor. "corner_0.5" and "corner_0.1"
are at these distances from the corner, on the wall and on the floor.
"""

import numpy as np
from common import parser, save, say, summarise

import formingx as fx
from formingx.figures import figure
from formingx.results import files

DEPTH, SHEET, C, PRESSURE = 1.5, 0.01, 0.5, 0.9
WALL, COUNTED = SHEET / (1 + DEPTH), 0.97                    # of the half width
PLACES = {"rim": 0.0, "half_wall": (DEPTH - 1) / 2, "mouth": DEPTH - 1, "corner_0.5": DEPTH - 0.5,
          "corner_0.1": DEPTH - 0.1}                          # how deep on the wall they end


def trough(profile, of, elements):
    """Return the scene and its target; thickness ("h0") or constant ("C") varies with a profile over the width."""
    thickness = (lambda R: SHEET * np.exp(profile(R))) if of == "h0" else SHEET
    c10 = (lambda R, Z: C * np.exp(profile(R) - profile(0.5))) if of == "C" else C
    mesh = fx.mesh.disc(radius=1.0, thickness=thickness, elements=elements)
    mould = fx.tools.cup(radius=1.0 + WALL / 2, depth=DEPTH + WALL / 2)             # the middle of the wall: 1, 1.5
    scene = fx.Scene(mesh=mesh, materials=fx.NeoHookean(c10=c10), kinematics=fx.PlaneStrain(),
                     supports=[fx.Symmetry("axis"), fx.SimplySupported("rim")], loads=[fx.Pressure("bottom")],
                     contacts=[fx.Contact("top", mould, "stick")])
    return scene, fx.pressure(PRESSURE)


def search(of, elements, knots, runs):
    """Return the `DesignResult` for "h0" or "C"."""
    design = fx.Design(lambda profile: trough(profile, of, elements),
                       {"profile": fx.spline(knots, start=0.0, low=-6.0, high=6.0)}, step=fx.StepControl(target=8))
    return design.fit(even=True, volume="kept" if of == "h0" else None, within=(0.0, COUNTED), max_runs=runs,
                      min_change=2e-3)


def reference_positions(result):
    """Return {name: reference R} of the points on the wall, and of those beside the corner on the floor."""
    profile = result.best.profile
    R, (r, z) = profile.reference_radius, profile.middle.T
    on_wall = r > z / z.max()                                # beyond the diagonal through the corner
    found = {name: float(np.interp(depth, z[on_wall][::-1], R[on_wall][::-1])) for name, depth in PLACES.items()}
    floor = {name: float(np.interp(1 - away, r[~on_wall], R[~on_wall]))
             for name, away in (("corner_0.5", 0.5), ("corner_0.1", 0.1))}
    return found, floor


def arc_radius(result):
    """Return the radius of the free arc in the corner.

    An arc that touches wall and floor is at a distance of (sqrt(2) - 1) of its radius from the corner.
    """
    middle = result.best.profile.middle
    corner = np.array([1.0, DEPTH])
    return float(np.hypot(*(middle - corner).T).min() / (np.sqrt(2) - 1))


def main():
    options = parser("even_trough", __doc__, elements=60)
    options.add_argument("--knots", type=int, default=21, help="number of knots of the table")
    options.add_argument("--runs", type=int, default=6, help="largest number of runs of each search")
    args = options.parse_args()
    elements, knots, runs = ((16, 1), 5, 2) if args.quick else ((args.elements, 1), args.knots, args.runs)
    summary = {}
    drawing, axes = figure(2)
    for k, of in enumerate(("h0", "C")):
        result = search(of, elements, knots, runs)
        wall, floor = reference_positions(result)
        profile, mean = result.values["profile"], result.best.wall[result.inside].mean()
        if of == "h0":
            summary["h0_over_h"], summary["h0_over_h_on_the_floor"] = (
                {name: float(SHEET * np.exp(profile(R)) / mean) for name, R in there.items()}
                for there in (wall, floor))
        else:
            summary["C_over_C_rim"] = {name: float(np.exp(profile(wall[name]) - profile(wall["rim"])))
                                       for name in ("half_wall", "mouth")}
        summary[of] = {"cv_before": result.cv[0], "cv_after": result.cv[1], "paths": result.paths,
                       "free_arc_radius": arc_radius(result), "mean_wall": mean}
        say(f"{of}: {result.paths} runs, cv {result.cv[0]:.4f}, after {result.cv[1]:.4f}; radius of the free arc"
            f" {arc_radius(result):.4f}", str(summary["h0_over_h" if of == "h0" else "C_over_C_rim"]))
        R = np.linspace(0, 1, 201)
        axes[k].plot(R, np.exp(profile(R) - (of == "C") * profile(1.0)) * (SHEET / mean if of == "h0" else 1), "C0")
        for name, at in wall.items():
            axes[k].axvline(at, color="0.8", linewidth=0.8)
            axes[k].text(at, 0.02, f" {name.replace('_', ' ')}", rotation=90, fontsize=9, ha="right",
                         transform=axes[k].get_xaxis_transform())
        axes[k].set(xlabel="reference position R / half width", ylim=(0, None),
                    ylabel="thickness h$_0$ / even wall h" if of == "h0" else "constant C / C at the rim")
    save(drawing, args.out / "even_trough.png")
    summarise(args.out, {**summary, "elements_along": elements[0], "versions": files.versions()})


if __name__ == "__main__":
    main()
