"""The local problem of a few contact points: a point at the outer edge of the ramp of its law, open or sticking."""

from types import SimpleNamespace

import numpy as np
import pytest
from mpi4py import MPI
from petsc4py import PETSc
from scipy import optimize

import formingx as fx
from formingx import tools
from formingx.contact.face import Increment
from formingx.physics.contact_law import Law
from formingx.solve import local_contact

THETA, K = 1e-3, 1e4
"""Half-width of the ramp, and the penalty."""


class Face:
    """One point on a tool whose face is z = 0, the solid above."""

    def __init__(self, slip):
        law = Law(tools.Tool([(0.0, 0.0), (9.0, 0.0)]), np.full(1, np.inf), np.full(1, K), THETA, 1e-3)
        here = np.array([[4.0, -0.5 * THETA]])
        history = law.start(here - [[slip, 0.0]])
        self.points, self.scale, self.law, self.comm = here, np.ones(1), law, MPI.COMM_SELF
        self.increment = Increment(law, history, here)
        self.increment.tractions(here)
        self.increment.linearise(here)

    def relative_motion(self, dx, step):
        return dx[None]


@pytest.mark.parametrize("coupling", [0.5, 0.6, 0.9])
@pytest.mark.parametrize("inside", [3e-4, 1e-3, 3e-3])
def test_a_point_that_is_pulled_along_its_tool_and_hardly_pressed_to_it(inside, coupling):
    """A body with a compliance C that would end so far inside without contact, while what holds the point along the
    tool pulls it out: the state, a root of one equation for its depth, is at the foot of the ramp."""
    C = np.array([[1.0, coupling], [coupling, 1.0]])
    face, free = Face(slip=0.3), np.array([0.1, -0.5 * THETA + inside])
    f0, S0 = face.increment.last.force[0], face.increment.last.stiffness[0]
    tangent = np.eye(2) + C @ S0                            # that of the body with the law as it was linearised
    contact = SimpleNamespace(faces=[face], unit_forces=lambda chosen: np.eye(2))
    problem = SimpleNamespace(comm=MPI.COMM_SELF, contact=contact)
    solver = SimpleNamespace(solve_all=lambda E: np.linalg.solve(tangent, C @ E))
    law = face.increment.after

    def along(depth):
        """Motion with a depth, in equilibrium along the tool, where forces are linear."""
        a, b = ((free - C @ forces(np.array([r, depth])))[0] - r for r in (0.0, 1.0))
        return np.array([a / (a - b), depth])

    def forces(y):
        there = law(y.reshape(1, 2))
        return there.force.ravel() + there.stiffness[0] @ y
    depth = optimize.brentq(lambda z: z - (free - C @ forces(along(z)))[1], -0.6 * THETA, 1.0, xtol=1e-16, rtol=1e-15)
    assert depth == pytest.approx(-0.5 * THETA, abs=1e-3 * THETA)
    dx = PETSc.Vec().createSeq(2)
    dx.array_w[:] = np.linalg.solve(tangent, free - C @ f0)
    points = local_contact._Points(problem, [np.array([0])], solver, lambda V: np.zeros(V.shape[1]))
    found = points.solve(dx, 0.0)
    assert found is not None
    assert dx.array_r + found[0] == pytest.approx(along(depth), abs=1e-3 * THETA)


def test_sliding_points_settle():
    """A bottle that slides in its mould: few steps fail. At a kink of Coulomb's law full corrections go to and fro."""
    mould = tools.bottle(radius=3.0, height=10.0, neck=1.5, shoulder=2.0, neck_height=1.5, base=-2.9, fillet=0.8,
                         shoulder_fillet=0.8)
    scene = fx.Scene(mesh=fx.mesh.parison(inner_radius=1.1, thickness=0.3, length=10.6, elements=(24, 1)),
                     materials=fx.MooneyRivlin(c10=50.0, c01=15.0), loads=[fx.Pressure("inner")],
                     supports=[fx.Symmetry("axis"), fx.Clamped("neck")], contacts=[fx.Contact("outer", mould, 0.3)])
    path = fx.trace(scene, until=fx.pressure(200.0), step=fx.StepControl(target=8), progress=False)
    assert path.counts.failures <= 5                        # of 50 steps; 11 of 78 without halved corrections
