"""Past states of a material whose stress is an integral over them (`KBKZ`), at the quadrature points of the energy."""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
import ufl
from dolfinx import fem
from mpi4py import MPI

from ... import _compat
from ...errors import InputError
from ...forms.history import Start
from ...forms.transfer import MovingLeastSquares, fitted_tensors, isochoric_gradients
from ...materials.tensors import IDENTITY, cofactor, deviator_squared, entries, inner, isochoric
from ...ranks import gathered

_DROPPED_STATE_ERROR = 3e-7
"""Relative error of the present stress up to which a past state is dropped and interpolated from its neighbours.

In a fine run of a thousand states the errors add up to 3e-4 of the stress (with 3e-6 to 4e-3).
"""


class PastState(NamedTuple):
    """Past state of a material at n quadrature points of the cells of this rank.

    Attributes:
        reduced_time: reduced time of the material at that state, a number or shape (n,).
        C: entries 11, 22, 12, 33 of Cbar = J^(-2/3) C at that state, shape (4, n).
    """

    reduced_time: Any
    C: np.ndarray


class StoredStates(NamedTuple):
    """History variables of a material with an integral over K past states at n points.

    Attributes:
        time: process time of the last accepted state.
        states: the past states, up to the last accepted one.
        smallest_h: smallest damping h that has applied to each past state so far, shape (K, n); None if h may increase.
    """

    time: float
    states: tuple[PastState, ...]
    smallest_h: np.ndarray | None


class PastStates:
    """Past states of a material as a `formingx.forms.history.History`; `refresh` updates coefficients in the forms."""

    rate_dependent = True

    def __init__(self, forms: Any, terms: Any):
        self._forms, self._terms, self._law = forms, terms, terms.material.integral
        self._own = terms.own_cells
        self._numbers = forms.domain.topology.original_cell_index[self._own]
        self._n = len(self._own) * len(terms.places)

        def at_points(expression: Any) -> fem.Expression:
            """Return a UFL expression, compiled for the quadrature points."""
            return _compat.compile_expression(expression, terms.places)
        self._C = at_points(ufl.as_vector(isochoric(forms.elastic_F)))
        self._aT = at_points(ufl.as_vector([terms.constants["aT"]])) if self._law.shifted else None
        rows = {name: f.function_space.dofmap.list[self._own].ravel() for name, f in terms.past_integrals.items()}
        self._coefficients = [(f.x.array.reshape(-1, int(np.prod(f.ufl_shape))), rows[name])
                      for name, f in terms.past_integrals.items()]
        self._refreshed: tuple[Any, Any] | None = None
        self.start()

    def start(self) -> None:
        """Store the undeformed state at time 0 as the only past state."""
        C = np.repeat(np.array(IDENTITY)[:, None], self._n, axis=1)
        undeformed = PastState(np.zeros(self._n) if self._aT else 0.0, C)
        self.put(StoredStates(0.0, (undeformed,), np.ones((1, self._n)) if self._law.irreversible else None))

    def forget_motion(self) -> None:
        """Discard the length of the last step, so that the integrand is linear in time over the next step."""
        self._last_step = 0.0
        self._refreshed = None

    def get(self) -> StoredStates:
        """Return the past states up to the last accepted state."""
        return self._stored

    def put(self, variables: StoredStates) -> None:
        """Set the past states from the result of `get`."""
        self._stored, self._terms.start.value = variables, variables.time
        times = np.array([state.reduced_time for state in variables.states])
        self._past = np.array([state.C for state in variables.states])
        self._weights = self._law.weights(times[-1] - times)
        self._last_step = times[-1] - times[-2] if len(times) > 1 else 0.0       # gives the strain rate
        self._parabola_allowed = 1.0 if len(times) < 2 else inner(self._past[-1], cofactor(self._past[-2])) < 4
        self._refreshed = None

    @np.errstate(over="ignore", invalid="ignore")      # a trial state far back in time overflows, and is rejected
    def refresh(self) -> None:
        """Linearise the stress at the present fields and time: update its coefficients in the forms."""
        C, step, rate = self._present()
        if self._refreshed and np.array_equal(self._refreshed[0], C) and np.array_equal(self._refreshed[1], step):
            return
        W, slope = self._law.weights_after(self._weights, step, self._last_step, self._parabola_allowed)
        S, D, T = self._law.stress(C, self._past, W, slope, self._stored.smallest_h)
        count = np.array([1.0, 1.0, 2.0, 1.0])[:, None]
        T = T * rate
        S = count * (S - T * (self._forms.time_now - self._stored.time))
        for (array, rows), values in zip(self._coefficients, (S, C, (count[:, None] * D).reshape(16, -1), count * T),
                                         strict=True):
            array[rows] = values.T
        self._refreshed = C, step

    def advance(self, x: np.ndarray, control: float, start: Start | None = None) -> None:
        """Add the forms' present state, at the time of `control`, and drop states without effect on the stress."""
        (C, step, _), variables = self._present(), self._stored
        states = [*variables.states, PastState(variables.states[-1].reduced_time + step, C)]
        smallest_h = variables.smallest_h
        if smallest_h is not None:
            h = self._law.inverses_and_damping(C, self._past, smallest_h)[1]
            smallest_h = np.concatenate([h, np.ones((1, self._n))])
        time = self._forms.time_at(control)
        if time == variables.time and len(states) > 2 and np.array_equal(states[-2].reduced_time,
                                                                      states[-3].reduced_time):
            chosen = [*range(len(states) - 2), len(states) - 1]       # no state between two jumps at one instant
        else:
            chosen = self._indices_to_keep(states, C, smallest_h)
        self.put(StoredStates(time, tuple(states[k] for k in chosen),
                              None if smallest_h is None else smallest_h[chosen]))

    def transfer(self, source: PastStates, variables: StoredStates, x: np.ndarray, control: float,
                 mapping: Callable[[np.ndarray], np.ndarray]) -> StoredStates:
        """Return past states of another mesh here, by `mapping` of its reference points (n, components); collective."""
        interpolation = MovingLeastSquares(self._forms.comm, mapping(source.points), self.points)
        F = [isochoric_gradients(entry._forms, entry._own, entry._terms.places) for entry in (source, self)]

        def fitted(values: np.ndarray) -> np.ndarray:
            return interpolation.fitted(values.T).T
        states = tuple(PastState(fitted(s.reduced_time) if self._aT else s.reduced_time,
                            fitted_tensors(interpolation, s.C.T, *F).T) for s in variables.states)
        smallest_h = None if variables.smallest_h is None else fitted(variables.smallest_h)
        return StoredStates(variables.time, states, smallest_h)

    @cached_property
    def points(self) -> np.ndarray:
        """Reference positions of the locally owned quadrature points, shape (n, coordinates), length."""
        X = self._forms.X
        where = _compat.compile_expression(X, self._terms.places)
        found = where.eval(self._forms.domain, self._own) if len(self._own) else np.zeros(0)
        return found.reshape(-1, X.ufl_shape[0])

    def _indices_to_keep(self, states: list[PastState], C: np.ndarray, smallest_h: np.ndarray | None) -> list[int]:
        """Return the indices of the past states that cannot be interpolated from their neighbours; collective.

        The last of the K states is the present one. Cbar: (4, n); the bound `smallest_h` of damping: (K, n) or None.
        """
        if len(states) < 5:
            return list(range(len(states)))
        times, past = np.array([s.reduced_time for s in states]), np.array([s.C for s in states])
        inverse, h, _, _ = self._law.inverses_and_damping(C, past, smallest_h)
        W = self._law.weights_after(self._law.weights(times[-1] - times), 0.0)[0]
        g = h[:, None] * inverse                                            # h C_k^-1, shape (K, 4, n)
        times = times.reshape(len(states), -1)
        length = times[2:] - times[:-2]
        share = np.where(length > 0, (times[1:-1] - times[:-2]) / np.where(length > 0, length, 1), 0.0)[:, None]
        deviation = W[1:-1, None] * (g[1:-1] - (1 - share) * g[:-2] - share * g[2:])
        deviation, total = (deviator_squared(entries(C), entries(np.moveaxis(S, -2, 0)))
                      for S in (deviation, np.sum(W[:, None] * g, axis=0)))
        comm = self._forms.comm
        squares = comm.allreduce(np.array([*np.sum(deviation, axis=1), np.sum(total)]), MPI.SUM)
        jump = comm.allreduce(np.concatenate([[False], np.any(np.diff(times, axis=0) <= 0, axis=1)]).astype(int),
                              MPI.SUM)                                      # states at the ends of a jump are needed
        small = squares[:-1] < _DROPPED_STATE_ERROR**2 * squares[-1]
        chosen, left_out = [0], False
        for k in range(1, len(states) - 1):
            left_out = bool(k < len(states) - 2 and small[k - 1] and not left_out and not jump[k] and not jump[k + 1])
            if not left_out:
                chosen.append(k)
        return [*chosen, len(states) - 1]

    def _present(self) -> tuple[np.ndarray, Any, Any]:
        """Return the present Cbar = J^(-2/3) C, shape (4, n), reduced time since the last state, and its rate.

        The entries are 11, 22, 12, 33. Times are numbers, or have the shape (n,) if they depend on the temperature.
        """
        step: Any = self._forms.time_now - self._stored.time
        rate: Any = 1.0
        if not len(self._own):
            return np.zeros((4, 0)), step, rate
        domain = self._forms.domain
        if self._aT:
            rate = 1 / self._aT.eval(domain, self._own).ravel()
        return self._C.eval(domain, self._own).reshape(-1, 4).T.copy(), step * rate, rate

    @property
    def material(self) -> Any:
        """Material that these past states belong to."""
        return self._terms.material

    def smallest_stretch(self) -> tuple[float, np.ndarray]:
        """Return the smallest principal isochoric stretch and its reference position, (coordinates,); collective."""
        C = self._present()[0]
        half, apart = (C[0] + C[1]) / 2, np.hypot((C[0] - C[1]) / 2, C[2])
        squares = np.minimum(half - apart, C[3])
        k = int(np.argmin(squares)) if len(squares) else 0
        local = (float(squares[k]), self.points[k].tolist()) if len(squares) else (np.inf, [0.0, 0.0])
        square, point = min(self._forms.comm.allgather(local))
        return float(np.sqrt(square)), np.array(point)

    def save(self, variables: StoredStates) -> dict[str, Any]:
        """Return past states as plain data for `load`, the same on all ranks; collective."""
        numbers = gathered(self._forms.comm, self._numbers)
        order = np.argsort(numbers)

        def of_all(values: np.ndarray) -> np.ndarray:
            """Return values at the points of this rank, shape (..., n), for the cells of all ranks in original order.
            """
            each = values.reshape(-1, len(self._own), len(self._terms.places)).transpose(1, 0, 2)
            return gathered(self._forms.comm, each)[order]
        states = [{"reduced_time": of_all(s.reduced_time) if self._aT else s.reduced_time, "C": of_all(s.C)}
                  for s in variables.states]
        return {"time": variables.time, "cells": numbers[order], "states": states,
                **({} if variables.smallest_h is None else {"smallest_h": of_all(variables.smallest_h)})}

    def load(self, data: dict[str, Any]) -> StoredStates:
        """Return past states of this rank for `put` from data of `save`; another mesh or material is an InputError."""
        numbers = np.array(data.get("cells", []), dtype=np.int64)
        rows = np.minimum(np.searchsorted(numbers, self._numbers), len(numbers) - 1)
        found = [(np.array(s["reduced_time"], float), np.array(s["C"], float)) for s in data.get("states", [])]
        shape = len(numbers), 4, len(self._terms.places)
        if not np.array_equal(numbers[rows], self._numbers) or not found or any(
                C.shape != shape or (time.ndim > 0) != bool(self._aT) for time, C in found) \
                or ("smallest_h" in data) != self._law.irreversible:
            raise InputError(f"the history of {self._terms.material} belongs to another mesh, or to another material")

        def own(values: np.ndarray) -> np.ndarray:
            """Return the values of the cells of this rank, shape (..., n), from the values of all cells."""
            return values[rows].transpose(1, 0, 2).reshape(values.shape[1], -1)
        states = tuple(PastState(own(time)[0] if self._aT else float(time), own(C)) for time, C in found)
        smallest_h = own(np.array(data["smallest_h"], float)) if "smallest_h" in data else None
        return StoredStates(float(data["time"]), states, smallest_h)


