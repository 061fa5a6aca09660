"""Checks of the boundaries and layers on which supports, loads and contacts of a scene act."""

from typing import Any

import numpy as np
from mpi4py import MPI

from ..errors import InputError, check_name
from ..physics.supports import Constrained


def check(scene: Any) -> None:
    """Check that the boundary of each item exists and has an area, and that a load knows its layers.

    An InputError also reports a load or contact on the axis, and two hinges on one boundary.
    """
    mesh, hinged = scene.mesh, set()
    size = mesh.comm.allreduce(np.abs(mesh.domain.geometry.x).max(initial=0.0), MPI.MAX)
    for item in scene.items:
        on = item.on
        if on is not None:
            check_name(f"{item!r}: boundary", on, mesh.boundaries)
            if mesh.comm.allreduce(len(mesh.facets_of(on)), MPI.SUM) == 0:
                raise InputError(f"{item!r}: boundary {on!r} is empty: no facet of the mesh carries it")
            if item not in scene.supports and scene.kinematics.axisymmetric \
                    and np.all(mesh.nodes_of(on)[:, 0] <= 1e-12 * size):
                raise InputError(f"{item!r}: boundary {on!r} lies on the axis R = 0 and has no area: must be a face of"
                                 f" the body")
        if isinstance(density := getattr(item, "density", None), dict):
            for layer in set(density) - {None}:
                check_name(f"{item!r}: density: layer", layer, mesh.layers)
    for support in scene.supports:
        for constraint in support.constraints():
            if isinstance(constraint, Constrained):
                continue
            if (place := (constraint.on, constraint.component)) in hinged:
                raise InputError(f"{support!r}: another support already constrains the mean displacement of"
                                 f" {constraint.on!r}: leave one of them out")
            hinged.add(place)
