"""A block between two plates, its force and its material lines, for the demos of compression.

Thesis chapter 7: radius R0 = 1.32 cm, half height H = 1.25 cm; a quarter of the section is meshed, the middle at Z = 0.
Forces are those of the whole block on one plate. Chapter 7 takes C01 as the I1 constant: c10 = C01 and c01 = C10 here.
"""

import numpy as np
from common import save

import formingx as fx
from formingx import figures
from formingx.forms.probes import probe

RADIUS, HALF_HEIGHT = 1.32, 1.25                             # cm
NEWTON = 100.0                                               # N in one MPa cm2


def block(materials, friction, elements, *, roll_over=False, layers=HALF_HEIGHT, radius=RADIUS, kinematics=None,
          model=None, **options):
    """Return the scene of a block under a plate that moves down.

    Args:
        materials: material, or {layer: material}.
        friction: "stick", "none" or a coefficient.
        elements: numbers of elements along the radius and the height.
        roll_over: True if the side may touch the plate.
    """
    mesh = fx.mesh.disc(radius=radius, thickness=layers, elements=elements)
    height = sum(layers.values()) if isinstance(layers, dict) else layers
    faces = ("top", "rim") if roll_over else ("top",)
    return fx.Scene(mesh=mesh, materials=materials, kinematics=kinematics, model=model,
                    supports=[fx.Symmetry("axis"), fx.Symmetry("bottom", normal="z")],
                    contacts=[fx.Contact(face, fx.tools.plane(height), friction, direction=(0, -1), **options)
                              for face in faces])


def press(scene, travels, **options):
    """Return the path through all travels of the plate, as far as the elements allow, and how it ended."""
    targets = [fx.travel(t) for t in travels]
    options["step"] = fx.StepControl(target=8)
    try:
        return fx.trace(scene, until=targets[-1], intermediate=targets[:-1], **options), "done"
    except fx.ConvergenceError as error:
        return error.path, str(error)


def force(state) -> float:
    """Return the force on one plate (N)."""
    return NEWTON * state.measures["tool_force"]


def forces(path, travels, keys) -> dict:
    """Return {key: force in N} at the travels that were met."""
    met = {key: path.target_state(fx.travel(t)) for key, t in zip(keys, travels, strict=True)}
    return {key: force(state) for key, state in met.items() if state is not None}


def positions(path, state, points) -> np.ndarray:
    """Return the positions of material points (R, Z) in a state; both shape (n, 2)."""
    x = path.problem.x.duplicate()
    x.setArray(state.x)
    points = np.asarray(points, dtype=float)
    moved = points + probe(path.problem, points).displacement(x)
    x.destroy()
    return moved


def draw_lines(path, state, axes, elements, height=HALF_HEIGHT, radius=RADIUS, **style) -> None:
    """Draw the edges of the elements in a state: material lines."""
    fine_r, fine_z = np.linspace(0, radius, 61), np.linspace(0, height, 61)
    for Z in np.linspace(0, height, elements[1] + 1):
        axes.plot(*positions(path, state, np.column_stack([fine_r, 0 * fine_r + Z])).T, **style)
    for R in np.linspace(0, radius, elements[0] + 1):
        axes.plot(*positions(path, state, np.column_stack([0 * fine_z + R, fine_z])).T, **style)
    axes.set_aspect("equal")


def draw_grids(path, states, labels, elements, file, **size) -> None:
    """Draw deformed grids below one another, on one scale."""
    side = [(RADIUS, Z) for Z in np.linspace(0, HALF_HEIGHT, 41)]
    moved = [positions(path, s, [*side, (0.0, HALF_HEIGHT)]) for s in states]
    wide, heights = max(m[:, 0].max() for m in moved) * 1.05, [m[:, 1].max() * 1.15 for m in moved]
    figure, _ = figures.figure(1, width=5.2, height=5.2 / wide * sum(heights) + 0.45 * len(states))
    figure.clear()
    axes = figure.subplots(len(states), 1, sharex=True, squeeze=False, height_ratios=heights)[:, 0]
    for a, state, label, high in zip(axes, states, labels, heights, strict=True):
        draw_lines(path, state, a, elements, color="tab:blue", linewidth=0.7, **size)
        a.set(title=label, ylabel="z, cm", xlim=(0, wide), ylim=(0, high))
    axes[-1].set_xlabel("r, cm")
    save(figure, file)
