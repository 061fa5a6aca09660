"""A run of a design, and the derivatives of its results by all parameters."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path as FilePath
from typing import Any

import numpy as np
from mpi4py import MPI

from ...errors import InputError
from ...results.evaluate.profile import Profile, Profiles
from ...results.path import Path
from ...solve.arc_length import Curve
from ...solve.newton import Failure, Tolerances
from ...solve.record import Record
from ...units import NONE, Units
from . import scatter
from .carry import carry
from .neighbours import PerturbedRun, PerturbedRunFailure
from .parameters import Parameters
from .scatter import Band

_SMOOTH = 1e-5
"""Relative change of a parameter without contact: one perturbed run above, one below."""

_CLOSER = (1e-8, 1e-9, 1e-10)
"""Relative changes of a parameter with contact, to one side, tried in order until all perturbed runs converge.

Contact acts within a thin ramp. The changes are so small that a one-sided difference is accurate.
"""


@dataclass(frozen=True)
class Effects:
    """Derivatives of m values of an output quantity by n parameters.

    Attributes:
        measure: name of the quantity.
        names: names of the parameters.
        sizes: ranges of the parameters, or their start values without a range, shape (n,).
        coordinates: positions of the values, shape (m,): reference lengths of the wall, else numbers.
        value: values of the quantity, shape (m,).
        jacobian: derivatives, shape (m, n).
    """

    measure: str
    names: list[str]
    sizes: np.ndarray
    coordinates: np.ndarray
    value: np.ndarray
    jacobian: np.ndarray

    def __str__(self) -> str:
        rows = np.unique(np.linspace(0, len(self.value) - 1, min(len(self.value), 12)).round().astype(int))
        lines = ["".join([f"{'at':>10}{self.measure[:10]:>12}", *(f"{name[:11]:>12}" for name in self.names)])]
        lines += ["".join([f"{self.coordinates[k]:10.4g}{self.value[k]:12.5g}",
                           *(f"{d:12.4g}" for d in self.jacobian[k])])
                  for k in rows]
        return "\n".join(lines)

    __repr__ = __str__

    def plot(self, axes: Any = None) -> Any:
        """Draw a heat map of the first-order change of the quantity by a tenth of each parameter's range.

        Args:
            axes: matplotlib axes; default a new figure.

        Returns:
            The matplotlib axes.
        """
        from ...figures import figure
        axes = axes if axes is not None else figure()[1]
        tenth, n = (self.jacobian * self.sizes / 10).T, len(self.names)
        most, places = abs(tenth).max() or 1.0, self.coordinates if len(self.coordinates) > 1 else np.array([0.0, 1.0])
        edges = np.concatenate([places[:1], (places[1:] + places[:-1]) / 2, places[-1:]])
        drawn = axes.pcolormesh(edges, np.arange(n + 1) - 0.5,
                                tenth if len(self.coordinates) > 1 else tenth.repeat(2, 1),
                                cmap="RdBu_r", vmin=-most, vmax=most)
        axes.set(yticks=range(n), yticklabels=self.names, xlabel="reference length" if self.measure == "wall" else "")
        axes.invert_yaxis()
        axes.grid(False)
        axes.figure.colorbar(drawn, ax=axes, label=f"change of the {self.measure}").outline.set_visible(False)
        return axes


class DesignRun:
    """A run of the user's scene for given parameter values.

    Args:
        make: function of a vector of numbers that returns (scene, target or stages).
        parameters: the `Parameters` of the design.
        vector: values of the n numbers of the parameters, shape (n,).
        path: the `Path`.
        end: target or stages of the run.
        tolerances: tolerances of the run, or None.

    Attributes:
        vector: values of the n numbers of the parameters, shape (n,).
        values: {parameter: number or `Knots`}.
        parameters: the `Parameters` of the design.
        path: the `Path`.
    """

    def __init__(self, make: Callable[[np.ndarray], tuple[Any, Any]], parameters: Parameters, vector: np.ndarray,
                 path: Path, end: Any, tolerances: Tolerances | None):
        self._make, self.parameters, self.vector, self.path, self._end = make, parameters, vector, path, end
        self._tolerances = tolerances or Tolerances()
        self.values = parameters.values(vector)

    @cached_property
    def profile(self) -> Profile:
        """Profile of the last state."""
        return self.path.profile()

    @cached_property
    def _profiles(self) -> Profiles:
        """Evaluation of profiles on the mesh of the last state."""
        return Profiles(self.path.problem)

    @property
    def wall(self) -> np.ndarray:
        """Thickness of the last state at the nodes of the bottom face, shape (k,), length."""
        return self.profile.thickness

    @property
    def volume(self) -> float:
        """Reference volume of the whole part, length^3 (in plane strain per unit depth)."""
        return _volume(self.path.problem)

    @cached_property
    def _neighbours(self) -> list[tuple[list[PerturbedRun], float]]:
        """For each parameter, the perturbed runs at the last state and the parameter difference between them.

        The difference is taken from the base run if there is only one.
        """
        contact, reason = bool(self.path.problem.contacts), ""
        for size in _CLOSER if contact else (_SMOOTH,):
            made = []
            for k, step in enumerate(size * self.parameters.size):
                ways = (-1.0 if self.vector[k] + step > self.parameters.high[k] else 1.0,) if contact else (1.0, -1.0)
                made.append(([self._beside(k, way * step) for way in ways], ways[0] * step * len(ways)))
            try:
                carry(self.path, self._end, [entry for beside, _ in made for entry in beside])
            except PerturbedRunFailure as failure:
                reason = failure.reason
            except Failure as failure:
                reason = failure.reason
                break
            else:
                return made
        raise InputError(f"Design: this run has no derivative: {reason}")

    def _beside(self, k: int, step: float) -> PerturbedRun:
        """Return an unsolved perturbed run with one parameter changed."""
        moved, name = self.vector.copy(), self.parameters.names[k]
        moved[k] += step
        try:
            return PerturbedRun(*self._make(moved), self.path.problem, name)
        except InputError as error:
            raise InputError(f"Design: no derivative by {name}: next to its value {self.vector[k]:.6g} build(...)"
                             f" fails: {error}") from None

    def derivative(self, measure: Any) -> tuple[np.ndarray, np.ndarray]:
        """Return a quantity of the last state and its derivatives by the n parameters.

        Args:
            measure: "wall" (thickness at the nodes of the bottom face), "volume" (of the body in the reference
                configuration), or a column of the path. Or a function of a path that uses only its last state.

        Returns:
            The quantity, shape (m,), and its derivatives, shape (m, n).

        Raises:
            InputError: the run has no derivative, or the quantity depends on earlier states.
        """
        value, columns = self._here(measure), []
        for beside, apart in self._neighbours:
            first, *other = (np.atleast_1d(self._at(neighbour, measure)) for neighbour in beside)
            columns.append((first - (other[0] if other else value)) / apart)
        return value, np.stack(columns, axis=-1)

    def sensitivities(self, measure: Any = "wall") -> Effects:
        """Return the derivatives of a quantity as a table; the wall over the reference length.

        Args:
            measure: as in `derivative`.

        Returns:
            The `Effects`.

        Raises:
            InputError: as `derivative`.
        """
        value, jacobian = self.derivative(measure)
        places = self.profile.reference_length if measure == "wall" else np.arange(float(len(value)))
        name = measure if isinstance(measure, str) else getattr(measure, "__name__", "measure")
        return Effects(name, self.parameters.names, self.parameters.size, places, value, jacobian)

    def spread(self, deviations: Any, measure: Any = "wall") -> np.ndarray:
        """Return the standard deviation of a quantity, to first order.

        Args:
            deviations: {parameter: standard deviation}. The knots of a profile are independent, with equal deviations.
                Or a `Fit` whose constants have the names of parameters, with its covariance. Or a list of such.
            measure: as in `derivative`.

        Returns:
            Standard deviation, shape (m,).

        Raises:
            InputError: the run has no derivative, a name is no parameter, or the fit leaves constants undetermined.
        """
        return scatter.deviations(self.derivative(measure)[1],
                                  scatter.covariance_of("spread", self.parameters, deviations))

    def band(self, deviations: Any, measure: Any = "wall", confidence: float = 0.95) -> Band:
        """Return a quantity with its confidence band, to first order and without further runs; print it or plot it.

        Args:
            deviations, measure: as in `spread`.
            confidence: confidence level of the band, for a normal distribution.

        Returns:
            The `Band`.

        Raises:
            InputError: as `spread`.
        """
        return scatter.band(self, deviations, measure, confidence)

    def report(self, file: Any = "design.html", title: str = "", *, deviations: Any = None,
               units: Units | None = None) -> FilePath:
        """Write an HTML report of the part, its wall, and the effects of the parameters (rank 0 writes).

        Args:
            file: path of the file.
            title: heading of the page.
            deviations: as in `spread`. Adds the standard deviation to the wall, and a table with the deviations
                of wall, volume, pressures and forces.
            units: a `formingx.Units`, for the labels.

        Returns:
            Path of the file.

        Raises:
            InputError: the run has no derivative.
            OSError: the file cannot be written.
        """
        from .report import of_run
        return of_run(self, file, title, deviations, units or NONE)

    def _here(self, measure: Any) -> np.ndarray:
        """Return the values of a quantity in the last state, shape (m,)."""
        if isinstance(measure, str):
            if measure in ("wall", "volume"):
                return np.atleast_1d(getattr(self, measure))
            return self.path[measure][-1:]
        found = measure(self.path) if callable(measure) else None
        try:
            whole = np.atleast_1d(np.asarray(found, dtype=float))
        except (TypeError, ValueError):
            whole = np.array(np.nan)
        if not np.all(np.isfinite(whole)):
            raise InputError(f"Design: measure {measure!r} is {found!r}: must be 'wall', 'volume', a column of the"
                             f" path, or a function of it that gives finite numbers")
        short = _of_one(self.path.last, Record(self.path.problem, self.path.record.curve))
        if not np.allclose(whole, measure(short), rtol=1e-9, atol=0):
            raise InputError("Design: a measure must be one of the last state alone: this function of the path looks at"
                             " earlier states too, whose derivatives are not kept")
        return whole

    def _at(self, entry: PerturbedRun, measure: Any) -> Any:
        """Return the values of a quantity in a perturbed run."""
        if measure == "volume":
            return _volume(entry.problem)
        state = entry.state(self.path.last)
        if measure == "wall":
            mine, its = (problem.scene.mesh.domain.geometry.x for problem in (self.path.problem, entry.problem))
            same = self.path.problem.comm.allreduce(np.array_equal(mine, its), MPI.LAND)
            return (self._profiles if same else Profiles(entry.problem)).of(state).thickness
        if entry.path is None:
            entry.path = _of_one(state, Record(entry.problem, Curve(entry.problem, self._tolerances)))
        return entry.path[measure] if isinstance(measure, str) else np.asarray(measure(entry.path), dtype=float)


def _volume(problem: Any) -> float:
    """Return the reference volume of the whole part, length^3."""
    return float(problem.scene.symmetry_factor * problem.forms.volume)


def _of_one(state: Any, record: Record) -> Path:
    """Return a path of one state."""
    path = Path(record)
    record.segments[-1].states.append(state)
    for listener in record.hooks.on_state:
        listener(state)
    return path
