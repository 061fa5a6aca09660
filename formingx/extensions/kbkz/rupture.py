"""Checks of damped melts, which thin without end beyond the stretch with the largest stress."""

from collections.abc import Iterator
from typing import Any

import numpy as np

from ...checks.expected_stretch import expected_stretches
from ...findings import Finding, register
from ...mesh.triangles import place
from .past_states import PastStates


@register("scene")
def ruptures(body: Any) -> Iterator[Finding]:
    """Yield a warning for each layer and load, target or tool that stretches a sheet beyond `rupture_stretch`."""
    for name, material in body.scene.materials.items():
        limit = material.base.rupture_stretch("equibiaxial")
        for about, stretch in expected_stretches(body) if np.isfinite(limit) else ():
            if stretch > limit:
                yield Finding("warning", f"materials[{name!r}]",
                              f"{about} stretches it about {stretch:.3g}-fold in all directions, but stretched suddenly"
                              f" it carries its largest stress at {limit:.3g}: drawn faster than it relaxes, it thins"
                              f" without end at its thinnest place. Draw less deep, slower or hotter, or check the"
                              f" damping: one fitted to shear or uniaxial data is often too strong in equibiaxial"
                              f" extension")


@register("failure")
def thins(failure: Any) -> Iterator[Finding]:
    """Yield a damped melt's thinnest point, in a failed run's last state, beyond `rupture_stretch`; collective."""
    if failure.last is None:
        return
    problem, drawn = failure.problem, None
    with problem.state_context(failure.last):
        for past in (history for history in problem.history.materials if isinstance(history, PastStates)):
            limit = past.material.base.rupture_stretch("equibiaxial")
            smallest, point = past.smallest_stretch()
            if (stretch := smallest**-0.5) > max(limit, drawn[0] if drawn else 0.0):
                drawn = stretch, limit, place(problem.scene.mesh, point)
    if drawn is not None:
        stretch, limit, where = drawn
        yield Finding("serious", "rupture",
                      f"the sheet thins without end at {where}: it is as thin there as at an equibiaxial stretch of"
                      f" {stretch:.3g}, and stretched suddenly this material carries its largest stress at {limit:.3g};"
                      f" beyond there is no equilibrium",
                      "a shallower draw, a slower or hotter process, or another damping function: one fitted to shear"
                      " or uniaxial data is often too strong in equibiaxial extension")
