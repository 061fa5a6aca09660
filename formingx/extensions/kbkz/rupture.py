"""Check of damped melts: the draw of a part against the stretch beyond which the melt bears no more."""

from collections.abc import Iterator
from typing import Any

import numpy as np

from ...findings import Finding, register
from ...mesh.nodes import COORDINATES
from ...mesh.triangles import place
from .past_states import PastStates


@register("scene")
def ruptures(body: Any) -> Iterator[Finding]:
    """Draws beyond the equibiaxial `rupture_stretch` of a material."""
    for name, material in body.scene.materials.items():
        melt = getattr(material, "base", material)
        if not hasattr(melt, "rupture_stretch"):
            continue
        most = melt.rupture_stretch("equibiaxial")
        for about, stretch in _draws(body):
            if stretch > most:
                yield Finding("warning", f"materials[{name!r}]",
                              f"{about} stretches it about {stretch:.3g}-fold in all directions, but stretched suddenly"
                              f" it carries its largest stress at {most:.3g}: drawn faster than it relaxes, it thins"
                              f" without end at its thinnest place. Draw less deep, slower or hotter, or check the"
                              f" damping: one fitted to shear or uniaxial data is often too strong in equibiaxial"
                              f" extension")


@register("failure")
def thins(failure: Any) -> Iterator[Finding]:
    """A damped melt that thins without end in the last good state; collective."""
    if failure.last is None:
        return
    problem, drawn = failure.problem, None
    with problem.at(failure.last):
        for past in (history for history in problem.materials if isinstance(history, PastStates)):
            most = getattr(past.material, "base", past.material).rupture_stretch("equibiaxial")
            least, point = past.thinnest()
            if (stretch := least**-0.5) > max(most, drawn[0] if drawn else 0.0):
                drawn = stretch, most, place(problem.scene.mesh, point[:COORDINATES])
    if drawn is not None:
        stretch, most, where = drawn
        yield Finding("serious", "rupture",
                      f"the sheet thins without end at {where}: it is as thin there as at an equibiaxial stretch of"
                      f" {stretch:.3g}, and stretched suddenly this material carries its largest stress at {most:.3g};"
                      f" beyond there is no equilibrium",
                      "a shallower draw, a slower or hotter process, or another damping function: one fitted to shear"
                      " or uniaxial data is often too strong in equibiaxial extension")


def _draws(body: Any) -> Iterator[tuple[str, float]]:
    """(what, stretch) of a flat sheet: at the pole of a free dome; in a mould the root of the areal draw ratio."""
    for pushed in body.pushed:
        if not pushed.flat or not pushed.round:
            continue
        for target in (*body.targets, *body.highest):
            if (stretch := _of_cap(target, pushed.radius)) is not None:
                yield str(target), stretch
        if pushed.tools:
            points, ends = pushed.ways
            if np.all(np.isfinite(ends)) and len(ends) > 1:
                yield repr(pushed.tools[0]), float(np.sqrt(_area(ends) / _area(points)))


def _of_cap(target: Any, radius: float) -> float | None:
    """Stretch at the pole of a flat disc that is blown to a cap of height h radii, about 1 + h^2: what a thin disc has
    whose points go at right angles to the caps that they pass through."""
    if target.name == "pole_stretch":
        return float(target.value)
    height = abs(target.value) / radius
    if target.name == "enclosed_volume":                     # pi h (3 + h^2)/6 for a unit radius
        volume = height / radius**2
        root = np.roots([1.0, 0.0, 3.0, -6 * volume / np.pi])
        height = float(root[np.abs(root.imag) < 1e-9].real.max())
    elif target.name != "pole_height":
        return None
    return 1 + height**2


def _area(line: np.ndarray) -> float:
    """That a line, shape (n, 2), sweeps about the axis."""
    return float(np.sum((line[1:, 0] + line[:-1, 0]) * np.hypot(*np.diff(line, axis=0).T)))
