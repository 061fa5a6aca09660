"""The solver on equations without a mesh: a shallow arch in NumPy, through limit points and snap-through."""

import contextlib

import numpy as np
import pytest
from mpi4py import MPI
from petsc4py import PETSc

import formingx as fx
from formingx.forms.schedule import StepData
from formingx.measures.targets import Target
from formingx.solve.arc_length import Curve
from formingx.solve.equations import Equations
from formingx.solve.path_following import Run
from formingx.solve.process import begin
from formingx.solve.record import Record

pytestmark = pytest.mark.quick

TOP = 1 - 1 / np.sqrt(6)                                         # where the load that it carries has its maximum


def load(x):
    """What the arch carries at a deflection: g(0) = 0, g'(TOP) = 0, g'(2 - TOP) = 0."""
    return (x - 1) ** 3 - (x - 1) / 2 + 0.5


class Arch(Equations):
    """F = (g(x0) + s (x0 - x1) - control, s (x1 - x0)): x1 follows x0 on a spring."""

    spring = 3.0

    def __init__(self):
        self.comm, self.force_scale = MPI.COMM_SELF, 0.0
        self.matrix = PETSc.Mat().createAIJ((2, 2), nnz=2, comm=self.comm)
        self.x, self._setting = self.matrix.createVecRight(), StepData([0.0, 0.0], [1.0, 0.0], [])

    symmetric, setting = True, property(lambda self: self._setting)

    def residual(self, x, control, out):
        pull = self.spring * (x.array_r[1] - x.array_r[0])
        self.force_scale = float(np.hypot(control, pull))
        out.array_w[:] = load(x.array_r[0]) - pull - control, pull

    def tangent(self, x, control, one_sided=False):
        s, slope = self.spring, 3 * (x.array_r[0] - 1) ** 2 - 0.5
        self._fill(self.matrix, np.array([[slope + s, -s], [-s, s]]))
        return self.matrix

    def control_derivative(self, x, control, out, one_sided=False):
        out.array_w[:] = -1.0, 0.0

    def inner(self, a, b):
        return a.dot(b) / 2

    def metric_times(self, a, out):
        out.array_w[:] = a.array_r / 2

    def viscosity(self):
        return self

    def forces(self, change, eta):
        return eta * change

    def add_to(self, tangent, eta):
        tangent.shift(eta)

    def destroy(self):
        pass

    @contextlib.contextmanager
    def state_context(self, state):
        before = self.x.array_r.copy()
        self.x.array_w[:] = state.x
        yield self
        self.x.array_w[:] = before

    @staticmethod
    def _fill(matrix, values):
        matrix.setValues([0, 1], [0, 1], values)
        matrix.assemble()


class Deflection:
    """The measure x1."""

    size = 1.0

    def value(self, x, control):
        return float(x.array_r[1])

    def equation(self, target):
        def c(x, control, gradient):
            gradient.array_w[:] = 0.0, 1.0
            return x.array_r[1] - target, 0.0
        return c


def followed(until, at_limit_point=None, arch=Arch, **given):
    problem = arch()
    record = Record(problem, Curve(problem, fx.Tolerances()))
    Run(record, [(Target("deflection", until, None), Deflection())], at_limit_point=at_limit_point).follow(
        None, False, begin(record.curve), **given)
    return record


def test_arch_passes_both_limit_points_to_its_target():
    record = followed(2.4)
    limits = [s for s in record.states if s.kind == "limit point"]
    assert [s.control for s in limits] == pytest.approx([load(TOP), load(2 - TOP)], rel=2e-7)
    assert [s.x[0] for s in limits] == pytest.approx([TOP, 2 - TOP], abs=2e-4)      # quadratic: see the controls
    assert record.last.kind == "target" and record.last.x == pytest.approx([2.4, 2.4], rel=1e-12)
    assert all(s.control == pytest.approx(load(s.x[0]), abs=1e-9) for s in record.states)


def test_arch_snaps_through_and_loses_the_enclosed_energy():
    """At the maximum of what it carries the arch snaps to the other root of g(x) = g(TOP), and loses g's area."""
    record = followed(2.4, at_limit_point="snap_through")
    limit, after = next((a, b) for a, b in zip(record.states, record.states[1:]) if b.kind == "jump")
    assert limit.kind == "limit point" and limit.control == pytest.approx(load(TOP), rel=1e-9)
    far = max(np.roots([1, 0, -0.5, 0.5 - load(TOP)]).real) + 1
    assert after.x[0] == pytest.approx(far, abs=1e-4) and after.control == pytest.approx(load(after.x[0]), abs=1e-9)
    x = np.linspace(TOP, far, 20001)
    assert after.jump["dissipated"] == pytest.approx(np.trapezoid(load(TOP) - load(x), x), rel=0.05)
    assert record.last.x == pytest.approx([2.4, 2.4], rel=1e-12) and not [
        s for s in record.states if TOP + 1e-3 < s.x[0] < far - 1e-3]


def test_failed_equations_end_the_run_with_their_reason():
    """Beyond a deflection of 1 the equations are undefined: the run ends in words, its states kept."""
    class Breaks(Arch):
        def residual(self, x, control, out):
            super().residual(x, control, out)
            if x.array_r[0] > 1:
                out.array_w[:] = np.nan

    with pytest.raises(fx.ConvergenceError, match="the equations are not defined there") as caught:
        followed(2.0, arch=Breaks)
    assert "deflection = 2 was not reached" in str(caught.value) and caught.value.diagnosis.limit_points
