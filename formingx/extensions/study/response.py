"""Sensitivity of a measure of a study to its variables: Sobol indices of a response that is fitted to the runs."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from ...errors import InputError
from ...findings import percent

_SAMPLES = 2048
"""Number of points of the quasi-random sample in each matrix of the estimator."""


class Sensitivities(NamedTuple):
    """Sobol indices of a measure (Sobol', Math. Comput. Simul. 55 (2001) 271, doi:10.1016/S0378-4754(00)00270-6).

    The variables are independent and uniform between their smallest and largest values in the study.

    Attributes:
        measure: name of the measure.
        first: {variable: first-order index, the part of the variance due to this variable alone}.
        total: {variable: total index, with its interactions}, the largest first.
        deviation: root mean square of the misfit of the response at runs that are left out one by one, over the
            standard deviation of the measure. A large value says that the indices are not to be trusted.
    """

    measure: str
    first: dict[str, float]
    total: dict[str, float]
    deviation: float

    def __str__(self) -> str:
        width = max(map(len, [*self.total, "sensitivity of"]))
        lines = [f"{self.measure}: response fitted to the runs, left-out runs differ by {percent(self.deviation)} of"
                 f" the standard deviation", f"{'':{width}}  total   alone"]
        return "\n".join([*lines, *(f"{name:{width}}  {self.total[name]:5.3f}   {self.first[name]:5.3f}"
                                    for name in self.total)])

    def __repr__(self) -> str:
        return str(self)


def sobol(runs: Sequence[Any], variables: Sequence[str], measure: str) -> Sensitivities:
    """Return the Sobol indices of a response that is fitted to runs, of second order, or of first with few runs.

    No varying variable, too few runs, or a measure equal in all runs is an InputError.
    """
    from scipy import stats
    names = [name for name in variables if np.ptp([run.values[name] for run in runs] or [0.0]) > 0]
    x = np.array([[run.values[name] for name in names] for run in runs], float)
    y = np.array([run.measures[measure] for run in runs], float)
    if not names or len(y) < len(names) + 2:
        raise InputError(f"Study.sensitivities: {len(y)} runs that succeeded, {len(names)} variables that vary: at"
                         f" least {len(names) + 2} runs and one variable are needed")
    if not np.ptp(y) > 0:
        raise InputError(f"Study.sensitivities: {measure!r} is the same in all runs")
    low, size = x.min(0), np.ptp(x, axis=0)
    levels = [len(np.unique(column)) for column in x.T]

    def terms(points: np.ndarray, order: int) -> np.ndarray:
        """Return the terms of the polynomial at points between -1 and 1, shape (n, terms)."""
        d = points.shape[1]
        columns = [np.ones(len(points)), *points.T]
        if order > 1:
            columns += [points[:, i] * points[:, j] for i in range(d) for j in range(i + 1, d)]
            columns += [points[:, i] ** 2 for i in range(d) if levels[i] > 2]
        return np.column_stack(columns)
    unit = 2 * (x - low) / size - 1
    order = 2 if len(y) > terms(unit, 2).shape[1] else 1
    matrix = terms(unit, order)
    inverse = np.linalg.pinv(matrix)
    coefficients = inverse @ y
    leverage = np.minimum(np.einsum("ij,ji->i", matrix, inverse), 1 - 1e-9)
    left_out = (y - matrix @ coefficients) / (1 - leverage)
    first = total = np.ones(1)                               # of a single variable, which SciPy refuses
    if len(names) > 1:
        found = stats.sobol_indices(
            func=lambda points: (terms(points.T, order) @ coefficients)[None], n=_SAMPLES,
            dists=[stats.uniform(-1, 2)] * len(names), rng=np.random.default_rng(0))
        first, total = (np.clip(np.atleast_2d(v)[0], 0.0, None) for v in (found.first_order, found.total_order))
    ranked = np.argsort(-total)
    return Sensitivities(measure, {names[k]: float(first[k]) for k in ranked},
                         {names[k]: float(total[k]) for k in ranked},
                         float(np.sqrt(np.mean(left_out**2)) / y.std()))
