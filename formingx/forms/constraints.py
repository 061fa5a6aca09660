"""Constraints of unknowns and of boundary means by supports, and the active constraints of a stage."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from dolfinx import fem
from mpi4py import MPI
from petsc4py import PETSc

from ..errors import InputError
from ..physics.supports import Constrained


class Entry(NamedTuple):
    """Unknowns that one constraint of a support prescribes.

    Attributes:
        item: number of the support in `Scene.items`; -1 for unknowns that appear in no equation and stay 0.
        bc: the DirichletBC.
        dofs: local numbers of the unknowns with ghosts, shape (n,).
        driven: True if the unknowns are proportional to a load parameter (control) instead of 0.
    """

    item: int
    bc: Any
    dofs: np.ndarray
    driven: bool


class Active(NamedTuple):
    """Constraints of the supports that are active in one stage of a process.

    Attributes:
        bcs: list of the DirichletBCs.
        dofs: local numbers of the n constrained unknowns with ghosts, ascending, shape (n,).
        owned: mask of the locally owned unknowns in `dofs`, shape (n,).
        driver: number in `Scene.items` of the support that moves each unknown; -1 for fixed unknowns, shape (n,).
        rows: for each constrained mean displacement of a boundary (`ConstrainedMean`) its row of the constraint matrix,
            locally owned entries, shape (k,); 0 if it is inactive.
        means_active: for each constrained mean displacement True if it is active.
    """

    bcs: list[Any]
    dofs: np.ndarray
    owned: np.ndarray
    driver: np.ndarray
    rows: list[np.ndarray]
    means_active: list[bool]


class Constraints:
    """All constraints that the supports of a scene can impose; a support where the mesh has no node is an InputError.

    assemble: function that assembles a compiled linear form and returns its locally owned entries.

    Attributes:
        entries: list of `Entry`, the constrained unknowns.
        means: constrained mean displacements of boundaries (`ConstrainedMean`), list of (number of the support in
            `Scene.items`, row of the constraint matrix). A row has the locally owned entries, shape (n,).
    """

    def __init__(self, forms: Any, assemble: Callable[[Any], np.ndarray]):
        self._forms, zero = forms, PETSc.ScalarType(0)
        self._n = forms.space.dofmap.index_map.size_local
        self.entries: list[Entry] = []
        self.means: list[tuple[int, np.ndarray]] = []
        for i, support in enumerate(forms.scene.items):
            for item in forms.constraints(support):
                if isinstance(item, Constrained):
                    sub = forms.space.sub(0).sub(item.component)
                    dofs = self._dofs_of(support, sub, item)
                    self.entries.append(Entry(i, fem.dirichletbc(zero, dofs, sub), dofs, item.driven))
                else:
                    self.means.append((i, assemble(forms.compile(forms.mean_row(item)))))
        for sub, dofs in forms.idle_unknowns():
            self.entries.append(Entry(-1, fem.dirichletbc(zero, dofs, sub), dofs, False))

    @property
    def can_move(self) -> bool:
        """True if a support prescribes displacements that a load parameter (control) changes."""
        return any(entry.driven for entry in self.entries)

    def driven_by(self, item: int) -> np.ndarray:
        """Return the local numbers of owned unknowns that support `item` moves, ascending, shape (n,)."""
        dofs = np.unique(np.concatenate([e.dofs for e in self.entries if e.item == item and e.driven]))
        return dofs[dofs < self._n]

    def active(self, inactive: set[int]) -> Active:
        """Return the constraints that are active while the items `inactive` of `Scene.items` are not.

        If one support fixes an unknown and another one moves it, the unknown follows the moving support.
        """
        entries = [entry for entry in self.entries if entry.item not in inactive]
        numbers = np.concatenate([np.zeros(0, dtype=np.int32), *(e.dofs for e in entries)])
        drivers = np.concatenate([np.zeros(0, dtype=int),
                                  *(np.full(len(e.dofs), e.item if e.driven else -1) for e in entries)])
        order = np.argsort(drivers < 0, kind="stable")          # where two supports meet, the driven one counts
        dofs, first = np.unique(numbers[order], return_index=True)
        owned = dofs < self._n
        means_active = [item not in inactive for item, _ in self.means]
        rows = [active * row for (_, row), active in zip(self.means, means_active, strict=True)]
        for row in rows:
            row[dofs[owned]] = 0
        return Active([entry.bc for entry in entries], dofs, owned, drivers[order][first], rows, means_active)

    def _dofs_of(self, support: Any, sub: Any, item: Constrained) -> np.ndarray:
        """Return the local numbers of the unknowns that a constraint prescribes, with ghosts, shape (n,).

        sub: subspace of the displacement component. Raise `InputError` if the mesh has no node at the point.
        """
        forms = self._forms
        if item.on is not None:
            return fem.locate_dofs_topological(sub, forms.mesh.facets.dim, forms.mesh.facets_of(item.on))
        near, point = 1e-8 * forms.length, forms.nearest(np.array([item.point])).T
        found = fem.locate_dofs_geometrical((sub, sub.collapse()[0]),
                                            lambda X: np.hypot(*(X[: len(point)] - point)) < near)[0]
        if forms.comm.allreduce(len(found), MPI.MAX) == 0:
            raise InputError(f"{support!r}: the mesh has no node at this place")
        return found
