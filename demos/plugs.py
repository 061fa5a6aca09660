"""A sheet under a plug, its friction, forces and shapes, for the demos of plug-assist."""

import numpy as np
from common import COMM, say
from moulding import cost

import formingx as fx
from formingx.results import files
from formingx.results.show import plots

NEWTON = 100.0                                               # N in one MPa cm2
LAWS = {
    "held": ("stick", False),                                # no slip, as the thesis: never lets go
    "stick": ("stick", True),                                # a rough plug that the sheet may lift off
    "frictionless": ("none", True),
}
"""{name: (friction, separates)}; a number is Coulomb's coefficient."""
GROWTH, AT_RIM = 0.09, 0.5
"""Of the elements of `sliding`: size over the radius, and size at the rim over that of the largest."""


def plug(radius, thickness, fillet, height=60.0):
    """A round flat-ended plug with a rounded edge, that stands on a sheet."""
    return fx.tools.male(radius=radius, height=height, base=-height, fillet=fillet).mirrored().moved(z=thickness)


def sheet(radius, thickness, plug_radius, law, elements, near=None, comm=COMM):
    """Small elements where the law asks for them: around the edge, or wherever the sheet slides over it.

    near: {radius: size of the elements there over that of the largest}, if they are to be elsewhere.
    """
    near = near or ({1.1 * plug_radius: 0.2} if law in ("held", "stick") else {0.65 * plug_radius: 0.2})
    return fx.mesh.disc(radius=radius, thickness=thickness, elements=elements, concentrate=near, comm=comm)


def name_of(law) -> str:
    """A law as a key of the summary."""
    return law if isinstance(law, str) else f"coulomb_{law:g}"


def scene(radius, thickness, plug_radius, fillet, material, law, elements, support=None, near=None, model=None,
          comm=COMM, **options):
    """A sheet held at its rim under a plug that moves down. law: of LAWS, or a coefficient of friction."""
    friction, separates = LAWS.get(law, (law, True))
    mesh = sheet(radius, thickness, plug_radius, law, elements, near, comm)
    return fx.Scene(mesh=mesh, materials=material, supports=[fx.Symmetry("axis"), support or fx.Clamped("rim")],
                    model=model,
                    contacts=[fx.Contact("top", plug(plug_radius, thickness, fillet), friction, separates=separates,
                                         direction=(0, -1), **options)])


def sliding(radius, thickness, plug_radius, fillet, material, mu, face_stretch, refine=1, through=(1,), **options):
    """(scene, elements) of a sheet that slides over the edge with Coulomb friction; options: of `scene`.

    refine: divides the elements along the sheet; through: relative sizes of those through it, the last one at the face
    that touches.

    Elements in proportion to the radius: whatever comes to the edge has as many around it. At the axis they are a third
    of what the edge holds when the face is stretched by face_stretch; half way to the rim they begin to fall to AT_RIM
    of the largest. They are slim, so pressures are continuous.
    """
    smallest = 2 * plug_radius / radius / face_stretch / 3
    along = (np.log(1 / smallest) + np.log(1 / AT_RIM) / (1 - AT_RIM)) / GROWTH
    elements = int(np.ceil(refine * along))
    made = scene(radius, thickness, plug_radius, fillet, material, mu, (elements, through),
                 near={0.0: smallest, radius: AT_RIM}, model=fx.MixedPressure(space="P1"), points=4,
                 nodes_per_step=16, **options)
    return made, (elements, len(through))


def push(made, travels, pole_stretch=None, smallest=1e-6, **options):
    """(path, how it ended): to the last travel, or to a pole stretch, through the (other) travels.

    smallest: length of a step below which a run gives up.
    """
    targets = [fx.travel(t) for t in travels]
    until = targets.pop() if pole_stretch is None else fx.pole_stretch(pole_stretch)
    try:
        return fx.trace(made, until=until, intermediate=targets, step=fx.StepControl(target=6, smallest=smallest),
                        **options), "done"
    except fx.ConvergenceError as error:
        return error.path, str(error)


def driven_nodes(radius, thickness, plug_radius, material, elements):
    """The scheme of the thesis (6.1 to 6.4): nodes within the plug's radius go with it, not sideways; the face is free.

    They are of the lower face and go up: the same upside down.
    """
    mesh = fx.mesh.disc(radius=radius, thickness=thickness, elements=elements, concentrate={plug_radius: 0.2})
    return fx.Scene(mesh=mesh.with_part("plug", "bottom", (0, plug_radius)), materials=material, supports=[
        fx.Symmetry("axis"), fx.Clamped("rim"), fx.Symmetry("plug", normal="r"),
        fx.PrescribedDisplacement("plug", "z")])


def force(state) -> float:
    """Force on the plug, N, whether it is a tool or driven nodes."""
    found = state.measures
    return NEWTON * (found["tool_force"] if "tool_force" in found else -found["support_force"])


def force_limit(plug_radius, thickness, c10) -> float:
    """The force that a frictionless plug on a neo-Hookean membrane cannot pass, N: 2 pi rp T, T = 2 c10 h0.

    T = 2 c10 h0 (1 - l^-6) is the tension, per current length, of a membrane stretched l both ways, as it is under the
    plug; around an edge without friction it stays the same, and the wall can do no more than hang straight down.
    """
    return NEWTON * 4 * np.pi * plug_radius * c10 * thickness


def course(path, end, travels, places) -> dict:
    """Forces and thickness of one path. places: {name: reference radius}; travels not met have no entry."""
    met = {f"{t:g}": path.met(fx.travel(t)) for t in travels}
    met = {key: state for key, state in met.items() if state is not None}
    shapes = {key: path.profile(state) for key, state in met.items()}
    return {
        "force_N_at_travel_cm": {key: force(state) for key, state in met.items()},
        "thickness_ratio_at_travel_cm": {
            key: {name: shape.thickness_ratio_at(R) for name, R in places.items()} for key, shape in shapes.items()},
        "wall_ratio_at_travel_cm": {
            key: {name: float(np.interp(R, shape.reference_radius, shape.wall_ratio))
                  for name, R in places.items()} for key, shape in shapes.items()},
        "reached_travel_cm": float(path["travel"].max()),
        "largest_force_N": max(map(force, path.states)),
        "ended": end,
        **cost(path),
    }


def key_numbers(path, end, travels, places, plug_radius, thickness) -> dict:
    """What the summary holds of the path of a plug: `course`, and what its last state is like."""
    return {
        **course(path, end, travels, places),
        **shape_numbers(path, path.last, plug_radius, thickness),
        "largest_penetration_over_h0": float(path["penetration"].max()) / thickness,
    }


def shape_numbers(path, state, plug_radius, thickness) -> dict:
    """Stretches at the pole, least and largest wall of what lay under the plug at rest, hoop stretch outside it."""
    shape = path.profile(state)
    flat = shape.wall_ratio[shape.reference_radius <= plug_radius]
    outside = shape.reference_top[:, 0] > plug_radius
    hoop = shape.top[outside, 0] / shape.reference_top[outside, 0]
    return {
        "stretches_at_pole": pole_stretches(path, state, thickness),
        "flat_top_thickness_ratio": [float(flat.min()), float(flat.max())],
        "mean_hoop_deviation_outside_plug": float(np.abs(hoop - 1).mean()),
    }


def pole_stretches(path, state, thickness) -> dict:
    """Principal stretches of the top face at the pole: in the plane and through the thickness."""
    F = path.stress(state).at([[0.0, thickness]]).deformation_gradient[0]
    return {"meridional": float(F[0, 0]), "hoop": float(F[2, 2]), "thickness": float(F[1, 1])}


def tell(name, n) -> None:
    """How far a run went, and what it cost."""
    say(f"{name}: to {n['reached_travel_cm']:.4g} cm, {n['steps']} states, {n['newton_iterations']} Newton iterations,"
        f" {n['cutbacks']} cut back, {n['solve_seconds']:.1f} s; hoop stretch outside the plug off 1 by"
        f" {n['mean_hoop_deviation_outside_plug']:.3f} in the mean; wall under the plug over h0"
        f" {n['flat_top_thickness_ratio'][0]:.3f} to {n['flat_top_thickness_ratio'][1]:.3f}",
        *([] if n["ended"] == "done" else [f"  ended before its target: {n['ended'][:200]} ..."]))


def states(path, travels) -> list:
    """Those that were met, and the last one."""
    found = [path.met(fx.travel(float(t))) for t in travels]
    return [*(s for s in found if s is not None and s is not path.last), path.last]


def write(path, out, name) -> None:
    """A path and its last profile as files."""
    path.to_csv(out / f"{name}.csv")
    files.write_profile(path.profile(), out / f"{name}_profile.csv", COMM)


def draw_shapes(axes, path, states, tool, **style) -> None:
    """Profiles of some states and the plug in the last of them."""
    for k, state in enumerate(states):
        plots.outline(path.profile(state), axes, color=style.get("color", f"C{k}"))
    low = states[-1].measures["travel"]
    axes.plot(*(tool.outline() - [0, low]).T, "k", linewidth=1.2)
    x = np.vstack([path.profile(s).top for s in states])
    size = x[:, 0].max()
    axes.set(xlabel="r, cm", ylabel="z, cm", xlim=(0, 1.05 * size), ylim=(x[:, 1].min() - 0.15 * size,
                                                                          x[:, 1].max() + 0.1 * size))
    axes.set_aspect("equal")
