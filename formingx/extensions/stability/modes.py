"""Unstable modes of a state: their number (inertia), their shapes (inverse iteration), and their critical points.

The second variation K of a mixed formulation, with pressures and Lagrange multipliers, is a saddle-point matrix. K = L
D L^T has one negative pivot for each of them, and one more for each unstable mode (Sylvester's law of inertia).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from ...solve.arc_length import Curve
from ...solve.equations import Array
from ...solve.linear import DirectSolver
from ...solve.newton import Failure
from ...solve.state import State
from .second_variation import SecondVariation


@dataclass(frozen=True)
class Lanczos:
    """Settings of the Lanczos method with the inverse of K, which computes the modes.

    Attributes:
        steps: maximum number of steps, each a solve with the stored LU factors.
        accurate: relative error of an eigenvalue at which the iteration ends.
        exhausted: norm of the remainder of a new vector, over the largest eigenvalue of the inverse, that is round-off.
            Then all modes are found.
        steps: maximum number of steps, each a solve with the stored LU factors.
    """

    steps: int = 80
    accurate: float = 1e-10
    exhausted: float = 1e-14


@dataclass(frozen=True)
class Locating:
    """Settings for the location of a critical point between two states.

    Attributes:
        states: maximum number of states to solve for.
        located: tolerance of its position, relative to the distance of the two states.
        beside: distance on either side at which counts of unstable modes verify it, relative to the same distance.
        patience: number of steps without halving of the bracket after which it is bisected.
        alike: scalar product of two normalised modes above which they are the same mode.
        astray: largest distance of a state from the cubic between the two states, over their distance. A state further
            away lies on another branch.
    """

    states: int = 60
    located: float = 1e-8
    beside: float = 1e-6
    patience: int = 3
    alike: float = 0.7
    astray: float = 0.1


class Kind(NamedTuple):
    """Wave number and symmetry of a class of modes.

    Attributes:
        number: circumferential wave number; in plane strain the wave number along the depth.
        flipped: name of the symmetry plane under which the modes are antisymmetric, or None (see `SecondVariation`).
    """

    number: float
    flipped: str | None = None


class Located(NamedTuple):
    """Critical point at which a mode becomes unstable, or stable again.

    Attributes:
        kind: wave number and symmetry of the mode.
        left: state before the point.
        right: state behind the point.
        state: state at the point.
        fraction: position between left (0) and right (1).
        mode: amplitudes (U, W, V) at `nodes` of the second variation, locally owned entries.
        x: U and W of the mode as unknowns of the problem, locally owned entries.
        gained: True if the body is less stable behind the point.
        solved: True if `state` is a converged solution, False if it lies on the cubic between left and right.
    """

    kind: Kind
    left: State
    right: State
    state: State
    fraction: float
    mode: Array
    x: Array
    gained: bool
    solved: bool


class _Look(NamedTuple):
    """Number of unstable modes and the modes nearest to zero in a state between two others.

    Attributes:
        fraction: position between the two states, from 0 to 1.
        state: a `State` of the path.
        unstable: number of unstable modes.
        values: eigenvalues nearest to 0, ascending, dimensionless.
        modes: their modes, locally owned entries.
    """

    fraction: float
    state: State
    unstable: int
    values: Array
    modes: Array


class Modes:
    """Unstable modes of the states of a problem; created once.

    Args:
        curve: the `Curve` that solves for states.
        lanczos: settings of the eigenvalue solver.
        locating: settings for critical points.

    Raises:
        InputError: as `SecondVariation`.
    """

    def __init__(self, curve: Curve, lanczos: Lanczos | None = None, locating: Locating | None = None):
        self.curve, self.problem = curve, curve.problem
        self._by, self._how = lanczos or Lanczos(), locating or Locating()
        self.variation = SecondVariation(curve.problem)
        self._solver = DirectSolver(self.variation.matrix, True, inertia=True)
        self._in, self._out = self.variation.matrix.createVecs()

    def count(self, state: State, kind: Kind) -> int:
        """Return the number of unstable modes with a wave number and symmetry.

        Args:
            state: a `State` of the path.
            kind: wave number and symmetry.

        Returns:
            Number of unstable modes.
        """
        with self.problem.state_context(state):
            return self._count(kind)

    def _count(self, kind: Kind) -> int:
        """Return the number of unstable modes at the state last set."""
        self.variation.fill(*kind)
        if not self._solver.factorise():
            raise Failure("the stiffness is singular for every mode: some part of the body has no stiffness", [])
        return self._solver.negative_pivots() - self.variation.negative

    def locate(self, a: State, b: State, kind: Kind, index: int) -> Located:
        """Locate the zero of the eigenvalue number `index` (in ascending order) between two states.

        Counts of unstable modes bracket it. Inside the bracket it is predicted from the eigenvalues of one mode. The
        mode is tracked by its shape, because eigenvalues of other modes cross it.

        Args:
            a: state before the zero.
            b: state behind it.
            kind: wave number and symmetry.
            index: number of the eigenvalue.

        Returns:
            The critical point.
        """
        looks = [self._look(0.0, a, kind, index), self._look(1.0, b, kind, index)]
        (low, high), how = looks, self._how
        gained, solved, shrunk = high.unstable > low.unstable, True, 0
        while True:
            values = self._follow(looks, high if gained else low, index)
            guess = _root(values, low.fraction, high.fraction) if shrunk < how.patience else None
            fraction, shrunk = ((low.fraction + high.fraction) / 2, 0) if guess is None else (guess, shrunk)
            nearest = min(looks, key=lambda look: abs(look.fraction - fraction))
            width = high.fraction - low.fraction
            if width < 2 * how.beside or len(looks) == how.states:
                break
            if abs(nearest.fraction - fraction) < how.located:     # the root may belong to another mode
                fraction = low.fraction + how.beside if nearest is low else high.fraction - how.beside
            try:
                looks.append(new := self._look(fraction, self._between(a, b, fraction), kind, index))
            except Failure:
                solved = False
                break
            low, high = (low, new) if (new.unstable > index) is gained else (new, high)
            shrunk = 0 if high.fraction - low.fraction < width / 2 else shrunk + 1
        state, exact = nearest.state, width < 2 * how.beside
        if exact:
            fraction = nearest.fraction
        else:
            x, control = self.curve.interpolate(a, b, fraction)
            state = State(x, control, a.direction, a.slope, memory=a.memory, stage=a.stage, setting=a.setting,
                          time=self.problem.time_at(control))
        with self.problem.state_context(nearest.state):
            self.variation.fill(*kind)
            x = nearest.modes[np.argmin(abs(nearest.values))] if exact else self._of_index(nearest, index)
            mode, plane = self.variation.amplitudes(x), self.variation.plane(x)
        return Located(kind, a, b, state, fraction, mode, plane, gained, solved and exact)

    def _look(self, fraction: float, state: State, kind: Kind, index: int) -> _Look:
        """Return the number of unstable modes and the modes nearest to zero in a state."""
        with self.problem.state_context(state):
            count = self._count(kind)
            return _Look(fraction, state, count, *self._lanczos(4 + abs(count - index)))

    def _of_index(self, look: _Look, index: int) -> Array:
        """Return the mode with a given number of lower eigenvalues, or the nearest known one."""
        negative = np.flatnonzero(look.values < 0)
        k = (negative[-1] + 1 if len(negative) else 0) + index - look.unstable
        return look.modes[min(max(k, 0), len(look.modes) - 1)]

    def _follow(self, looks: list[_Look], end: _Look, index: int) -> list[tuple[float, float]]:
        """Track the mode that is unstable at an end of the bracket; return its (fraction, eigenvalue) pairs."""
        mode, found = self._of_index(end, index), []
        for look in looks:
            alike = [abs(self._inner(mode, other)) for other in look.modes]
            if max(alike) > self._how.alike:
                found.append((look.fraction, float(look.values[np.argmax(alike)])))
        return found

    def _between(self, a: State, b: State, fraction: float) -> State:
        """Solve for the state at a fraction between two states.

        Raises:
            Failure: no convergence, or convergence to another branch.
        """
        if self.problem.has_history:
            raise Failure("with a history the state between two others depends on the steps", [])
        with self.problem.state_context(a):
            state = self.curve.inside(a, b, fraction)
        self.curve.spent()
        state.stage, state.setting, state.memory = a.stage, a.setting, a.memory
        x, control = self.curve.interpolate(a, b, fraction)
        guess = State(x, control, a.direction, a.slope)
        if self.curve.distance(guess, state) > self._how.astray * self.curve.distance(a, b):
            raise Failure("the state that was found lies on another branch", [])
        return state

    def _lanczos(self, number: int) -> tuple[Array, Array]:
        """Return the eigenvalues nearest to 0 of K x = value M x, and their modes, by full reorthogonalisation.

        M is the lumped mass, which is 0 for pressures. So all vectors lie in the range of K^-1 M.
        Rigid motions are removed.
        """
        variation = self.variation
        out: list[Array] = []
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
            accurate = len(alpha) >= number and np.all(rest < self._by.accurate * abs(theta[best]))
            if accurate or len(alpha) == self._by.steps or size < self._by.exhausted * abs(theta).max():
                break
            beta.append(size)
            basis.append(w / size)
        best = best[np.argsort(1 / theta[best])]
        modes = ways[:, best].T @ np.array(basis)
        return 1 / theta[best], modes

    def _invert(self, x: Array) -> Array:
        """Return K^-1 M x."""
        self._in.array_w[:] = self.variation.mass(x)
        self._solver.solve(self._in, self._out)
        return self._out.array_r.copy()

    def _inner(self, x: Array, y: Array) -> float:
        """Return the inner product of two modes with the lumped mass, all ranks."""
        return float(self.problem.comm.allreduce(float(x @ self.variation.mass(y))))

    def _normal(self, x: Array) -> Array:
        """Return a mode normalised to unit inner product."""
        return x / np.sqrt(self._inner(x, x))

    def _clean(self, x: Array, others: list[Array]) -> Array:
        """Return x without its components along other vectors, which are orthogonal to each other."""
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


def _root(values: list[tuple[float, float]], low: float, high: float) -> float | None:
    """Return the root of the polynomial (fraction over eigenvalue) through the values nearest to 0, if inside."""
    known = sorted(values, key=lambda entry: abs(entry[1]))[:4]
    for n in range(len(known), 1, -1):
        s, f = (np.array([entry[k] for entry in known[:n]]) for k in (0, 1))
        if len(np.unique(f)) == n:
            guess = sum(s[i] * np.prod([f[j] / (f[j] - f[i]) for j in range(n) if j != i]) for i in range(n))
            if low < guess < high:
                return float(guess)
    return None
