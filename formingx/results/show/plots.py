"""Curves with matplotlib, drawn without a screen."""

from typing import Any

from ...figures import figure


def curve(path: Any, y: str, x: str, axes: Any = None, **style: Any) -> Any:
    """Column y over column x of a path: the states as dots, the path as a line, limit points ringed, jumps as diamonds.

    Returns the axes; `axes.figure.savefig` saves.
    """
    axes = axes if axes is not None else figure()[1]
    drawn, = axes.plot(*path.curve(x, y), **style)
    axes.plot(path[x], path[y], ".", color=drawn.get_color())
    for states, mark in ((path.limit_points, "o"), (path.jumps, "D")):
        axes.plot([s.measures[x] for s in states], [s.measures[y] for s in states], mark, color=drawn.get_color(),
                  fillstyle="none", markersize=9)
    axes.set_xlabel(axes.get_xlabel() or x.replace("_", " "))
    axes.set_ylabel(axes.get_ylabel() or y.replace("_", " "))
    return axes


def convergence(path: Any, axes: Any = None) -> Any:
    """Correction (3.5.1) against iteration, one line per state (as thesis figures 3.2 and 5.7); returns the axes."""
    axes = axes if axes is not None else figure()[1]
    lines = [[i.correction for i in state.history if i.correction > 0] for state in path.states]
    number = [k for line in lines for k in (*range(1, len(line) + 1), None)]
    axes.semilogy(number, [c for line in lines for c in (*line, None)], ".-", color="tab:blue", alpha=0.5, linewidth=1)
    axes.set_xlabel("Newton iteration")
    axes.set_ylabel("correction $|\\Delta x|/|x|$")
    axes.xaxis.get_major_locator().set_params(integer=True)
    return axes


def main_columns(columns: list[str]) -> tuple[str, str]:
    """(x, y) of the loading curve: the controlled quantity over how far the body has gone, or its force over the
    travel."""
    travel = next((c for c in columns if c.endswith("travel")), None)
    if travel:
        own = travel.replace("travel", "force")
        forces = [c for c in columns if c.endswith("_force")]       # tools that move come first
        return travel, next(c for c in (own, *forces, "pole_height", "strain_energy") if c in columns)
    return (next(c for c in ("pole_height", "enclosed_volume", "strain_energy") if c in columns),
            next(c for c in columns if c.endswith("pressure")))


def section(axes: Any, profile: Any, scale: Any, colours: Any) -> None:
    """Draw the deformed sheet as strips between its two faces; scale: factors of (r, z), colours: of the n nodes,
    (n, 4)."""
    import numpy as np
    from matplotlib.collections import PolyCollection
    bottom, top = np.asarray(profile.bottom) * scale, np.asarray(profile.top) * scale
    strips = np.stack([bottom[:-1], bottom[1:], top[1:], top[:-1]], 1)
    faces = (colours[1:] + colours[:-1]) / 2
    axes.add_collection(PolyCollection(list(strips), facecolors=faces, edgecolors=faces, linewidths=1.8, zorder=2))


def span(profiles: Any, mirrored: bool = False) -> tuple[Any, Any]:
    """Corners (r, z), low and high, of a box around sheets (and their mirror images at r = 0), with some room."""
    import numpy as np
    points = np.vstack([side for profile in profiles for side in (profile.bottom, profile.top)])
    low, high = points.min(0), points.max(0)
    if mirrored:
        low[0] = -high[0]
    margin = 0.06 * max(high - low)
    return low - margin, high + margin


def outline(profile: Any, axes: Any, scale: float = 1.0, **style: Any) -> None:
    """Draw the deformed sheet filled between its faces, r to the right, lengths times `scale`."""
    import numpy as np
    points = scale * np.vstack([profile.bottom, profile.top[::-1]])
    axes.fill(*points.T, **{"linewidth": 0.8, "edgecolor": style.get("color"), **style})
    axes.set_aspect("equal")
