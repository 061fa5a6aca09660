"""Test whether the energy of a material is linear in its temperature-dependent constants."""

from __future__ import annotations

from typing import Any

import numpy as np

from ....materials.constants import OfMesh, OfPosition, OfTemperature

_STRETCHES = np.array([[1.3, 2.0, 3.0], [1.1, 0.8, 2.5]])
"""Principal stretches in the sheet at which the energy is examined, shape (2, 3)."""

_LINEAR = 1e-9
"""Largest relative difference between the stress at mean constants and the mean stress of a linear energy."""

_SPAN = 30.0
"""Half the range of temperatures that is examined if heat conduction has no bounds, degrees."""


def is_linear(scene: Any, layer: str) -> bool:
    """Return True if the energy of a layer at the mean of its constants is the mean of its energies; collective.

    This holds for elastic materials whose temperature-dependent constants are moduli.
    """
    material, sample = scene.materials[layer], scene.sample(layer)
    if material.internal or material.integral:
        return False
    T = sample.temperature
    low, high = scene.heat.extremes(scene)
    if not np.isfinite([low, high]).all():
        ends = scene.mesh.comm.allgather((T.min(initial=np.inf), T.max(initial=-np.inf)))
        low, high = min(a for a, _ in ends) - _SPAN, max(b for _, b in ends) + _SPAN
    sets: list[list[float]] = [[], []]
    for value in material.constants().values():
        if not isinstance(value, float | int | OfTemperature | OfPosition | OfMesh):
            return False                                     # a user's own constant may be any function
        for found, temperature in zip(sets, (low, high)):
            if isinstance(value, OfTemperature):
                found.append(float(value.clamped(temperature)))
            elif isinstance(value, float | int):
                found.append(float(value))
            else:
                found.append(float(np.ravel(value.values(sample))[0]) if len(sample.points) else 1.0)
    l = np.vstack([_STRETCHES, 1 / _STRETCHES.prod(0)])
    a, b = (material.response.derivatives(l, constants)[0] for constants in sets)
    mean = material.response.derivatives(l, [(x + y) / 2 for x, y in zip(*sets)])[0]
    linear = bool(np.abs((a + b) / 2 - mean).max() <= _LINEAR * np.abs(mean).max())
    return all(scene.mesh.comm.allgather(linear))
