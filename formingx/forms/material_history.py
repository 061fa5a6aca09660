"""Internal variables of materials at quadrature points."""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
import ufl

from .. import _compat
from ..errors import InputError
from ..ranks import gathered
from .history import Start
from .transfer import MovingLeastSquares, fitted_tensors, isochoric_gradients


class InternalVariables(NamedTuple):
    """History variables of a material.

    Attributes:
        time: process time of the last accepted state.
        values: {name: values in the locally owned cells of the layers, shape (cells, points, components)}.
    """

    time: float
    values: dict[str, np.ndarray]


class MaterialHistory:
    """Internal variables of one material at the quadrature points of the energy."""

    def __init__(self, forms: Any, terms: Any):
        self._forms, self._terms = forms, terms
        self.rate_dependent = terms.material.rate_dependent
        self._cells, self._own = terms.cells, terms.own_cells       # a ghost is computed as its owner computes it
        self._numbers = forms.domain.topology.original_cell_index[self._own]      # in the script's mesh
        updated = terms.updated(forms.elastic_F)
        self._sizes = {name: int(np.prod(f.ufl_shape, dtype=int)) for name, f in terms.internal.items()}
        flat = [ufl.as_ufl(updated[name])[i] if i else ufl.as_ufl(updated[name])
                for name, f in terms.internal.items() for i in np.ndindex(f.ufl_shape)]
        self._updated = _compat.compile_expression(ufl.as_vector(flat), terms.places)
        self._now: InternalVariables | None = None  # the last values put or got, if they are still valid
        self.start()

    def start(self) -> None:
        """Set the internal variables of the reference configuration, at process time 0."""
        self._now = None
        for name, rest in self._terms.material.internal.items():
            self._set(name, self._cells, np.asarray(rest, dtype=float).ravel())
        self._terms.start.value = 0.0

    def advance(self, x: np.ndarray, control: float, start: Start | None = None) -> None:
        """Update the internal variables to the end of a step, for the state to which the forms are set."""
        self._now = None
        for name, values in self._values_at_end(self._cells).items():
            self._set(name, self._cells, values)
        self._terms.start.value = self._forms.time_at(control)

    def _values_at_end(self, cells: np.ndarray) -> dict[str, np.ndarray]:
        """Return {name: internal variable at the end of the step in some cells, (cells, points, components)}."""
        shape = len(cells), len(self._terms.places), sum(self._sizes.values())
        values = self._updated.eval(self._forms.domain, cells).reshape(shape) if len(cells) else np.zeros(shape)
        parts = np.split(values, np.cumsum(list(self._sizes.values()))[:-1], axis=2)
        return dict(zip(self._sizes, parts, strict=True))

    def forget_motion(self) -> None:
        """Reset the internal variables listed in `Material.motion_variables` to their initial values."""
        for name in self._terms.material.motion_variables:
            self._now = None
            self._set(name, self._cells, np.asarray(self._terms.material.internal[name], dtype=float).ravel())

    def get(self) -> InternalVariables:
        """Return the internal variables and the process time; the arrays are read-only."""
        if self._now is None:
            values = {name: self._array(name)[self._rows(name, self._own)] for name in self._sizes}
            self._now = _unchangeable(InternalVariables(float(self._terms.start.value), values))
        return self._now

    def put(self, variables: InternalVariables) -> None:
        """Set the internal variables and the process time to values from `get`."""
        if variables is self._now:
            return
        for name, values in variables.values.items():
            self._set(name, self._own, values)
            self._terms.internal[name].x.scatter_forward()
        self._terms.start.value = variables.time
        self._now = variables

    def save(self, variables: InternalVariables) -> dict[str, Any]:
        """Return "time", "cells" (numbers of the script, ascending) and "values" as data of all ranks; collective.

        "values" is {name: array of shape (cells, points, components)}.
        """
        comm = self._forms.comm
        numbers = gathered(comm, self._numbers)
        order = np.argsort(numbers)
        return {"time": variables.time, "cells": numbers[order],
                "values": {name: gathered(comm, v)[order] for name, v in variables.values.items()}}

    def load(self, data: dict[str, Any]) -> InternalVariables:
        """Return this rank's variables from data of `save`; another mesh or material is an InputError."""
        numbers, values = np.array(data.get("cells", []), dtype=np.int64), data.get("values", {})
        rows = np.minimum(np.searchsorted(numbers, self._numbers), len(numbers) - 1)
        found = {name: np.array(v, dtype=float) for name, v in values.items()}
        q = len(self._terms.places)
        if set(found) != set(self._sizes) or not np.array_equal(numbers[rows], self._numbers) \
                or any(v.shape != (len(numbers), q, self._sizes[name]) for name, v in found.items()):
            raise InputError(f"the history of {self._terms.material} belongs to another mesh, or to another material")
        return InternalVariables(float(data["time"]), {name: found[name][rows] for name in self._sizes})

    def transfer(self, source: MaterialHistory, variables: InternalVariables, x: np.ndarray, control: float,
                 mapping: Callable[[np.ndarray], np.ndarray]) -> InternalVariables:
        """Interpolate the internal variables `variables` of `source`, on another mesh, to this mesh; collective.

        Both problems' forms must be in the state. mapping: points of the other mesh, (n, coordinates), to this one.
        """
        interpolation = MovingLeastSquares(self._forms.comm, mapping(source.points), self.points)
        shapes = self._terms.material.tensor_powers
        F = [isochoric_gradients(entry._forms, entry._own, entry._terms.places)
             for entry in (source, self)] if shapes else []

        def transferred(name: str, values: np.ndarray) -> np.ndarray:
            if name not in shapes:
                return interpolation.fitted(values)
            return fitted_tensors(interpolation, values, *(F if shapes[name] > 0 else [
                np.linalg.inv(f).swapaxes(1, 2) for f in F]))
        return _unchangeable(InternalVariables(variables.time, {
            name: transferred(name, v.reshape(-1, v.shape[-1])).reshape(len(self._own), -1, v.shape[-1])
            for name, v in variables.values.items()}))

    @cached_property
    def points(self) -> np.ndarray:
        """Reference positions of the quadrature points in the locally owned cells, shape (n, coordinates), length."""
        X, components = self._forms.X, self._forms.X.ufl_shape[0]
        if not len(self._own):
            return np.zeros((0, components))
        where = _compat.compile_expression(X, self._terms.places)
        return where.eval(self._forms.domain, self._own).reshape(-1, components)

    def _array(self, name: str) -> np.ndarray:
        """Return the values of an internal variable at all quadrature points of this rank, shape (points, components).
        """
        return self._storage[name][0]

    def _rows(self, name: str, cells: np.ndarray) -> np.ndarray:
        """Return the rows of an internal variable's values in some cells, shape (cells, points of a cell)."""
        return self._storage[name][1][cells]

    @cached_property
    def _storage(self) -> dict[str, tuple[np.ndarray, np.ndarray]]:
        """{name: (values, shape (quadrature points, components), rows, shape (cells, points of a cell))}."""
        return {name: (np.asarray(f.x.array).reshape(-1, self._sizes[name]), np.asarray(f.function_space.dofmap.list))
                for name, f in self._terms.internal.items()}

    def _set(self, name: str, cells: np.ndarray, values: np.ndarray) -> None:
        """Set an internal variable in some cells to values of shape (components,) or (cells, points, components)."""
        self._array(name)[self._rows(name, cells)] = values


def _unchangeable(variables: InternalVariables) -> InternalVariables:
    """Make the arrays of internal variables read-only, and return these variables."""
    for array in variables.values.values():
        array.setflags(write=False)
    return variables
