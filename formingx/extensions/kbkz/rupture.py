"""Check of damped melts: draw of a part against the stretch with the largest stress."""

from collections.abc import Iterator
from typing import Any

import numpy as np

from ...checks.expected_stretch import expected_stretches
from ...findings import Finding, register
from ...mesh.nodes import COORDINATES
from ...mesh.triangles import place
from .past_states import PastStates


@register("scene")
def ruptures(body: Any) -> Iterator[Finding]:
    """Find draws beyond the equibiaxial `rupture_stretch` of a material.

    Args:
        body: the examined body.

    Yields:
        A finding for each such material.
    """
    for name, material in body.scene.materials.items():
        most = material.base.rupture_stretch("equibiaxial")
        for about, stretch in expected_stretches(body) if np.isfinite(most) else ():
            if stretch > most:
                yield Finding("warning", f"materials[{name!r}]",
                              f"{about} stretches it about {stretch:.3g}-fold in all directions, but stretched suddenly"
                              f" it carries its largest stress at {most:.3g}: drawn faster than it relaxes, it thins"
                              f" without end at its thinnest place. Draw less deep, slower or hotter, or check the"
                              f" damping: one fitted to shear or uniaxial data is often too strong in equibiaxial"
                              f" extension")


@register("failure")
def thins(failure: Any) -> Iterator[Finding]:
    """Find a damped melt that thins without end in the last good state; collective.

    Args:
        failure: the failed run.

    Yields:
        A finding for each such material.
    """
    if failure.last is None:
        return
    problem, drawn = failure.problem, None
    with problem.state_context(failure.last):
        for past in (history for history in problem.materials if isinstance(history, PastStates)):
            most = past.material.base.rupture_stretch("equibiaxial")
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
