"""Checks of a body that cools."""

from collections.abc import Iterator
from typing import Any

import numpy as np

from ...errors import InputError
from ...findings import Finding, register
from ...materials.constants import OfTemperature
from ...materials.sets import Sets
from .cooling import CoolingHistory

_RISES = 2.0               # modulus of the coldest over that of the hottest body


@register("scene")
def springs_back(body: Any) -> Iterator[Finding]:
    """A modulus that rises as a stretched body cools pulls it back: it says nothing of what has set.

    (A film that was drawn into a mould, its table of stiffness on the equilibrium energy, came off it again and went
    back to a third of its height.)
    """
    scene = body.scene
    if scene.heat is None:
        return
    low, high = scene.heat.extremes(scene)
    for layer, material in scene.materials.items() if np.isfinite([low, high]).all() else ():
        if isinstance(material, Sets):                      # what it adds as it cools is free of stress
            continue
        relaxed = getattr(material, "equilibrium", material)
        for name, value in {} if relaxed is None else relaxed.constants().items():
            if not isinstance(value, OfTemperature):
                continue
            try:
                cold, hot = value(np.array([low, high]))
            except InputError:                              # it says so itself, if it comes to that
                continue
            if cold > _RISES * hot > 0:
                yield Finding("warning", f"layer {layer!r}",
                              f"{name}, of the relaxed material, is {cold / hot:.3g} times as large at {low:.4g}"
                              f" degrees as at {high:.4g}: as the stretched part cools, it pulls back with that much"
                              f" more force, instead of setting in its shape. For a material that sets see fx.Sets and"
                              f" docs/heat.md")


@register("end")
def temperature_errors(path: Any) -> Iterator[Finding]:
    """Errors of the temperature in space, of states of the last mesh; collective."""
    for history in path.problem.histories:
        if isinstance(history, CoolingHistory):
            yield from history.findings(path.segments[-1].states)
