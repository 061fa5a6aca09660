"""Time integration error of the stress at the end of a step, by step doubling.

The history variables of the materials are updated once more, in two half steps. The displacement halfway is
extrapolated from the accepted states and the new one. The resulting stress is compared with the stress of the full
step, point by point at a given deformation (Hairer, Norsett and Wanner 1993, section II.4). No equilibrium is solved.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import ufl
from mpi4py import MPI

from .. import _compat
from ..ranks import combined

_STRESS_FREE = 1e-6
"""Stress over the largest modulus below which a body counts as stress-free."""

_SYSTEMATIC_WEIGHT = 4.0
"""Weight of errors that have the same sign in every step, as the error of a backward difference.

Such errors add up over a run; others partly cancel. With weight 1 a creeping disc of `demos/kbkz.py` is 1 % too thin at
its pole, with 4 less than 0.5 % (tests/test_kbkz_scenes.py).
"""


class StepError:
    """Estimator of the time integration error of the steps of a problem."""

    def __init__(self, problem: Any):
        self._problem, self._forms = problem, problem.forms
        forms = self._forms
        self._materials = problem.history.materials
        heat = len(self._materials) < len(forms.histories)
        terms = [terms for terms in forms.terms if terms.has_history or heat and terms.depends_on_temperature]
        self._stresses = [_Stress(forms, entry, entry.step_energy) for entry in terms]
        systematic = any(entry.material.motion_variables or entry.material.integral for entry in terms)
        self._weight = _SYSTEMATIC_WEIGHT if systematic else 1.0
        self._relaxed = [_Stress(forms, entry, entry.equilibrium_energy) for entry in terms
                         if entry.has_history and entry.equilibrium_energy(forms.elastic_F) is not None]

    def estimate(self, past: Sequence[Any], share: np.ndarray, x: np.ndarray, control: float) -> tuple[float, float]:
        """Estimate the relative error of a step from the last of `past` to x, shape (n,), by step doubling.

        share: weights of `past` and x for the displacement halfway in time, shape (k + 1,). Return the error of the
        stress, and its part left after relaxation for another such time, which adds up over steps. Both are root mean
        squares over the body, over the largest stress at the start, at the end and after relaxation; times 4 for
        materials whose errors have one sign (`Material.motion_variables`, integral laws).
        """
        forms, old = self._forms, past[-1]
        start, clock, end = [h.get() for h in forms.histories], forms.clock, forms.time_at(control)
        step = end - old.time if self._stresses else 0.0
        first, found = (self._stresses_at(old.x, old.time), self._stresses_at(x, end)) if step > 0 else ([], [])
        forms.clock = clock
        after = self._problem.history.predict(old, x, control)
        for history, variables in zip(forms.histories, start):
            if history in self._materials or not step > 0:
                history.put(variables)
        if not step > 0:
            return 0.0, 0.0
        errors = []
        if self._materials:
            self._advance(share @ np.array([*(state.x for state in past), x]), control, end - step / 2)
        errors.append((self._stresses_at(x, end), found))
        if self._materials:
            self._advance(x, control, end)
            better = self._stresses_after_relaxation(x, end + step)
            for history, variables in zip(forms.histories, after):
                history.put(variables)
            errors.append((better, self._stresses_after_relaxation(x, end + step)))
        for history, variables in zip(forms.histories, start):
            history.put(variables)
        self._set_time(end)
        forms.clock = clock
        relaxed = [stress.values() for stress in self._relaxed]     # branches may turn the sum through 0
        scale = max(self._norm(first), self._norm(found), self._norm(relaxed), _STRESS_FREE * forms.stress)
        once, lasting = [*(self._norm([a - b for a, b in zip(*pair)]) / scale for pair in errors), 0.0][:2]
        return self._weight * once, self._weight * lasting

    def _set_time(self, time: float) -> None:
        """Set the clock so that the process time equals `time`."""
        self._forms.clock += time - self._problem.time

    def _stresses_at(self, x: np.ndarray, time: float) -> list[np.ndarray]:
        """Return for x, (n,), each material's deviatoric Kirchhoff stress, 11, 22, sqrt(2) 12, 33, (points, 4)."""
        self._set_time(time)
        self._problem.set_fields(x)
        return [stress.values() for stress in self._stresses]

    def _stresses_after_relaxation(self, x: np.ndarray, time: float) -> list[np.ndarray]:
        """Return the stresses, as `_stresses_at`, after relaxation at constant deformation until a time."""
        for history in self._materials:
            history.forget_motion()
        return self._stresses_at(x, time)

    def _advance(self, x: np.ndarray, control: float, time: float) -> None:
        """Update the materials' history variables to x, owned entries (n,), and control at a process time."""
        self._problem.set_fields(x)
        self._set_time(time)
        for history in self._materials:
            history.advance(x, control)

    def _norm(self, values: list[np.ndarray]) -> float:
        """Return the root mean square of stresses of each material, (points, 4), over points of all ranks."""
        comm = self._problem.comm
        total, number = (combined(comm, v, MPI.SUM)
                         for v in (float(sum(np.sum(v**2) for v in values)), sum(v.shape[0] for v in values)))
        return float(np.sqrt(total / max(number, 1)))


class _Stress:
    r"""Deviatoric Kirchhoff stress of a material, without thermal expansion, at the quadrature points of the energy.

    .. math:: \tau = \mathrm{dev} \left( \frac{\partial W}{\partial F} F^T \right)
    """

    def __init__(self, forms: Any, terms: Any, energy: Callable):
        F = ufl.variable(forms.elastic_F)
        tau = ufl.diff(energy(F), F) * F.T
        tau -= ufl.tr(tau) / 3 * ufl.Identity(3)
        entries = [tau[0, 0], tau[1, 1], np.sqrt(2) * tau[0, 1], tau[2, 2]]
        self._forms, self._cells = forms, terms.own_cells
        self._expression = _compat.compile_expression(ufl.as_vector(entries), terms.places)

    def values(self) -> np.ndarray:
        """Return the entries 11, 22, sqrt(2) 12, 33 in the locally owned cells, shape (points, 4), stress."""
        if not len(self._cells):
            return np.zeros((0, 4))
        return self._expression.eval(self._forms.domain, self._cells).reshape(-1, 4)
