"""What `doctor` says of a body that cools."""

from collections.abc import Iterator

import numpy as np

from ...errors import InputError
from ...materials.constants import OfTemperature
from ...materials.sets import Sets
from ...scene.scene import Scene

_RISES = 2.0               # modulus of the coldest over that of the hottest body


def springs_back(scene: Scene) -> Iterator[tuple[str, str]]:
    """A modulus that rises as a stretched body cools pulls it back: it says nothing of what has set.

    (A film that was drawn into a mould, its table of stiffness on the equilibrium energy, came off it again and went
    back to a third of its height.)
    """
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
                yield f"layer {layer!r}", (
                    f"{name}, of the relaxed material, is {cold / hot:.3g} times as large at {low:.4g} degrees as at"
                    f" {high:.4g}: as the stretched part cools, it pulls back with that much more force, instead of"
                    f" setting in its shape. For a material that sets see fx.Sets and docs/heat.md")
