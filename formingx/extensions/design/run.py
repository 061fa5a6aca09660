"""A run of a design, and the derivatives of its output quantities by all parameters."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
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
from ...values.tolerances import DIFFERENCE_STEP
from . import scatter
from .parameters import Parameters
from .perturbed_paths import trace_perturbed
from .perturbed_runs import PerturbedRun, PerturbedRunFailure
from .scatter import Band
from .whole_runs import Outputs

_CONTACT_CHANGE = 1e-8
"""Relative change of a parameter with contact, to one side; a tenth and a hundredth of it are tried next.

Contact acts within a thin ramp. The change is so small that a one-sided difference is accurate.
"""


@dataclass(frozen=True)
class Effects:
    """Derivatives of an output quantity of a run, with m values, by n parameters; its text is a table.

    Attributes:
        measure: name of the quantity.
        names: names of the n parameters.
        sizes: ranges of the parameters, or their start values without a range, shape (n,).
        coordinates: abscissa of the values, shape (m,). For the wall it is the reference length of the node: the
            distance from the axis along the undeformed middle line, length. Otherwise it counts from 0 to m - 1.
        value: values of the quantity, shape (m,).
        jacobian: derivatives of the values by the parameters, shape (m, n).
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
        largest = np.abs(self.jacobian).max(axis=0)         # with contact, 1e-6 of it is round-off
        digits = [5 - int(np.floor(np.log10(size))) if 0 < size < np.inf else 0 for size in largest]
        lines += ["".join([f"{self.coordinates[k]:10.4g}{self.value[k]:12.5g}",
                           *(f"{round(float(d), n):12.4g}" for d, n in zip(self.jacobian[k], digits, strict=True))])
                  for k in rows]
        return "\n".join(lines)

    __repr__ = __str__

    def plot(self, axes: Any = None) -> Any:
        """Draw a heat map of the derivatives, with a row for each parameter, over `coordinates`; of one value, bars.

        The colour, or the bar, is the change of the output quantity, to first order, if the parameter changes by a
        tenth of its range, or of its start value if a bound is missing.

        Args:
            axes: matplotlib axes; default a new figure.

        Returns:
            The matplotlib axes.
        """
        from ...figures import new_axes
        axes = axes if axes is not None else new_axes()
        tenth, n = (self.jacobian * self.sizes / 10).T, len(self.names)
        most = abs(tenth).max() or 1.0
        if len(self.coordinates) == 1:
            axes.barh(range(n), tenth[:, 0], color=["C0" if change < 0 else "C3" for change in tenth[:, 0]])
            axes.axvline(0.0, color="0.3", linewidth=0.8)
            axes.set(yticks=range(n), yticklabels=self.names, xlabel=f"change of the {self.measure.replace('_', ' ')}")
            axes.invert_yaxis()
            return axes
        coordinates = self.coordinates
        edges = np.concatenate([coordinates[:1], (coordinates[1:] + coordinates[:-1]) / 2, coordinates[-1:]])
        drawn = axes.pcolormesh(edges, np.arange(n + 1) - 0.5, tenth, cmap="RdBu_r", vmin=-most, vmax=most)
        axes.set(yticks=range(n), yticklabels=self.names, xlabel="reference length" if self.measure == "wall" else "")
        axes.invert_yaxis()
        axes.grid(False)
        axes.figure.colorbar(drawn, ax=axes, label=f"change of the {self.measure}").outline.set_visible(False)
        return axes


class DesignRun:
    """A run of a design for given parameters, which computes its derivatives by them (result of `Design.run`).

    Args:
        make: function of a vector of parameters, shape (n,), that returns (scene, target or stages).
        parameters: the `Parameters` of the design.
        vector: vector of the parameters of this run, shape (n,).
        path: the computed `Path`.
        end: target or stages of the run.
        tolerances: tolerances of the run; None for the defaults.
        by_runs: the `Design` whose whole runs give the derivatives as differences; None for exact derivatives.

    Attributes:
        parameters: the `Parameters` of the design.
        vector: vector of the parameters of this run, shape (n,).
        values: {parameter: number or `Knots`}.
        path: the computed `Path`.
    """

    def __init__(self, make: Callable[[np.ndarray], tuple[Any, Any]], parameters: Parameters, vector: np.ndarray,
                 path: Path, end: Any, tolerances: Tolerances | None, by_runs: Any = None):
        self._make, self.parameters, self.vector, self.path, self._end = make, parameters, vector, path, end
        self._tolerances = tolerances or Tolerances()
        self.values = parameters.values(vector)
        self._by_runs = by_runs
        self._neighbours: list[tuple[Outputs, float]] = []    # outputs of runs at changed parameters, and the changes

    @cached_property
    def profile(self) -> Profile:
        """Outline of the formed part in the last state of the run; a part in three dimensions has none."""
        return self.path.profile()

    @property
    def in_space(self) -> bool:
        """True for a part in three dimensions."""
        return bool(self.path.scene.kinematics.components == 3)

    @cached_property
    def _sheet_wall(self) -> Any:
        """Wall of a part in three dimensions in the last state, a `SheetWall`."""
        return self.path.wall()

    @property
    def missing_runs(self) -> int:
        """Number of whole runs that the derivatives of this run still need; 0 for exact derivatives."""
        return len(self.parameters) if self._by_runs is not None and not self._neighbours else 0

    @cached_property
    def reference_length(self) -> np.ndarray:
        """Reference length of the k places of the wall, shape (k,), length.

        In a section it is the distance of a node from the axis along the undeformed middle line. In three dimensions it
        is that of the centroid of a triangle: along the meridian from the neck of a tube, else from the axis.
        """
        if not self.in_space:
            return self.profile.reference_length
        wall, mesh = self._sheet_wall, self.path.scene.mesh
        X = wall.reference_points[wall.triangles].mean(1)
        return np.hypot(X[:, 0], X[:, 1]) if mesh.meridian is None else mesh.arc_length(*X.T)

    @cached_property
    def _profiles(self) -> Profiles:
        """Evaluation of the outline of the part in any state of this run."""
        return Profiles(self.path.problem)

    @property
    def wall(self) -> np.ndarray:
        """Thickness at the k nodes of the bottom face in the last state, shape (k,), length.

        It is the deformed distance to the opposite node of the top face. In three dimensions it is the thickness of the
        k triangles.
        """
        return self._sheet_wall.wall if self.in_space else self.profile.thickness

    @property
    def volume(self) -> float:
        """Reference volume of the whole body of the run, length^3; in plane strain per unit depth, length^2."""
        return _volume(self.path.problem)

    @cached_property
    def _perturbed_runs(self) -> list[tuple[list[PerturbedRun], float]]:
        """Return perturbed runs in their last state, and the denominator of the difference quotient, by parameter.

        It is two steps of the parameter for two runs without contact, one step for the single run with contact.
        """
        contact, reason = bool(self.path.problem.contacts), ""
        for size in [_CONTACT_CHANGE / 10**k for k in range(3)] if contact else [DIFFERENCE_STEP]:
            perturbed_runs = []
            for k, step in enumerate(size * self.parameters.size):
                signs = (-1.0 if self.vector[k] + step > self.parameters.high[k] else 1.0,) if contact else (1.0, -1.0)
                runs = [self._perturbed_run(k, sign * step) for sign in signs]
                perturbed_runs.append((runs, signs[0] * step * len(signs)))
            try:
                trace_perturbed(self.path, self._end, [perturbed for runs, _ in perturbed_runs for perturbed in runs])
            except PerturbedRunFailure as failure:
                reason = failure.reason
            except Failure as failure:
                reason = failure.reason
                break
            else:
                return perturbed_runs
        raise InputError(f"Design: this run has no derivative: {reason}")

    def forget_perturbed_runs(self) -> None:
        """Free the perturbed runs with their communicators; `derivative` computes them again if it is called again."""
        vars(self).pop("_perturbed_runs", None)

    def _perturbed_run(self, k: int, step: float) -> PerturbedRun:
        """Return a new perturbed run without a state, whose parameter number k is larger by `step` than in this run."""
        moved, name = self.vector.copy(), self.parameters.names[k]
        moved[k] += step
        try:
            return PerturbedRun(*self._make(moved), self.path.problem, name)
        except InputError as error:
            raise InputError(f"Design: no derivative by {name}: next to its value {self.vector[k]:.6g} build(...)"
                             f" fails: {error}") from None

    def derivative(self, measure: Any) -> tuple[np.ndarray, np.ndarray]:
        """Return an output quantity of the last state and its derivatives by the n parameters.

        Args:
            measure: the quantity: "wall" (thickness at the nodes of the bottom face, length), "volume" (reference
                volume of the whole part, length^3), or a column of the path. Or a function of a path that uses only its
                last state, and returns a number or an array.

        Returns:
            Values of the quantity, shape (m,), and their derivatives, shape (m, n).

        Raises:
            InputError: the run has no derivative, or the quantity depends on earlier states.
        """
        value, columns = self.value(measure), []
        if self._by_runs is not None:
            if not self._neighbours or measure not in self._neighbours[0][0]:
                self._neighbours = self._by_runs.whole_runs.neighbours(self._by_runs, self.vector, measure)
            moved = [(outputs[measure], step) for outputs, step in self._neighbours]
            if any(np.shape(other) != np.shape(value) for other, _ in moved):
                raise InputError("Design: no derivative: a parameter changes the number of places of the wall")
            return value, np.stack([(other - value) / step for other, step in moved], axis=-1)
        for runs, difference in self._perturbed_runs:
            first, *other = (np.atleast_1d(self._perturbed_value(entry, measure)) for entry in runs)
            columns.append((first - (other[0] if other else value)) / difference)
        return value, np.stack(columns, axis=-1)

    def sensitivities(self, measure: Any = "wall") -> Effects:
        """Return the derivatives of an output quantity by all parameters as a table that can be printed and drawn.

        Args:
            measure: the quantity: "wall" (thickness at the nodes of the bottom face), "volume" (reference volume), a
                column of the path, or a function of a path that uses only its last state.

        Returns:
            Table of the m values and their derivatives. The rows of a wall are ordered by `coordinates`: the reference
            length, which is the distance from the axis along the undeformed middle line.

        Raises:
            InputError: the run has no derivative, or the quantity depends on earlier states.
        """
        value, jacobian = self.derivative(measure)
        coordinates = self.reference_length if measure == "wall" else np.arange(float(len(value)))
        if measure == "wall" and self.in_space:
            order = np.argsort(coordinates, kind="stable")
            coordinates, value, jacobian = coordinates[order], value[order], jacobian[order]
        name = measure if isinstance(measure, str) else getattr(measure, "__name__", "measure")
        return Effects(name, self.parameters.names, self.parameters.size, coordinates, value, jacobian)

    def spread(self, deviations: Any, measure: Any = "wall") -> np.ndarray:
        """Return the standard deviation of an output quantity for uncertain parameters, to first order.

        Args:
            deviations: {parameter: standard deviation}; the knots of a profile are independent, with equal deviations.
                Or a `Fit` whose constants have the names of parameters, or the `Confidence` of a fit to a measured
                wall, with its covariance. Or a list of such.
            measure: the quantity: "wall" (thickness at the nodes of the bottom face), "volume" (reference volume), a
                column of the path, or a function of a path that uses only its last state.

        Returns:
            Standard deviation of each of the m values, shape (m,).

        Raises:
            InputError: the run has no derivative, a name is no parameter, or the fit leaves constants undetermined.
        """
        return scatter.deviations(self.derivative(measure)[1],
                                  scatter.covariance_of("spread", self.parameters, deviations))

    def band(self, deviations: Any, measure: Any = "wall", confidence: float = 0.95) -> Band:
        """Return an output quantity with its confidence band for uncertain parameters, to first order.

        Args:
            deviations: {parameter: standard deviation}; the knots of a profile are independent, with equal deviations.
                Or a `Fit` whose constants have the names of parameters, or the `Confidence` of a fit to a measured
                wall, with its covariance. Or a list of such.
            measure: the quantity: "wall" (thickness at the nodes of the bottom face), "volume" (reference volume), a
                column of the path, or a function of a path that uses only its last state.
            confidence: confidence level of the band, between 0 and 1, for a normal distribution.

        Returns:
            Values and band, which can be printed and drawn.

        Raises:
            InputError: a confidence outside (0, 1), a name that is no parameter, or the run has no derivative.
        """
        return scatter.band(self, deviations, measure, confidence)

    def report(self, file: Any = "design.html", title: str = "", *, deviations: Any = None,
               units: Units | None = None) -> FilePath:
        """Write an HTML report of the part, its wall, and the effects of the parameters (rank 0 writes).

        Args:
            file: path of the HTML file.
            title: heading of the page.
            deviations: {parameter: standard deviation}, a `Fit` with its covariance, or a list of such. The report
                then shows the standard deviations of the wall, volume, pressures and forces.
            units: a `formingx.Units`, for the labels; default without units.

        Returns:
            Path of the file.

        Raises:
            InputError: the run has no derivative.
            OSError: the file cannot be written.
        """
        from .report import of_run
        return of_run(self, file, title, deviations, units or NONE)

    def value(self, measure: Any) -> np.ndarray:
        """Return the values of an output quantity in the last state of this run.

        Args:
            measure: the quantity: "wall", "volume", a column of the path, or a function of it.

        Returns:
            The values, shape (m,).

        Raises:
            InputError: a function that gives no finite numbers. Or the derivatives are exact, and the quantity depends
                on earlier states.
        """
        if isinstance(measure, str):
            if measure in ("wall", "volume"):
                return np.atleast_1d(getattr(self, measure))
            values = self.path[measure][-1:]
            if self._by_runs is None and measure in self._last_alone.columns:
                self._check_last_alone(values, self._last_alone[measure], f"column {measure!r}")
            return values
        found = measure(self.path) if callable(measure) else None
        try:
            values = np.atleast_1d(np.asarray(found, dtype=float))
        except (TypeError, ValueError):
            values = np.array(np.nan)
        if not np.all(np.isfinite(values)):
            raise InputError(f"Design: measure {measure!r} is {found!r}: must be 'wall', 'volume', a column of the"
                             f" path, or a function of it that gives finite numbers")
        if self._by_runs is None:
            self._check_last_alone(values, measure(self._last_alone), "function of the path")
        return values

    @cached_property
    def _last_alone(self) -> Path:
        """Path that contains only the last state of this run."""
        return _path_of(self.path.last, Record(self.path.problem, self.path.record.curve))

    @staticmethod
    def _check_last_alone(values: np.ndarray, alone: Any, what: str) -> None:
        """Raise an InputError if values (m,) of a run and of its last state alone differ; `what` names them."""
        if not np.allclose(values, alone, rtol=1e-9, atol=0):
            raise InputError(f"Design: a measure must be one of the last state alone: this {what} looks at"
                             " earlier states too, whose derivatives are not kept; compare whole runs at two values of"
                             " the parameter")

    def _perturbed_value(self, perturbed: PerturbedRun, measure: Any) -> Any:
        """Return an output quantity in the last state of a perturbed run, shape (m,) or a number (see `_value`)."""
        if measure == "volume":
            return _volume(perturbed.problem)
        state = perturbed.state(self.path.last)
        if measure == "wall" and not self.in_space:
            nodes, perturbed_nodes = (problem.scene.mesh.domain.geometry.x
                                      for problem in (self.path.problem, perturbed.problem))
            same_nodes = self.path.problem.comm.allreduce(np.array_equal(nodes, perturbed_nodes), MPI.LAND)
            return (self._profiles if same_nodes else Profiles(perturbed.problem)).evaluate(state).thickness
        if perturbed.path is None:
            perturbed.path = _path_of(state, Record(perturbed.problem, Curve(perturbed.problem, self._tolerances)))
        if measure == "wall":
            return perturbed.path.wall().wall
        return perturbed.path[measure] if isinstance(measure, str) else np.asarray(measure(perturbed.path), dtype=float)


def _volume(problem: Any) -> float:
    """Return the reference volume of the whole body of a problem, length^3, also if a half of it is modelled."""
    return float(problem.scene.symmetry_factor * problem.forms.volume)


def _path_of(state: Any, record: Record) -> Path:
    """Return a path with a copy of one state, with its own measures, in an empty record of a run."""
    path, state = Path(record), replace(state)
    record.segments[-1].states.append(state)
    path._fill(record.segments[-1], [state])
    return path
