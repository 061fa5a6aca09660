"""What the demos of forming into and over moulds share: key numbers and pictures."""

import numpy as np
from common import save

import formingx as fx
from formingx.results import plots


def name_of(friction) -> str:
    """A friction law as a key of the summary."""
    return {"none": "frictionless"}.get(friction, friction if isinstance(friction, str) else f"coulomb_{friction:g}")


def largest_gap(profile, corner: np.ndarray) -> float:
    """Largest distance of points of a mould, shape (n, 2), to the facing side of a sheet."""
    a, b = profile.top[:-1], profile.top[1:]
    t = np.clip(np.einsum("cij,ij->ci", corner[:, None] - a, b - a) / np.einsum("ij,ij->i", b - a, b - a), 0, 1)
    return float(np.hypot(*np.moveaxis(corner[:, None] - a - t[..., None] * (b - a), -1, 0)).min(1).max())


def filled_at(path, corner: np.ndarray, gap: float) -> float | None:
    """Pressure at which the gap in a corner falls below `gap`, linear between states; None if it does not."""
    pressures, gaps = path["pressure"], [largest_gap(path.profile(s), corner) for s in path.states]
    for p, q, a, b in zip(pressures, pressures[1:], gaps, gaps[1:]):
        if b < gap <= a:
            return float(p + (q - p) * (a - gap) / (a - b))
    return None


def first_touch(path, start: int = 0):
    """The first state at which more than the rim touches."""
    rim = path.states[0].measures["contact_length"]
    return next(s for s in path.states[start:] if s.measures["contact_length"] > rim + 1e-12)


def at_pressures(path, pressures, unit: str) -> dict:
    """Thickness at given pressures, each of them hit exactly."""
    profiles = {f"{p:g}": path.profile(path.met(fx.pressure(p))) for p in pressures}
    thinnest = {p: int(np.argmin(profile.thickness_ratio)) for p, profile in profiles.items()}
    return {
        f"pole_thickness_ratio_at_{unit}": {p: profile.thickness_ratio[0] for p, profile in profiles.items()},
        f"min_thickness_ratio_at_{unit}": {p: profile.thickness_ratio[thinnest[p]] for p, profile in profiles.items()},
        f"min_thickness_at_R_cm_at_{unit}": {
            p: profile.reference_radius[thinnest[p]] for p, profile in profiles.items()},
    }


def cost(path) -> dict:
    """What a run took."""
    counts = path.counts
    return {"steps": counts.steps, "newton_iterations": counts.iterations, "cutbacks": counts.failures,
            "solve_seconds": counts.seconds}


def draw_forming(path, states, tool, out, name: str, unit: str = "psi", side: str = "top") -> None:
    """Profiles in the mould, thickness against reference radius, contact pressure: one picture."""
    figure, (left, middle, right) = plots.figure(3, width=4.6)
    outline = tool.outline()
    left.plot(*outline.T, "k", linewidth=1.5)
    size = path.profile(states[0]).reference_radius[-1]
    for k, state in enumerate(states):
        profile, p, color = path.profile(state), state.measures["pressure"], f"C{k}"
        plots.outline(profile, left, color=color)
        middle.plot(profile.reference_radius, profile.thickness_ratio, color=color, label=f"{p:.3g} {unit}")
        points, pressure = contact_pressure(path, state, profile, side)
        right.plot(points, pressure, color=color)
    span = np.vstack([getattr(path.profile(s), face) for s in states for face in ("bottom", "top")])
    left.set(xlabel="r, cm", ylabel="z, cm", title=name.replace("_", " "), xlim=(0, 1.15 * size),
             ylim=(span[:, 1].min() - 0.05 * size,
                   max(span[:, 1].max(), min(outline[:, 1].max(), 2 * size)) + 0.1 * size))
    middle.set(xlabel="reference radius R, cm", ylabel="thickness / original", title="thickness", ylim=(0, 1.02))
    right.set(xlabel="reference radius R, cm", ylabel=f"contact pressure, {unit}", title="contact pressure",
              ylim=(0, 1.4 * states[-1].measures["pressure"]))
    middle.legend(frameon=False)
    save(figure, out / f"{name}.png")


def contact_pressure(path, state, profile, side: str = "top") -> tuple[np.ndarray, np.ndarray]:
    """(R, contact pressure per current area) on the facing side at a state."""
    contact = path.problem.contacts[0]
    points, traction = contact.traction(state.x, state.control)
    facing = np.column_stack([np.interp(points[:, 0], profile.reference_radius, c) for c in getattr(profile, side).T])
    along = np.hypot(*np.gradient(facing, points[:, 0], axis=0).T)
    axisymmetric = path.problem.scene.kinematics.dimension_of_volume == 3
    hoop = np.divide(facing[:, 0], points[:, 0], out=along.copy(), where=points[:, 0] > 0) if axisymmetric else 1.0
    off_axis = slice(int(points[0, 0] < 1e-9 * points[-1, 0]), None)          # the node on the axis carries no area
    return points[off_axis, 0], (traction[:, 0] / (along * hoop))[off_axis]
