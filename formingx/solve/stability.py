"""Modes in which a state is not stable: how many there are (inertia), which (shift-invert), and where they begin.

The second variation K of a saddle point, with pressures and Lagrange multipliers, has one negative pivot for each of
these in K = L D L^T, and one more for each unstable mode (Sylvester's law of inertia).
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from ..discrete.second_variation import SecondVariation
from .linear import DirectSolver
from .newton import Failure
from .state import State

_STEPS, _ACCURATE = 80, 1e-10
"""Of Lanczos' method: steps at most, and its error, relative."""

_EVALUATIONS, _LOCATED = 14, 1e-8
"""Of locating a loss: states solved for at most, and its error, in parts of the step that it lies in."""

_ASTRAY = 0.1
"""How far from the cubic between two states, in parts of their distance, a state between them may be."""


class Kind(NamedTuple):
    """Modes with so many waves round the axis (in plane strain the wave number); flipped: see `SecondVariation`."""

    number: float
    flipped: str | None = None


class Located(NamedTuple):
    """Where a mode begins, or ceases, to be unstable.

    kind: of the mode; left, right: the states before and behind; state: there; mode: amplitudes (U, W, V) at `nodes` of
    the second variation, own part; x: its U and W as unknowns of the problem, own part; gained: True if the body is
    less stable behind; solved: True if `state` was solved for, else it lies on the cubic between left and right.
    """

    kind: Kind
    left: State
    right: State
    state: State
    mode: np.ndarray
    x: np.ndarray
    gained: bool
    solved: bool


class Modes:
    """The unstable modes of the states of a problem; created once.

    Args:
        curve: the `Curve` that solves for states.

    Raises:
        InputError: as `SecondVariation`.
    """

    def __init__(self, curve: Any):
        self.curve, self.problem = curve, curve.problem
        self.variation = SecondVariation(curve.problem)
        self._solver = DirectSolver(self.variation.matrix, True, inertia=True)
        self._in, self._out = self.variation.matrix.createVecs()

    def count(self, state: State, kind: Kind) -> int:
        """The number of unstable modes of a kind."""
        with self.problem.at(state):
            return self._count(kind)

    def _count(self, kind: Kind) -> int:
        self.variation.fill(*kind)
        if not self._solver.factorise():
            raise Failure("the second variation is singular: something in the body has no stiffness at all", [])
        return self._solver.negative_pivots() - self.variation.negative

    def nearest(self, state: State, kind: Kind, number: int = 4) -> tuple[int, np.ndarray, np.ndarray]:
        """(count, eigenvalues ascending, modes (eigenvalues, own unknowns)): of those nearest to 0, dimensionless."""
        with self.problem.at(state):
            return self._count(kind), *self._lanczos(number)

    def locate(self, a: State, b: State, kind: Kind, index: int) -> Located:
        """Where between two states the eigenvalue with so many below it changes its sign."""
        found: list[tuple[float, float, State, np.ndarray]] = []       # fraction, eigenvalue, state, mode
        solved = True

        def look(fraction: float, state: State) -> float:
            count, values, modes = self.nearest(state, kind, abs(counts[1] - counts[0]) + 3)
            below, above = np.flatnonzero(values < 0)[::-1], np.flatnonzero(values >= 0)
            side, k = (below, count - index - 1) if count > index else (above, index - count)
            if k >= len(side):
                found.append((fraction, np.nan, state, modes[0]))
                return 1.0 if count <= index else -1.0
            found.append((fraction, values[side[k]], state, modes[side[k]]))
            return 1.0 if count <= index else -1.0
        counts = [self.count(s, kind) for s in (a, b)]
        signs = [look(0.0, a), look(1.0, b)]
        low, high = 0.0, 1.0
        while len(found) < _EVALUATIONS:
            guess = self._crossing(found, low, high)
            if min(abs(guess - f) for f, *_ in found) < _LOCATED:
                break
            try:
                state = self._between(a, b, guess)
            except Failure:
                solved = False
                break
            low, high = (guess, high) if look(guess, state) == signs[0] else (low, guess)
        fraction = self._crossing(found, low, high)
        nearest = min(found, key=lambda one: abs(one[0] - fraction))
        state = nearest[2]
        solved = solved and abs(nearest[0] - fraction) < 1e-3 and 0 < nearest[0] < 1
        if abs(nearest[0] - fraction) >= _LOCATED:
            x, control = self.curve.interpolate(a, b, fraction)
            state = State(x, control, a.direction, a.slope, memory=a.memory, stage=a.stage, setting=a.setting,
                          time=self.problem.time_at(control))
        with self.problem.at(nearest[2]):
            self.variation.fill(*kind)
            mode, plane = self.variation.amplitudes(nearest[3]), self.variation.plane(nearest[3])
        return Located(kind, a, b, state, mode, plane, counts[1] > counts[0], solved)

    def _crossing(self, found: list, low: float, high: float) -> float:
        """Where a polynomial through the eigenvalues nearest to 0 has its root: between low and high."""
        known = sorted((one for one in found if np.isfinite(one[1])), key=lambda one: abs(one[1]))[:4]
        for n in range(len(known), 1, -1):
            s, f = (np.array([one[k] for one in known[:n]]) for k in (0, 1))
            if len(np.unique(f)) == n:
                guess = sum(s[i] * np.prod([f[j] / (f[j] - f[i]) for j in range(n) if j != i]) for i in range(n))
                if low < guess < high:
                    return float(guess)
        return (low + high) / 2

    def _between(self, a: State, b: State, fraction: float) -> State:
        """The state there, solved for; raises `Failure`."""
        if self.problem.has_history:
            raise Failure("what lies between two states depends on how it is come to", [])
        with self.problem.at(a):
            state = self.curve.inside(a, b, fraction)
        self.curve.spent()
        state.stage, state.setting, state.memory = a.stage, a.setting, a.memory
        x, control = self.curve.interpolate(a, b, fraction)
        guess = State(x, control, a.direction, a.slope)
        if self.curve.distance(guess, state) > _ASTRAY * self.curve.distance(a, b):
            raise Failure("the state that was found lies on another branch", [])
        return state

    def _lanczos(self, number: int) -> tuple[np.ndarray, np.ndarray]:
        """Eigenvalues nearest to 0 of K x = value M x, and modes; all vectors are kept orthogonal to each other.

        M is the lumped mass, which is 0 for pressures: so all begin in the range of K^-1 M. Rigid motions are left out.
        """
        variation = self.variation
        out: list[np.ndarray] = []
        for mode in variation.rigid:
            out.append(self._normal(self._clean(mode, out)))
        rng = np.random.default_rng(0)
        first = self._in.getOwnershipRange()
        start = rng.standard_normal(self._in.getSize())[first[0]: first[1]]
        basis = [self._normal(self._clean(self._invert(start), out))]
        alpha: list[float] = []
        beta: list[float] = []
        while True:
            w = self._invert(basis[-1])
            alpha.append(self._inner(w, basis[-1]))
            w = self._clean(self._clean(w, out + basis), out + basis)
            size = np.sqrt(max(self._inner(w, w), 0.0))
            T = np.diag(alpha) + np.diag(beta, 1) + np.diag(beta, -1)
            theta, ways = np.linalg.eigh(T)
            best = np.argsort(-abs(theta))[:number]
            rest = size * abs(ways[-1, best])
            if len(alpha) >= number and np.all(rest < _ACCURATE * abs(theta[best])) or len(alpha) == _STEPS \
                    or size < 1e-14 * abs(theta).max():
                break
            beta.append(size)
            basis.append(w / size)
        best = best[np.argsort(1 / theta[best])]
        modes = ways[:, best].T @ np.array(basis)
        return 1 / theta[best], modes

    def _invert(self, x: np.ndarray) -> np.ndarray:
        """K^-1 M x."""
        self._in.array_w[:] = self.variation.mass(x)
        self._solver.solve(self._in, self._out)
        return self._out.array_r.copy()

    def _inner(self, x: np.ndarray, y: np.ndarray) -> float:
        return float(self.problem.comm.allreduce(float(x @ self.variation.mass(y))))

    def _normal(self, x: np.ndarray) -> np.ndarray:
        return x / np.sqrt(self._inner(x, x))

    def _clean(self, x: np.ndarray, others: list[np.ndarray]) -> np.ndarray:
        """x without its parts along others, which are normal to each other."""
        if not others:
            return x
        basis = np.array(others)
        parts = self.problem.comm.allreduce(basis @ self.variation.mass(x))
        return x - parts @ basis

    def destroy(self) -> None:
        """Free the PETSc objects (collective)."""
        self._solver.destroy()
        self._in.destroy()
        self._out.destroy()
        self.variation.destroy()
