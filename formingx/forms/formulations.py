"""Formulation of each kind of model."""

from __future__ import annotations

from typing import Any

from ..physics.models import DisplacementPenalty, Membrane, MixedPressure, Model
from .formulation import Formulation
from .membrane import MidSurface
from .solid import Solid

FORMULATIONS: dict[type[Model], type[Formulation]] = {MixedPressure: Solid, DisplacementPenalty: Solid,
                                                      Membrane: MidSurface}
"""Formulation of each kind of model; a user's own subclass of a model has the formulation of its base class."""


def formulate(scene: Any) -> Formulation:
    """Return the `Formulation` of a scene: `Kinematics.formulation` if set, else that of the body model."""
    if (formulation := scene.kinematics.formulation) is not None:
        return formulation(scene)
    return next(FORMULATIONS[kind] for kind in type(scene.model).__mro__ if kind in FORMULATIONS)(scene)
