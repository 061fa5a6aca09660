"""Unstable modes of a state: their number (inertia), their shapes (inverse iteration), and their critical points.

The second variation K of a mixed formulation is a saddle-point matrix with pressures and Lagrange multipliers. By
Sylvester's law of inertia its factors K = L D L^T have one negative pivot for each of these, and one for each unstable
mode.
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
class LanczosSettings:
    """Settings of the Lanczos method, which computes modes with the inverse of the second variation K.

    Attributes:
        steps: maximum number of steps, each a solve with the stored LU factors.
        tolerance: relative error of an eigenvalue at which the iteration ends.
        round_off: norm of a new Lanczos vector after orthogonalisation, over the largest eigenvalue of K^-1 M
            with the lumped mass matrix M. A smaller vector is round-off: all modes have been found.
    """

    steps: int = 80
    tolerance: float = 1e-10
    round_off: float = 1e-14


@dataclass(frozen=True)
class LocationSettings:
    """Settings for the location of a critical point between two states.

    Attributes:
        states: maximum number of states to solve for.
        tolerance: tolerance of the position of the point, relative to the distance of the two states.
        offset: distance on either side of the point at which the number of unstable modes is counted, relative to the
            distance of the two states.
        patience: number of steps in which the bracket is not halved, after which it is bisected.
        min_overlap: scalar product of two normalised modes above which they are the same mode.
        max_deviation: largest distance of a state from the cubic between the two states, over their distance. A state
            further away lies on another branch.
    """

    states: int = 60
    tolerance: float = 1e-8
    offset: float = 1e-6
    patience: int = 3
    min_overlap: float = 0.7
    max_deviation: float = 0.1


class ModeClass(NamedTuple):
    """Wave number and symmetry of a class of modes.

    Attributes:
        number: circumferential wave number n; in plane strain the wave number k along the depth, 1/length.
        antisymmetric_about: name of the symmetry plane about which the modes are antisymmetric, or None.
    """

    number: float
    antisymmetric_about: str | None = None


class LocatedPoint(NamedTuple):
    """Critical point between two states, at which a mode becomes unstable or stable again.

    Attributes:
        kind: wave number and symmetry of the mode.
        left: state before the point.
        right: state behind the point.
        state: state at the point.
        fraction: position of the point between `left` (0) and `right` (1).
        mode: amplitudes (U, W, V) at the `nodes` of the `SecondVariation`, locally owned entries, shape (m, 3).
        x: U, W and pressures of the mode as unknowns of the problem, locally owned entries.
        becomes_unstable: True if the mode is unstable behind the point.
        solved: True if `state` is a converged solution, False if it lies on the cubic between `left` and `right`.
    """

    kind: ModeClass
    left: State
    right: State
    state: State
    fraction: float
    mode: Array
    x: Array
    becomes_unstable: bool
    solved: bool


class _ModesOfState(NamedTuple):
    """Number of unstable modes of a state, and its modes with eigenvalues nearest to 0.

    Attributes:
        fraction: position of the state between the two states that enclose a critical point, from 0 to 1.
        state: the state.
        unstable: number of unstable modes.
        values: k eigenvalues of the second variation nearest to 0, ascending, shape (k,), dimensionless.
        modes: modes of these eigenvalues, locally owned entries, shape (k, n).
    """

    fraction: float
    state: State
    unstable: int
    values: Array
    modes: Array


class Modes:
    """Modes of the second variation in the states of a problem: their number, and critical points between two states.

    A membrane, an elastic support, or a load without a second variation is an InputError.

    Attributes:
        curve: the `Curve`.
        problem: the `Problem`.
        variation: the `SecondVariation` of the problem.
    """

    def __init__(self, curve: Curve, lanczos: LanczosSettings | None = None, locating: LocationSettings | None = None):
        self.curve, self.problem = curve, curve.problem
        self._settings, self._locating = lanczos or LanczosSettings(), locating or LocationSettings()
        self.variation = SecondVariation(curve.problem)
        self._solver = DirectSolver(self.variation.matrix, True, inertia=True)
        self._in, self._out = self.variation.matrix.createVecs()

    def count(self, state: State, kind: ModeClass) -> int:
        """Return the number of unstable modes with a wave number and symmetry in a state of the path."""
        with self.problem.state_context(state):
            return self._count(kind)

    def _count(self, kind: ModeClass) -> int:
        """Return the number of unstable modes at the present state; `Failure` if the second variation is singular."""
        self.variation.fill(*kind)
        if not self._solver.factorise():
            raise Failure("the stiffness is singular for every mode: some part of the body has no stiffness", [])
        return self._solver.negative_pivots() - self.variation.negative_pivots

    def locate(self, a: State, b: State, kind: ModeClass, index: int) -> LocatedPoint:
        """Locate the critical point between states a and b at which eigenvalue number `index` (ascending) is 0.

        Counts of unstable modes bracket it; inside, the eigenvalues of one mode, tracked by its shape, predict it.
        """
        samples = [self._modes_of(0.0, a, kind, index), self._modes_of(1.0, b, kind, index)]
        (low, high), settings = samples, self._locating
        becomes_unstable, solved, slow = high.unstable > low.unstable, True, 0
        while True:
            values = self._track(samples, high if becomes_unstable else low, index)
            guess = _root(values, low.fraction, high.fraction) if slow < settings.patience else None
            fraction, slow = ((low.fraction + high.fraction) / 2, 0) if guess is None else (guess, slow)
            nearest = min(samples, key=lambda sample: abs(sample.fraction - fraction))
            width = high.fraction - low.fraction
            if width < 2 * settings.offset or len(samples) == settings.states:
                break
            if abs(nearest.fraction - fraction) < settings.tolerance:     # the root may belong to another mode
                fraction = low.fraction + settings.offset if nearest is low else high.fraction - settings.offset
            try:
                samples.append(new := self._modes_of(fraction, self._state_between(a, b, fraction), kind, index))
            except Failure:
                solved = False
                break
            low, high = (low, new) if (new.unstable > index) is becomes_unstable else (new, high)
            slow = 0 if high.fraction - low.fraction < width / 2 else slow + 1
        state, exact = nearest.state, width < 2 * settings.offset
        if exact:
            fraction = nearest.fraction
        else:
            x, control = self.curve.interpolate(a, b, fraction)
            state = State(x, control, a.direction, a.slope, history_variables=a.history_variables, stage=a.stage,
                          setting=a.setting, time=self.problem.history.time_at(control))
        with self.problem.state_context(nearest.state):
            self.variation.fill(*kind)
            x = nearest.modes[np.argmin(abs(nearest.values))] if exact else self._mode_of_index(nearest, index)
            mode, unknowns = self.variation.amplitudes(x), self.variation.problem_unknowns(x)
        return LocatedPoint(kind, a, b, state, fraction, mode, unknowns, becomes_unstable, solved and exact)

    def _modes_of(self, fraction: float, state: State, kind: ModeClass, index: int) -> _ModesOfState:
        """Return count and modes with eigenvalues nearest to 0, number `index` included, at `fraction` (0 to 1)."""
        with self.problem.state_context(state):
            count = self._count(kind)
            return _ModesOfState(fraction, state, count, *self._lanczos(4 + abs(count - index)))

    def _mode_of_index(self, sample: _ModesOfState, index: int) -> Array:
        """Return the mode of ascending eigenvalue number `index`, or of the nearest known number."""
        negative = np.flatnonzero(sample.values < 0)
        k = (negative[-1] + 1 if len(negative) else 0) + index - sample.unstable
        return sample.modes[min(max(k, 0), len(sample.modes) - 1)]

    def _track(self, samples: list[_ModesOfState], end: _ModesOfState, index: int) -> list[tuple[float, float]]:
        """Return (fraction, eigenvalue) of one mode in the samples in which it is found by its shape.

        The mode has number `index` in the state `end`, in which it is unstable; fractions are positions from 0 to 1.
        """
        mode, found = self._mode_of_index(end, index), []
        for sample in samples:
            overlaps = [abs(self._inner(mode, other)) for other in sample.modes]
            if max(overlaps) > self._locating.min_overlap:
                found.append((sample.fraction, float(sample.values[np.argmax(overlaps)])))
        return found

    def _state_between(self, a: State, b: State, fraction: float) -> State:
        """Solve for the state at a fraction, 0 to 1, from state a to b; no convergence there is a `Failure`."""
        if self.problem.history.path_dependent:
            raise Failure("with a history the state between two others depends on the steps", [])
        with self.problem.state_context(a):
            state = self.curve.state_at_fraction(a, b, fraction)
        self.curve.spent()
        state.stage, state.setting, state.history_variables = a.stage, a.setting, a.history_variables
        x, control = self.curve.interpolate(a, b, fraction)
        guess = State(x, control, a.direction, a.slope)
        if self.curve.distance(guess, state) > self._locating.max_deviation * self.curve.distance(a, b):
            raise Failure("the state that was found lies on another branch", [])
        return state

    def _lanczos(self, number: int) -> tuple[Array, Array]:
        """Return the eigenvalues of K x = value M x nearest to 0, ascending, and their modes, shape (number, n).

        K is the second variation, M the lumped mass, which is 0 for pressures, so all vectors lie in the range of K^-1
        M. Rigid motions are removed, and vectors are orthogonalised fully.
        """
        variation = self.variation
        removed: list[Array] = []
        for mode in variation.rigid_motions:
            removed.append(self._normalised(self._orthogonalised(mode, removed)))
        rng = np.random.default_rng(0)
        first = self._in.getOwnershipRange()
        start = rng.standard_normal(self._in.getSize())[first[0]: first[1]]
        basis = [self._normalised(self._orthogonalised(self._solve(start), removed))]
        alpha: list[float] = []
        beta: list[float] = []
        while True:
            w = self._solve(basis[-1])
            alpha.append(self._inner(w, basis[-1]))
            w = self._orthogonalised(self._orthogonalised(w, removed + basis), removed + basis)
            size = np.sqrt(max(self._inner(w, w), 0.0))
            T = np.diag(alpha) + np.diag(beta, 1) + np.diag(beta, -1)
            theta, vectors = np.linalg.eigh(T)
            best = np.argsort(-abs(theta))[:number]
            residuals = size * abs(vectors[-1, best])
            converged = len(alpha) >= number and np.all(residuals < self._settings.tolerance * abs(theta[best]))
            if converged or len(alpha) == self._settings.steps or size < self._settings.round_off * abs(theta).max():
                break
            beta.append(size)
            basis.append(w / size)
        best = best[np.argsort(1 / theta[best])]
        modes = vectors[:, best].T @ np.array(basis)
        return 1 / theta[best], modes

    def _solve(self, x: Array) -> Array:
        """Return K^-1 M x for the second variation K and the lumped mass M, locally owned entries."""
        self._in.array_w[:] = self.variation.mass(x)
        self._solver.solve(self._in, self._out)
        return self._out.array_r.copy()

    def _inner(self, x: Array, y: Array) -> float:
        """Return the scalar product x M y of two modes with the lumped mass M, over all ranks."""
        return float(self.problem.comm.allreduce(float(x @ self.variation.mass(y))))

    def _normalised(self, x: Array) -> Array:
        """Return a mode x scaled to x M x = 1 with the lumped mass M."""
        return x / np.sqrt(self._inner(x, x))

    def _orthogonalised(self, x: Array, others: list[Array]) -> Array:
        """Return a mode x without its components along `others`, modes that are orthonormal in the lumped mass."""
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
    """Return the fraction of zero eigenvalue by inverse interpolation of the four smallest pairs; None outside."""
    known = sorted(values, key=lambda entry: abs(entry[1]))[:4]
    for n in range(len(known), 1, -1):
        s, f = (np.array([entry[k] for entry in known[:n]]) for k in (0, 1))
        if len(np.unique(f)) == n:
            guess = sum(s[i] * np.prod([f[j] / (f[j] - f[i]) for j in range(n) if j != i]) for i in range(n))
            if low < guess < high:
                return float(guess)
    return None
