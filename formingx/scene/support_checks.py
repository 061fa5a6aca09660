"""Checks of the supports of a scene: axis, rigid motions, driven components, hinges of layers."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from mpi4py import MPI

from ..errors import InputError
from ..physics.supports import Constrained

_PRESSED = ("; tools hold only what touches them: of a body between two plates model one half, with Symmetry in its"
            " middle plane")
"""Advice for a body that tools alone would hold."""


def check_driven(supports: Sequence[Any]) -> None:
    """Raise an InputError if a support drives a displacement component that another acts on."""
    pairs = [(support, constraint) for support in supports for constraint in support.constraints()]
    for mine, driven in pairs:
        for other, constraint in pairs if driven.driven else ():
            if other is not mine and (constraint.on, constraint.component) == (driven.on, driven.component):
                raise InputError(f"{mine!r}: {other!r} holds the same component of the same boundary")


def check_held(scene: Any, supports: Sequence[Any], touched: bool = False) -> None:
    """Raise an InputError unless supports constrain u_r on the axis and, without touch of a tool, rigid motions."""
    check_axis(scene, supports)
    if not touched:
        check_rigid_body(scene, supports)


def check_axis(scene: Any, supports: Sequence[Any]) -> None:
    """Raise an InputError if an axisymmetric mesh crosses the axis, or no support constrains u_r on it."""
    if not scene.kinematics.axisymmetric:
        return
    geometry = scene.mesh.domain.geometry
    comm = scene.mesh.comm
    low = comm.allreduce(geometry.x[:, 0].min(initial=np.inf), MPI.MIN)
    size = comm.allreduce(np.abs(geometry.x).max(initial=0.0), MPI.MAX)
    if low < -1e-12 * size:
        raise InputError(f"Scene: the mesh crosses the axis: its smallest R is {low:.6g}, must be at least 0")
    if low > 1e-12 * size:
        return
    for support in supports:
        for constraint in support.constraints():
            if isinstance(constraint, Constrained) and constraint.component == 0 and constraint.on is not None \
                    and np.all(scene.mesh.nodes_of(constraint.on)[:, 0] <= 1e-12 * size):
                return
    raise InputError(f"Scene: the mesh touches the axis R = 0, but no support holds u_r there: add"
                     f" Symmetry of one of {list(scene.mesh.boundaries)}")


def check_rigid_body(scene: Any, supports: Sequence[Any]) -> None:
    r"""Check that the supports prevent every rigid motion of the body.

    Let c_ij be the constrained displacement component of the rigid motion j (`Kinematics.rigid_motions`) at node i of a
    constraint with n nodes. A constrained mean counts as one node. The body is free to move if the matrix

    .. math:: G_{jk} = \sum_{\text{constraints}} \frac{1}{n} \sum_{i=1}^{n} c_{ij} c_{ik}

    is singular. A body that can move is an InputError.
    """
    names, modes = zip(*scene.kinematics.rigid_motions().items())
    gram = np.zeros((len(modes), len(modes)))
    size = max(scene.extent)
    for support in supports:
        for constraint in scene.kinematics.in_axes(support, support.all_constraints()):
            at_node = constraint.point is not None
            X = (np.array([constraint.point]) if at_node else scene.mesh.nodes_of(constraint.on)) / size
            rows = np.stack([mode(X)[:, constraint.component] for mode in modes], 1)
            if not isinstance(constraint, Constrained):
                rows = rows.mean(0, keepdims=True)
            gram += rows.T @ rows / len(rows)
    mesh: Any = scene.mesh
    if scene.kinematics.components == 3 and not mesh.flat:
        gram[3, :3] = gram[:3, 3] = 0.0                      # tension resists rotations about other axes than z
    values, vectors = np.linalg.eigh(gram)
    if values[0] < 1e-12:
        free = names[int(np.argmax(np.abs(vectors[:, 0])))]
        raise InputError(f"Scene: too little support: the body is free to move as a rigid body ({free});"
                         f" supports are {supports!r}; constrain that motion, for example by Clamped or"
                         f" SimplySupported{_PRESSED if scene.contacts else ''}")


def check_hinges(scene: Any) -> None:
    """Raise an InputError if a layer at a hinge is much softer than another layer at the same rim.

    A hinge with weight="area" pulls all layers with one traction, so moduli may differ by a factor of 100. A loaded
    layer may not be 50 times softer: the pressure would squeeze it out.
    """
    moduli = {name: scene.shear_modulus(name) for name in scene.materials}
    for constraint in (constraint for support in scene.supports for constraint in support.constraints()):
        if isinstance(constraint, Constrained):
            continue
        at_rim = _layers_at(scene, constraint.on)
        hard = max(at_rim, key=moduli.__getitem__)
        soft = min(at_rim, key=moduli.__getitem__)
        pressed = {name for load in scene.loads if load.on is not None
                   for name in _layers_at(scene, load.on)} & at_rim
        for name in pressed:
            if moduli[hard] > 50 * moduli[name]:
                raise InputError(f"Scene: the pressure that bends layer {hard!r} would squeeze layer {name!r},"
                                 f" {moduli[hard] / moduli[name]:.3g} times softer, out of the free face of the"
                                 f" hinge SimplySupported({constraint.on!r}): use Clamped({constraint.on!r})")
        if not constraint.by_stiffness and moduli[hard] > 100 * moduli[soft]:
            raise InputError(f"Scene: SimplySupported({constraint.on!r}) pulls all layers with the same traction, but"
                             f" layer {soft!r} is {moduli[hard] / moduli[soft]:.3g} times softer than {hard!r}: use"
                             f" SimplySupported({constraint.on!r}, weight='stiffness')")


def _layers_at(scene: Any, boundary: str) -> set[str]:
    """Return the names of the layers with cells at a boundary, equal on all ranks; collective."""
    topology, cells = scene.mesh.domain.topology, scene.mesh.cells
    topology.create_connectivity(1, 2)
    touching = {topology.connectivity(1, 2).links(f)[0] for f in scene.mesh.facets_of(boundary)}
    mine = set(cells.values[np.isin(cells.indices, sorted(touching))].tolist())
    tags = set().union(*scene.mesh.comm.allgather(mine))
    return {name for name, tag in scene.mesh.layers.items() if tag in tags}
