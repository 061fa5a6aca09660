"""Key numbers and pictures that the demos of forming with moulds share."""

import numpy as np
from common import COMM, save, say

import formingx as fx
from formingx import figures
from formingx.contact import resultants
from formingx.results import files
from formingx.results.evaluate.profile import distance_to_line
from formingx.results.show import plots


def name_of(friction) -> str:
    """Return the key of a friction law in the summary."""
    return {"none": "frictionless"}.get(friction, friction if isinstance(friction, str) else f"coulomb_{friction:g}")


def largest_gap(profile, corner: np.ndarray) -> float:
    """Return the largest distance from points of a mould, shape (n, 2), to the facing side of a sheet."""
    return float(distance_to_line(corner, profile.top).max())


def filled_at(path, corner: np.ndarray, gap: float) -> float | None:
    """Return the pressure at which the gap in a corner falls below `gap`, or None."""
    gaps = [largest_gap(path.profile(s), corner) for s in path.states]
    k = next((k for k, (a, b) in enumerate(zip(gaps, gaps[1:])) if b < gap <= a), None)
    return None if k is None else bisected(path, k, lambda s: largest_gap(path.profile(s), corner) < gap)


def first_touch(path, start: int = 0):
    """Return the first state at which more than the rim touches."""
    rim = path.states[0].measures["contact_length"]
    return next(s for s in path.states[start:] if s.measures["contact_length"] > rim + 1e-12)


def first_touch_at(path) -> float:
    """Return the pressure at which more than the rim begins to touch."""
    rim, first = path.states[0].measures["contact_length"], first_touch(path)
    k = next(k for k, state in enumerate(path.states) if state is first)
    return bisected(path, k - 1, lambda s: s.measures["contact_length"] > rim + 1e-12)


def bisected(path, k: int, beyond) -> float:
    """Return the pressure between states k and k + 1 from which on `beyond(state)` is true.

    The bisection ends at 1/256 of the difference of the two pressures.
    """
    before, after = (path.states[i].measures["pressure"] for i in (k, k + 1))
    for _ in range(8):
        middle = (before + after) / 2
        before, after = ((before, middle) if beyond(path.state_at(fx.pressure(middle), after=path.states[k])) else
                         (middle, after))
    return after


def at_pressures(path, pressures, unit: str) -> dict:
    """Return the thickness at given pressures, each of them met exactly."""
    profiles = {f"{p:g}": path.profile(path.target_state(fx.pressure(p))) for p in pressures}
    thinnest = {p: int(np.argmin(profile.thickness_ratio)) for p, profile in profiles.items()}
    return {
        f"pole_thickness_ratio_at_{unit}": {p: profile.thickness_ratio[0] for p, profile in profiles.items()},
        f"min_thickness_ratio_at_{unit}": {p: profile.thickness_ratio[thinnest[p]] for p, profile in profiles.items()},
        f"min_thickness_at_R_cm_at_{unit}": {
            p: profile.reference_radius[thinnest[p]] for p, profile in profiles.items()},
    }


def cost(path) -> dict:
    """Return the counts of a run."""
    counts = path.counts
    return {"steps": counts.steps, "newton_iterations": counts.iterations, "cutbacks": counts.failures,
            "solve_seconds": counts.seconds}


def report(path, mould, numbers: dict, pressures, out, name: str, **drawn) -> None:
    """Print the results of a friction law; write its path, last profile and picture (options `drawn`)."""
    n = numbers
    filled = "not filled" if n["filled_pressure_psi"] is None else f"filled at {n['filled_pressure_psi']:.4g} psi"
    say(f"{name}: first contact {n['first_contact_pressure_psi']:.5g} psi, {filled}, penetration"
        f" {n['max_penetration_over_h0']:.1e} h0; {n['steps']} states, {n['newton_iterations']} Newton iterations,"
        f" {n['cutbacks']} cut back, {n['solve_seconds']:.1f} s",
        f"  {'psi':>6}{'pole t/t0':>12}{'least t/t0':>12}{'at R, cm':>10}")
    for p in (f"{p:g}" for p in pressures):
        say(f"  {p:>6}" + "".join(f"{n[f'{key}_at_psi'][p]:{width}}" for key, width in (
            ("pole_thickness_ratio", "12.5f"), ("min_thickness_ratio", "12.5f"), ("min_thickness_at_R_cm", "10.3f"))))
    write(path, mould, [path.target_state(fx.pressure(p)) for p in pressures], out, name, **drawn)


def write(path, tool, states, out, name: str, **drawn) -> None:
    """Write a path, its last profile, and the picture of some of its states."""
    path.to_csv(out / f"{name}.csv")
    files.write_profile(path.profile(), out / f"{name}_profile.csv", COMM)
    save(draw_forming(path, states, tool, name, **drawn), out / f"{name}.png")


def draw_forming(path, states, tool, name: str, unit: str = "psi", side: str = "top",
                 along: str = "reference radius R", largest: float = 1.4, curve=None):
    """Return a figure of profiles in the mould, and of thickness and contact pressure over the reference arc length.

    Args:
        path: path of the run.
        states: states to be drawn.
        tool: the mould.
        name: title.
        unit: unit of the pressure, or of the travel of a moving tool.
        side: face towards the tool.
        along: name of the arc length.
        largest: largest contact pressure to be drawn, over the pressure.
        curve: (arc length, thickness ratio, label) of a law for comparison.
    """
    control = "pressure" if "pressure" in path.columns else "travel"
    outline, profiles = tool.outline(), [path.profile(state) for state in states]
    span = np.vstack([points for profile in profiles for points in (profile.bottom, profile.top)])
    size = span[:, 0].max()
    low = min(span[:, 1].min(), max(outline[:, 1].min(), -2 * size)) - 0.05 * size
    high = max(span[:, 1].max(), min(outline[:, 1].max(), 2 * size)) + 0.1 * size
    width = np.clip(4.2 * 1.15 * size / (high - low), 1.8, 4.6)
    figure, (left, middle, right) = figures.figure(3, width=(width + 9.2) / 3, ratios=(width, 4.6, 4.6))
    left.plot(*outline.T, "k", linewidth=1.5)
    for k, (state, profile) in enumerate(zip(states, profiles)):
        color = f"C{k}"
        plots.outline(profile, left, color=color)
        middle.plot(profile.reference_length, profile.thickness_ratio, color=color,
                    label=f"{state.measures[control]:.3g} {unit}")
        right.plot(*contact_pressure(path, state, profile, side), color=color)
    if curve:
        middle.plot(*curve[:2], "k--", linewidth=1.2, label=curve[2])
    left.set(xlabel="r, cm", ylabel="z, cm", title=name.replace("_", " "), xlim=(0, 1.15 * size), ylim=(low, high))
    middle.set(xlabel=f"{along}, cm", ylabel="thickness / original", title="thickness", ylim=(0, 1.02))
    right.set(xlabel=f"{along}, cm", ylabel="contact pressure, psi", title="contact pressure",
              ylim=(0, largest * states[-1].measures["pressure"] if control == "pressure" else None))
    figure.legend(frameon=False, loc="outside right center")
    return figure


def contact_pressure(path, state, profile, side: str = "top") -> tuple[np.ndarray, np.ndarray]:
    """Return reference arc length and contact pressure per current area, at the nodes of the face towards the tool."""
    with path.problem.state_context(state) as problem:
        points, traction = resultants.traction(problem.contacts[0], state.x, state.control)
    rest, now = getattr(profile, f"reference_{side}"), getattr(profile, side)
    nearest = np.hypot(*np.moveaxis(points[:, None] - rest, -1, 0)).argmin(1)
    order = np.argsort(nearest)
    at = nearest[order]
    stretch = np.hypot(*np.gradient(now, axis=0).T) / np.hypot(*np.gradient(rest, axis=0).T)
    if path.problem.scene.kinematics.dimension_of_volume == 3:
        stretch *= np.divide(now[:, 0], rest[:, 0], out=stretch.copy(), where=rest[:, 0] > 1e-9 * rest[:, 0].max())
    begin = int(rest[at[0], 0] < 1e-9 * rest[:, 0].max())           # the node on the axis carries no area
    return profile.reference_length[at][begin:], (traction[order, 0] / stretch[at])[begin:]
