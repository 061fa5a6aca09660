"""The past states of a material whose stress is an integral over them, at the quadrature points of the energy."""

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
from ...forms.carry import Carrier, fitted_shapes, shapes_of
from ...forms.history import Start
from ...materials.tensors import IDENTITY, cofactor, deviator_squared, entries, inner, isochoric
from ...ranks import gathered

_NOTHING = 3e-7
"""Relative error of the present stress up to which interpolation between its neighbours replaces a past state.

In a fine run of a thousand states the errors add up to 3e-4 of the stress (with 3e-6 to 4e-3).
"""


class Past(NamedTuple):
    """A past state at n points of the cells of this rank.

    Attributes:
        felt: reduced time of the material until then, a number or shape (n,).
        C: entries of Cbar, shape (4, n).
    """

    felt: Any
    C: np.ndarray


class StoredStates(NamedTuple):
    """History variables of a material with past states.

    Attributes:
        time: process time of the last accepted state.
        states: the states up to it.
        least: smallest h of each state since then, shape (K, n), or None.
    """

    time: float
    states: tuple[Past, ...]
    least: np.ndarray | None


class PastStates:
    """History variables of a material with past states; `refresh` updates its coefficients in the forms.

    Args:
        forms: the `Formulation`.
        terms: the `MaterialTerms` of the material.
    """

    rate_dependent = True

    def __init__(self, forms: Any, terms: Any):
        self._forms, self._terms, self._law = forms, terms, terms.material.integral
        self._own = terms.own_cells
        self._numbers = forms.domain.topology.original_cell_index[self._own]
        self._n = len(self._own) * len(terms.places)

        def at_points(expression: Any) -> fem.Expression:
            return _compat.compile_expression(expression, terms.places)
        self._C = at_points(ufl.as_vector(isochoric(forms.elastic_F)))
        self._aT = at_points(ufl.as_vector([terms.constants["aT"]])) if self._law.shifted else None
        rows = {name: f.function_space.dofmap.list[self._own].ravel() for name, f in terms.past_integrals.items()}
        self._held = [(f.x.array.reshape(-1, int(np.prod(f.ufl_shape))), rows[name])
                      for name, f in terms.past_integrals.items()]
        self._seen: tuple[Any, Any] | None = None
        self.start()

    def start(self) -> None:
        """Store the undeformed state as the only past state."""
        rest = Past(np.zeros(self._n) if self._aT else 0.0, np.repeat(np.array(IDENTITY)[:, None], self._n, axis=1))
        self.put(StoredStates(0.0, (rest,), np.ones((1, self._n)) if self._law.irreversible else None))

    def forget_motion(self) -> None:
        """Reset the motion of the last step, so it predicts nothing of the next one."""
        self._before = 0.0
        self._seen = None

    def get(self) -> StoredStates:
        """Return the past states.

        Returns:
            The history variables.
        """
        return self._memory

    def put(self, memory: StoredStates) -> None:
        """Set the past states.

        Args:
            memory: the history variables.
        """
        self._memory, self._terms.start.value = memory, memory.time
        felt = np.array([state.felt for state in memory.states])
        self._past = np.array([state.C for state in memory.states])
        self._weights = self._law.weights(felt[-1] - felt)
        self._before = felt[-1] - felt[-2] if len(felt) > 1 else 0.0       # with C, how the body moves
        self._near = 1.0 if len(felt) < 2 else inner(self._past[-1], cofactor(self._past[-2])) < 4
        self._seen = None

    @np.errstate(over="ignore", invalid="ignore")                   # of a guess far back in time: no state
    def refresh(self) -> None:
        """Update the coefficients of the forms to their present fields and time."""
        C, step, rate = self._now()
        if self._seen and np.array_equal(self._seen[0], C) and np.array_equal(self._seen[1], step):
            return
        W, slope = self._law.after(self._weights, step, self._before, self._near)
        S, D, T = self._law.stress(C, self._past, W, slope, self._memory.least)
        count = np.array([1.0, 1.0, 2.0, 1.0])[:, None]
        T = T * rate
        S = count * (S - T * (self._forms.time_now - self._memory.time))
        for (array, rows), values in zip(self._held, (S, C, (count[:, None] * D).reshape(16, -1), count * T),
                                         strict=True):
            array[rows] = values.T
        self._seen = C, step

    def advance(self, x: np.ndarray, control: float, start: Start | None = None) -> None:
        """Add the state of the forms to the past states, and drop the states that are no longer needed.

        Args:
            x: unknowns of the state, locally owned entries.
            control: control of the state.
            start: state at the beginning of the step, or None.
        """
        (C, step, _), memory = self._now(), self._memory
        states, least = [*memory.states, Past(memory.states[-1].felt + step, C)], memory.least
        if least is not None:
            h = self._law.damped(C, self._past, least)[1]
            least = np.concatenate([h, np.ones((1, self._n))])
        time = self._forms.time_at(control)
        if time == memory.time and len(states) > 2 and np.array_equal(states[-2].felt, states[-3].felt):
            chosen = [*range(len(states) - 2), len(states) - 1]             # between two jumps at one instant
        else:
            chosen = self._needed(states, C, least)
        self.put(StoredStates(time, tuple(states[k] for k in chosen), least if least is None else least[chosen]))

    def carry(self, source: PastStates, memory: StoredStates, x: np.ndarray, control: float,
              mapping: Callable[[np.ndarray], np.ndarray]) -> StoredStates:
        """Interpolate the past states on another mesh; collective.

        Args:
            source: history on the other mesh.
            memory: its history variables.
            x: unknowns of this problem, locally owned entries.
            control: control of the state.
            mapping: function from reference points of the other mesh, shape (n, coordinates), to points of this mesh.

        Returns:
            The history variables on this mesh.
        """
        carrier = Carrier(self._forms.comm, mapping(source.points), self.points)
        F = [shapes_of(entry._forms, entry._own, entry._terms.places) for entry in (source, self)]

        def fitted(values: np.ndarray) -> np.ndarray:
            return carrier.fitted(values.T).T
        states = tuple(Past(fitted(s.felt) if self._aT else s.felt, fitted_shapes(carrier, s.C.T, *F).T)
                       for s in memory.states)
        return StoredStates(memory.time, states, None if memory.least is None else fitted(memory.least))

    @cached_property
    def points(self) -> np.ndarray:
        """Reference positions of the owned quadrature points, shape (n, coordinates), length."""
        X = self._forms.X
        where = _compat.compile_expression(X, self._terms.places)
        found = where.eval(self._forms.domain, self._own) if len(self._own) else np.zeros(0)
        return found.reshape(-1, X.ufl_shape[0])

    def _needed(self, states: list[Past], C: np.ndarray, least: np.ndarray | None) -> list[int]:
        """Return the numbers of the states without which the stress at C would change; collective."""
        if len(states) < 5:
            return list(range(len(states)))
        felt, past = np.array([s.felt for s in states]), np.array([s.C for s in states])
        inverse, h, _, _ = self._law.damped(C, past, least)
        W = self._law.after(self._law.weights(felt[-1] - felt), 0.0)[0]
        g = h[:, None] * inverse                                            # of the stress of a state, (K, 4, n)
        felt = felt.reshape(len(states), -1)
        length = felt[2:] - felt[:-2]
        share = np.where(length > 0, (felt[1:-1] - felt[:-2]) / np.where(length > 0, length, 1), 0.0)[:, None]
        deviation = W[1:-1, None] * (g[1:-1] - (1 - share) * g[:-2] - share * g[2:])
        deviation, total = (deviator_squared(entries(C), entries(np.moveaxis(S, -2, 0)))
                      for S in (deviation, np.sum(W[:, None] * g, axis=0)))
        comm = self._forms.comm
        squares = comm.allreduce(np.array([*np.sum(deviation, axis=1), np.sum(total)]), MPI.SUM)
        jump = comm.allreduce(np.concatenate([[False], np.any(np.diff(felt, axis=0) <= 0, axis=1)]).astype(int),
                              MPI.SUM)                                      # a state that begins or ends one is needed
        small = squares[:-1] < _NOTHING**2 * squares[-1]
        chosen, left_out = [0], False
        for k in range(1, len(states) - 1):
            left_out = bool(k < len(states) - 2 and small[k - 1] and not left_out and not jump[k] and not jump[k + 1])
            if not left_out:
                chosen.append(k)
        return [*chosen, len(states) - 1]

    def _now(self) -> tuple[np.ndarray, Any, Any]:
        """Return (Cbar, reduced time since the last state, reduced time per time)."""
        step: Any = self._forms.time_now - self._memory.time
        rate: Any = 1.0
        if not len(self._own):
            return np.zeros((4, 0)), step, rate
        domain = self._forms.domain
        if self._aT:
            rate = 1 / self._aT.eval(domain, self._own).ravel()
        return self._C.eval(domain, self._own).reshape(-1, 4).T.copy(), step * rate, rate

    @property
    def material(self) -> Any:
        """The `Material`."""
        return self._terms.material

    def thinnest(self) -> tuple[float, np.ndarray]:
        """Return the smallest stretch of the current fields; collective.

        Returns:
            The stretch and its reference position, length.
        """
        C = self._now()[0]
        half, apart = (C[0] + C[1]) / 2, np.hypot((C[0] - C[1]) / 2, C[2])
        least = np.minimum(half - apart, C[3])
        k = int(np.argmin(least)) if len(least) else 0
        mine = (float(least[k]), self.points[k].tolist()) if len(least) else (np.inf, [0.0, 0.0])
        square, point = min(self._forms.comm.allgather(mine))
        return float(np.sqrt(square)), np.array(point)

    def save(self, memory: StoredStates) -> dict[str, Any]:
        """Return past states as plain data, the same on all ranks; collective.

        Args:
            memory: the history variables.

        Returns:
            The data.
        """
        numbers = gathered(self._forms.comm, self._numbers)
        order = np.argsort(numbers)

        def of_all(values: np.ndarray) -> np.ndarray:
            each = values.reshape(-1, len(self._own), len(self._terms.places)).transpose(1, 0, 2)
            return gathered(self._forms.comm, each)[order]
        states = [{"felt": of_all(s.felt) if self._aT else s.felt, "C": of_all(s.C)} for s in memory.states]
        return {"time": memory.time, "cells": numbers[order], "states": states,
                **({} if memory.least is None else {"least": of_all(memory.least)})}

    def load(self, data: dict[str, Any]) -> StoredStates:
        """Return the past states of this rank from the result of `save`.

        Args:
            data: result of `save`.

        Returns:
            The history variables.

        Raises:
            InputError: the data belong to another mesh or another material.
        """
        numbers = np.array(data.get("cells", []), dtype=np.int64)
        rows = np.minimum(np.searchsorted(numbers, self._numbers), len(numbers) - 1)
        found = [(np.array(s["felt"], float), np.array(s["C"], float)) for s in data.get("states", [])]
        shape = len(numbers), 4, len(self._terms.places)
        if not np.array_equal(numbers[rows], self._numbers) or not found or any(
                C.shape != shape or (felt.ndim > 0) != bool(self._aT) for felt, C in found) \
                or ("least" in data) != self._law.irreversible:
            raise InputError(f"the history of {self._terms.material} belongs to another mesh, or to another material")

        def own(values: np.ndarray) -> np.ndarray:
            return values[rows].transpose(1, 0, 2).reshape(values.shape[1], -1)
        states = tuple(Past(own(felt)[0] if self._aT else float(felt), own(C)) for felt, C in found)
        least = own(np.array(data["least"], float)) if "least" in data else None
        return StoredStates(float(data["time"]), states, least)


