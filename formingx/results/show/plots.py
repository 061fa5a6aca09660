"""Curves drawn with matplotlib, without a screen."""

from typing import Any

from ...figures import new_axes


def curve(path: Any, y: str, x: str, axes: Any = None, **style: Any) -> Any:
    """Draw one output quantity of a path over another on matplotlib axes, and return them (`Path.plot`).

    States are dots on a smooth line. Limit points are circled; states after a snap-through are diamonds.
    """
    axes = axes if axes is not None else new_axes()
    drawn, = axes.plot(*path.curve(x, y), **style)
    axes.plot(path[x], path[y], ".", color=drawn.get_color())
    for states, mark in ((path.limit_points, "o"), (path.jumps, "D")):
        axes.plot([s.measures[x] for s in states], [s.measures[y] for s in states], mark, color=drawn.get_color(),
                  fillstyle="none", markersize=9)
    axes.set_xlabel(axes.get_xlabel() or x.replace("_", " "))
    axes.set_ylabel(axes.get_ylabel() or y.replace("_", " "))
    return axes


def convergence(path: Any, axes: Any = None) -> Any:
    r"""Draw the relative correction of the unknowns x over the number of the Newton iteration, one line for each state.

    It is the measure of convergence of Song 1993, eq. (3.5.1); figures 3.2 and 5.7 there are of this kind:

    .. math:: |\Delta x| / |x|
    """
    axes = axes if axes is not None else new_axes()
    lines = [[i.correction for i in state.history if i.correction > 0] for state in path.states]
    number = [k for line in lines for k in (*range(1, len(line) + 1), None)]
    axes.semilogy(number, [c for line in lines for c in (*line, None)], ".-", color="tab:blue", alpha=0.5, linewidth=1)
    axes.set_xlabel("Newton iteration")
    axes.set_ylabel("correction $|\\Delta x|/|x|$")
    axes.xaxis.get_major_locator().set_params(integer=True)
    return axes


def main_columns(columns: list[str]) -> tuple[str, str]:
    """Return the names (x, y) of the columns of the main loading curve.

    It is the tool force over the travel, else the pressure or, over time, the pole height. Enclosed volume, strain
    energy or volume error replace a missing pole height.
    """
    travel = next((c for c in columns if c.endswith("travel")), None)
    if travel:
        own_force = travel.replace("travel", "force")
        forces = [c for c in columns if c.endswith("_force")]       # tools that move come first
        return travel, next(c for c in (own_force, *forces, "pole_height", "strain_energy") if c in columns)
    deformation = next(c for c in ("pole_height", "enclosed_volume", "strain_energy", "volume_error") if c in columns)
    pressure = next((c for c in columns if c.endswith("pressure")), None)
    if pressure is None and columns[0] == "process_time":
        return columns[0], deformation
    return deformation, pressure or columns[0]


def section(axes: Any, profile: Any, scale: Any, colours: Any) -> None:
    """Draw a deformed section, times `scale`, as strips between its faces; colours at nodes: RGBA, (n, 4)."""
    import numpy as np
    from matplotlib.collections import PolyCollection
    rows = profile.through_wall() * scale
    strips = np.concatenate([rows[:, :-1], rows[::-1, 1:]]).swapaxes(0, 1)
    faces = (colours[1:] + colours[:-1]) / 2
    axes.fill(*(profile.outline * scale).T, color=faces[-1], zorder=1.9)       # of an end that rolls over the face
    axes.add_collection(PolyCollection(list(strips), facecolors=faces, edgecolors=faces, linewidths=1.8, zorder=2))


def span(profiles: Any, mirrored: bool = False) -> tuple[Any, Any]:
    """Return corners (r, z) of a box around sheets, with mirror images at r = 0 if wanted, 6 % margin, length."""
    import numpy as np
    points = np.vstack([profile.outline for profile in profiles])
    low, high = points.min(0), points.max(0)
    if mirrored:
        low[0] = -high[0]
    margin = 0.06 * max(high - low)
    return low - margin, high + margin


def outline(profile: Any, axes: Any, scale: float = 1.0, **style: Any) -> None:
    """Draw the section of a deformed sheet, times `scale`, as an area in one colour; r points right."""
    points = scale * profile.outline
    axes.fill(*points.T, **{"linewidth": 0.8, "edgecolor": style.get("color"), **style})
    axes.set_aspect("equal")
