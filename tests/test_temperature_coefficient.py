"""Coefficients that depend on a temperature which changes with time."""

from types import SimpleNamespace

import basix.ufl
import numpy as np
import pytest
import ufl
from dolfinx import fem, mesh
from mpi4py import MPI

from formingx import _compat
from formingx.forms.temperature_coefficient import TemperatureCoefficient

LAWS = (lambda T: np.exp(T), lambda T: np.exp(-2 * T))     # ln f is linear in T: the extrapolation is exact
A, B = np.array([[0.1]]), np.array([[0.4]])                # temperatures of one cell with one point


def test_values_at_earlier_temperatures_are_used_again_with_their_rates_only():
    """Integral of f at time t, for temperatures and times that change together, one alone, and back and forth."""
    domain = mesh.create_rectangle(MPI.COMM_SELF, [(0, 0), (1, 1)], (1, 1))
    heat = SimpleNamespace(time=0.0, time_before=0.0)
    forms = SimpleNamespace(temperature=heat, scene=SimpleNamespace(heat=object()),
                            constant=lambda value: fem.Constant(domain, value))
    evaluated = []

    def counted(law):
        return lambda T: evaluated.append(1) or law(T)
    values = fem.Function(fem.functionspace(domain, basix.ufl.quadrature_element("triangle", degree=1)))
    parts = [(np.array([cell]), counted(law)) for cell, law in enumerate(LAWS)]
    coefficient, t = TemperatureCoefficient(forms, values, parts, [A[None], B[None]]), fem.Constant(domain, 0.0)
    integral = _compat.compile_form(coefficient.at_time(t) * ufl.dx(metadata={"quadrature_degree": 1}))
    states = [((A, B), None, 0.0, 0.0), ((B, A), (A, B), 1.0, 0.0), ((A, B), None, 0.0, 0.0),
              ((B, A), (A, B), 1.0, 0.0), ((B, A), (A, B), 1.5, 0.0), ((B, A), (A, B), 1.5, 1.0),
              ((B, B), (A, B), 1.5, 1.0), ((B, B), (B, A), 1.5, 1.0), ((B, A), (A, B), 1.0, 0.0)]

    def check(now, before, heat_time, time_before):
        heat.time, heat.time_before = heat_time, time_before
        coefficient.update([np.array([T] if before is None else [T, before[k]]) for k, T in enumerate(now)])
        t.value = heat_time + 0.3
        expected = 0.0
        for k, law in enumerate(LAWS):
            rate = 0.0 if before is None else (now[k] - before[k]) / (heat_time - time_before)
            expected += 0.5 * law(now[k] + 0.3 * rate).item()
        assert fem.assemble_scalar(integral) == pytest.approx(expected, rel=1e-12)
    for state in states:
        check(*state)
    evaluations = len(evaluated)
    for state in (states[-2], states[-1], states[-2]):     # the last two are stored
        check(*state)
    assert len(evaluated) == evaluations
