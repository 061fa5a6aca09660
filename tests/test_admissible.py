"""Admissible shapes: hoop stretch and in-plane determinant are positive at and beside the quadrature points."""

import basix
import numpy as np
import pytest
import ufl
from conftest import run_json, treloar
from dolfinx import fem

import formingx as fx
from formingx import _compat
from formingx.forms import elements
from formingx.forms.admissible import Admissible
from formingx.problem.problem import Problem

HELD = {"loads": [fx.Pressure("bottom")], "materials": fx.NeoHookean(c10=1.0)}


def ring(space="P1dg", **scene):
    mesh = fx.mesh.disc(radius=10.0, inner_radius=2.0, thickness=1.0, elements=(8, 1))
    return Problem(fx.Scene(mesh=mesh, supports=[fx.Clamped("rim")], model=fx.MixedPressure(space=space), **HELD,
                            **scene))


def displaced(problem, u):
    """Set the displacement u(X), length, shape (2, n), at the nodes of the P2 part."""
    forms = problem.forms
    smooth = fem.Function(fem.functionspace(forms.domain, ("Lagrange", 2, (2,))))
    smooth.interpolate(lambda X: np.array(u(X[:2])) / forms.length)
    V, dofs = forms.space.sub(0).collapse()
    same = fem.Function(V)
    same.interpolate(_compat.compile_expression(smooth, _compat.interpolation_points(V)))
    forms.w.x.array[dofs] = same.x.array
    return Admissible(forms)


@pytest.mark.parametrize("space", ["P1", "P1dg"])
def test_hoop_stretch_and_determinant_equal_those_of_ufl(space):
    """On curved elements, with bubbles that are not 0, at every point: those of UFL."""
    scene = fx.Scene(mesh=fx.mesh.sphere(inner_radius=1.0, thickness=0.5, elements=(3, 2)),
                     supports=[fx.Symmetry("axis"), fx.Symmetry("equator", normal="z")], loads=[fx.Pressure("inner")],
                     materials=fx.NeoHookean(c10=1.0), model=fx.MixedPressure(space=space))
    problem = Problem(scene)
    forms, rng = problem.forms, np.random.default_rng(3)
    forms.w.x.array[:] = 0.03 * rng.standard_normal(forms.w.x.array.size)
    inside = basix.make_quadrature(basix.CellType.triangle, scene.quadrature_degree)[0]
    F = forms.F
    found = Admissible(forms).quantities()
    cells = np.arange(forms.domain.topology.index_map(2).size_local, dtype=np.int32)
    for quantity, form in (("in-plane determinant", F[0, 0] * F[1, 1] - F[0, 1] * F[1, 0]), ("hoop stretch", F[2, 2])):
        expected = _compat.compile_expression(ufl.as_vector([form, 0]), inside).eval(forms.domain, cells)
        expected = expected.reshape(len(cells), -1, 2)[..., 0]
        assert found[quantity][:, : len(inside)] == pytest.approx(expected, abs=1e-12)


def test_stored_values_are_renewed_for_other_fields():
    """The values of the last fields are stored; other fields have other values."""
    problem = ring()
    body = displaced(problem, lambda X: (0 * X[0], 0 * X[0]))
    before = body.quantities()
    assert body.quantities() is before and body.holds()
    displaced(problem, lambda X: (0 * X[0], -2 * X[1]))
    after = body.quantities()
    assert not body.holds()
    assert after["in-plane determinant"].max() < 0 < before["in-plane determinant"].min()


def smallest_J(problem):
    """det F where the energy looks."""
    problem.fill(problem.x, problem.forms.w.x.array[:problem.n_owned])
    return elements.body(problem, problem.x, 0.0).J.min()


def test_a_ring_pushed_through_the_axis_is_inadmissible():
    """A ring pushed through the axis: J > 0 everywhere, both of its factors negative there."""
    problem = ring()
    whole = displaced(problem, lambda X: (0 * X[0] + 0.1, 0 * X[0]))
    assert whole.holds() and whole.minimum().value == pytest.approx(1.0)
    # r = (R - 4)(R - 1)/10: 2 < R < 2.5 lies beyond the axis, where r falls with R
    body = displaced(problem, lambda X: ((X[0] - 4) * (X[0] - 1) / 10 - X[0], 0 * X[0]))
    assert smallest_J(problem) < 0                          # 2.5 < R < 4 turns inside out
    assert not body.holds()
    turned = displaced(problem, lambda X: (-2 * X[0], 0 * X[0]))
    assert smallest_J(problem) == pytest.approx(1.0)
    assert not turned.holds() and turned.minimum().value == pytest.approx(-1.0)


def test_negative_determinant_between_quadrature_points_is_found():
    """A midpoint moved along its edge: det < 0 near a corner, det F > 0 where the energy looks."""
    problem = ring("P1")
    forms = problem.forms
    dofs = Admissible(forms).dofs[1]
    nodes = forms.space.sub(0).sub(1).collapse()[0].tabulate_dof_coordinates()[:, :2]
    collapsed = _compat.collapsed(forms.space.sub(0).sub(1))[1]
    edge = collapsed[np.argmin(np.hypot(nodes[:, 0] - 10, nodes[:, 1] - 0.5))]          # on the rim, along Z
    assert edge in dofs
    for share, good in ((0.2, True), (0.33, False)):
        forms.w.x.array[:] = 0
        forms.w.x.array[edge] = share / forms.length
        body = Admissible(forms)
        assert smallest_J(problem) > 0 and body.holds()
        assert (body.minimum().value > 0) is good
    least = body.minimum()
    assert least.quantity == "in-plane determinant" and -0.1 < least.value < 0
    assert least.point == pytest.approx((10.0, 1.0), abs=0.1)


def test_the_axis_has_the_limit_of_the_hoop_stretch():
    problem = Problem(treloar())
    body = displaced(problem, lambda X: (0.5 * X[0], 3.0 * X[1]))
    assert body.holds() and body.minimum().value == pytest.approx(1.5)
    body = displaced(problem, lambda X: (-1.5 * X[0], -3.0 * X[1]))     # det > 0, turned by half a revolution
    assert not body.holds() and body.minimum().value == pytest.approx(-0.5)


def test_membranes_and_plane_strain():
    flat = ring(kinematics=fx.PlaneStrain())
    assert displaced(flat, lambda X: (-20 + 0 * X[0], 0 * X[0])).holds()             # R is no radius here
    membrane = Problem(treloar(model=fx.Membrane()))
    membrane.forms.w.x.array[:] = 0
    assert Admissible(membrane.forms).holds()
    dofs = Admissible(membrane.forms).dofs[0]
    membrane.forms.w.x.array[dofs[-1]] = -1.1
    assert Admissible(membrane.forms).minimum().quantity == "hoop stretch" and not Admissible(membrane.forms).holds()


def test_fields_with_nan_are_inadmissible():
    problem = ring()
    problem.forms.w.x.array[:] = np.nan
    assert not Admissible(problem.forms).holds() and np.isnan(Admissible(problem.forms).minimum().value)


RANKS = """
import json
import numpy as np
import formingx as fx
from formingx import _compat
from formingx.forms import elements
from formingx.forms.admissible import Admissible
from formingx.problem.problem import Problem
mesh = fx.mesh.disc(radius=1.0, thickness=0.2, elements=(8, 1))
scene = fx.Scene(mesh=mesh, materials=fx.NeoHookean(c10=1.0), loads=[fx.Pressure("bottom")],
                 supports=[fx.Symmetry("axis"), fx.SimplySupported("rim")], model=fx.MixedPressure(space="P1"))
problem = Problem(scene)
V, dofs = problem.forms.space.sub(0).sub(0).collapse()
R = V.tabulate_dof_coordinates()[:, 0]
problem.forms.w.x.array[np.array(dofs)] = -0.6 * R**2
body = Admissible(problem.forms)
if scene.mesh.comm.rank == 0:
    print(json.dumps([*body.minimum()]))
else:
    body.minimum()
"""


@pytest.mark.thorough
def test_ranks_agree():
    serial = run_json(RANKS, 1)
    assert serial[0] == "in-plane determinant" and serial[1] == pytest.approx(-0.2) and serial[2][0] == pytest.approx(1)
    assert run_json(RANKS, 2)[:2] == [serial[0], pytest.approx(serial[1])]
