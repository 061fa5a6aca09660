"""Contact at Gauss points of the facets: areas, derivatives, and the forces that contact at the nodes gives."""

import numpy as np
import pytest
from test_contact import cup
from test_derivatives import difference, random_state, residual

import formingx as fx
from formingx.discrete.problem import Problem


@pytest.mark.quick
@pytest.mark.parametrize("points", [1, 3, 4])
def test_areas_are_those_of_the_face(points):
    contact = Problem(cup("none", elements=(5, 1), points=points)).contacts[0]
    assert len(contact.points) == 5 * points
    assert contact.area.sum() == pytest.approx(np.pi * 10.0**2, rel=1e-12)
    assert contact.lengths.sum() == pytest.approx(10.0, rel=1e-12)
    assert contact.points[:, 1] == pytest.approx(0.3, rel=1e-12)


@pytest.mark.quick
@pytest.mark.parametrize("friction", ["none", "stick", 0.3])
def test_tangent_is_derivative_of_residual(friction):
    """A face all over the floor of a flat cup, some of its points in the ramp."""
    problem = Problem(cup(friction, elements=(4, 1), depth=0.05, fillet=0.0, points=3, ramp=0.5, penalty=3.0))
    x, d = random_state(problem, size=2e-3)
    assert np.sum(problem.contacts[0].tractions(x.array_r, 0.1).normal > 0) > 3
    out = problem.x.duplicate()
    problem.tangent(x, 0.1).mult(d, out)
    free = np.setdiff1d(np.arange(len(out.array_r)), problem.held)
    found = difference(residual(problem, 0.1), x, d, 1e-6)
    np.testing.assert_allclose(out.array_r[free], found[free], atol=2e-6 * np.abs(found).max())


def test_forces_are_those_of_contact_at_nodes():
    """A cup blown with friction: with as many elements, tool forces and thickness agree."""
    found = []
    for points in ("nodes", 3):
        path = fx.trace(cup(0.3, points=points), until=fx.pressure(8.0), step=fx.StepControl(target=8), progress=False)
        found.append((path.last.measures["tool_force"], path.profile().thickness_ratio.min()))
    assert found[1] == pytest.approx(found[0], rel=1e-2)


def test_what_needs_nodes_says_so():
    path = fx.trace(cup("none", elements=(5, 1), points=2), until=fx.pressure(0.1), progress=False)
    with pytest.raises(fx.InputError, match="acts at Gauss points"):
        path.contact()
    with pytest.raises(fx.InputError, match="points"):
        cup("none", points=0)
