"""A sheet under a plug, its friction, forces and shapes, for the demos of plug-assist."""

import numpy as np
from common import COMM, say
from moulding import cost

import formingx as fx
from formingx.results import files
from formingx.results.show import plots

NEWTON = 100.0                                               # N in one MPa cm2
LAWS = {
    "held": ("stick", False),                                # no slip, as in the thesis; never separates
    "stick": ("stick", True),                                # a rough plug from which the sheet may separate
    "frictionless": ("none", True),
}
"""{name: (friction, separates)}; a number is Coulomb's coefficient."""
GROWTH, AT_RIM = 0.09, 0.5
"""Of the elements of `sliding`: size over the radius, and size at the rim over that of the largest."""


def plug(radius, thickness, fillet, height=60.0):
    """Return a round plug with a flat end and a rounded edge, which stands on the sheet."""
    return fx.tools.male(radius=radius, height=height, base=-height, fillet=fillet).mirrored().moved(z=thickness)


def sheet(radius, thickness, plug_radius, law, elements, near=None, comm=COMM):
    """Return the mesh of a sheet, with small elements around the edge, or wherever the sheet slides over it.

    near: {radius: size of the elements there over that of the largest}, for other places of the small elements.
    """
    near = near or ({1.1 * plug_radius: 0.2} if law in ("held", "stick") else {0.65 * plug_radius: 0.2})
    return fx.mesh.disc(radius=radius, thickness=thickness, elements=elements, concentrate=near, comm=comm)


def name_of(law) -> str:
    """Return the key of a law in the summary."""
    return law if isinstance(law, str) else f"coulomb_{law:g}"


def scene(radius, thickness, plug_radius, fillet, material, law, elements, support=None, near=None, model=None,
          comm=COMM, **options):
    """Return the scene of a sheet fixed at its rim under a plug that moves down.

    law: one of LAWS, or a coefficient of friction.
    """
    friction, separates = LAWS.get(law, (law, True))
    mesh = sheet(radius, thickness, plug_radius, law, elements, near, comm)
    return fx.Scene(mesh=mesh, materials=material, supports=[fx.Symmetry("axis"), support or fx.Clamped("rim")],
                    model=model,
                    contacts=[fx.Contact("top", plug(plug_radius, thickness, fillet), friction, separates=separates,
                                         direction=(0, -1), **options)])


def sliding(radius, thickness, plug_radius, fillet, material, mu, face_stretch, refine=1, through=(1,), **options):
    """Return the scene of a sheet that slides over the edge with Coulomb friction, and its numbers of elements.

    The size of the elements is in proportion to the radius, so that the same number lies around the edge at any travel.
    At the axis it is a third of the size that suits the edge when the face is stretched by face_stretch. From half way
    to the rim it falls to AT_RIM of the largest. The elements are slim, so pressures are continuous.

    Args:
        refine: divisor of the element size along the sheet.
        through: relative sizes of the elements through the sheet, the last one at the face that touches.
    """
    smallest = 2 * plug_radius / radius / face_stretch / 3
    along = (np.log(1 / smallest) + np.log(1 / AT_RIM) / (1 - AT_RIM)) / GROWTH
    elements = int(np.ceil(refine * along))
    made = scene(radius, thickness, plug_radius, fillet, material, mu, (elements, through),
                 near={0.0: smallest, radius: AT_RIM}, model=fx.MixedPressure(space="P1"), points=4,
                 nodes_per_step=16, **options)
    return made, (elements, len(through))


def push(made, travels, pole_stretch=None, smallest=1e-6, **options):
    """Return the path to the last travel, or to a pole stretch, through all travels, and how it ended.

    smallest: step length below which a run gives up.
    """
    targets = [fx.travel(t) for t in travels]
    until = targets.pop() if pole_stretch is None else fx.pole_stretch(pole_stretch)
    try:
        return fx.trace(made, until=until, intermediate=targets, step=fx.StepControl(target=6, smallest=smallest),
                        **options), "done"
    except fx.ConvergenceError as error:
        return error.path, str(error)


def driven_nodes(radius, thickness, plug_radius, material, elements):
    """Return the scene of the thesis' scheme (6.1 to 6.4): nodes within the plug's radius move with it.

    These nodes do not move sideways; the face is free. They belong to the lower face and move up: the same scene upside
    down.
    """
    mesh = fx.mesh.disc(radius=radius, thickness=thickness, elements=elements, concentrate={plug_radius: 0.2})
    return fx.Scene(mesh=mesh.with_part("plug", "bottom", (0, plug_radius)), materials=material, supports=[
        fx.Symmetry("axis"), fx.Clamped("rim"), fx.Symmetry("plug", normal="r"),
        fx.PrescribedDisplacement("plug", "z")])


def force(state) -> float:
    """Return the force on the plug (N), of a tool or of driven nodes."""
    found = state.measures
    return NEWTON * (found["tool_force"] if "tool_force" in found else -found["support_force"])


def force_limit(plug_radius, thickness, c10) -> float:
    """Return the largest force (N) of a frictionless plug on a neo-Hookean membrane: 2 pi rp T, T = 2 c10 h0.

    T = 2 c10 h0 (1 - l^-6) is the tension, per current length, of a membrane stretched l in both directions, as under
    the plug. Around an edge without friction it stays the same, and the wall can at most hang straight down.
    """
    return NEWTON * 4 * np.pi * plug_radius * c10 * thickness


def travel_numbers(path, end, travels, places) -> dict:
    """Return forces and thickness of one path; a travel that was not met has no entry.

    places: {name: reference radius}.
    """
    met = {f"{t:g}": path.target_state(fx.travel(t)) for t in travels}
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
    """Return the numbers of the summary of the path of a plug: `travel_numbers`, and numbers of its last state."""
    return {
        **travel_numbers(path, end, travels, places),
        **shape_numbers(path, path.last, plug_radius, thickness),
        "largest_penetration_over_h0": float(path["penetration"].max()) / thickness,
    }


def shape_numbers(path, state, plug_radius, thickness) -> dict:
    """Return stretches at the pole, the smallest and largest wall under the plug, and the hoop stretch outside it.

    Points under the plug are those within its radius in the reference configuration.
    """
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
    """Return the principal stretches of the top face at the pole: in the plane and through the thickness."""
    F = path.stress(state).at_points([[0.0, thickness]]).deformation_gradient[0]
    return {"meridional": float(F[0, 0]), "hoop": float(F[2, 2]), "thickness": float(F[1, 1])}


def print_numbers(name, n) -> None:
    """Print how far a run went, and its cost."""
    say(f"{name}: to {n['reached_travel_cm']:.4g} cm, {n['steps']} states, {n['newton_iterations']} Newton iterations,"
        f" {n['cutbacks']} cut back, {n['solve_seconds']:.1f} s; hoop stretch outside the plug off 1 by"
        f" {n['mean_hoop_deviation_outside_plug']:.3f} in the mean; wall under the plug over h0"
        f" {n['flat_top_thickness_ratio'][0]:.3f} to {n['flat_top_thickness_ratio'][1]:.3f}",
        *([] if n["ended"] == "done" else [f"  ended before its target: {n['ended'][:200]} ..."]))


def states(path, travels) -> list:
    """Return the states of the travels that were met, and the last one."""
    found = [path.target_state(fx.travel(float(t))) for t in travels]
    return [*(s for s in found if s is not None and s is not path.last), path.last]


def write(path, out, name) -> None:
    """Write a path and its last profile to files."""
    path.to_csv(out / f"{name}.csv")
    files.write_profile(path.profile(), out / f"{name}_profile.csv", COMM)


def draw_shapes(axes, path, states, tool, **style) -> None:
    """Draw profiles of some states, and the plug in the last of them."""
    for k, state in enumerate(states):
        plots.outline(path.profile(state), axes, color=style.get("color", f"C{k}"))
    low = states[-1].measures["travel"]
    axes.plot(*(tool.outline() - [0, low]).T, "k", linewidth=1.2)
    x = np.vstack([path.profile(s).top for s in states])
    size = x[:, 0].max()
    axes.set(xlabel="r, cm", ylabel="z, cm", xlim=(0, 1.05 * size), ylim=(x[:, 1].min() - 0.15 * size,
                                                                          x[:, 1].max() + 0.1 * size))
    axes.set_aspect("equal")
