"""The pressure spaces of the solid: equations, exact solutions, kept volumes, ranks."""

import basix.ufl
import numpy as np
import pytest
import ufl
from conftest import run_json, treloar
from dolfinx import fem
from test_derivatives import assert_derivatives, random_state, scene

import formingx as fx
from formingx import _compat
from formingx.forms.probes import probe
from formingx.problem.problem import Problem

SPACES = ["P0", "P1", "P1dg"]
TUBE_MODULUS = 2.0


def tube(elements, model):
    """A thick tube, inner radius 1, outer radius 2, no axial strain."""
    mesh = fx.mesh.disc(radius=2.0, inner_radius=1.0, thickness=1.0, elements=(elements, elements))
    return fx.Scene(mesh=mesh, materials=fx.NeoHookean(c10=TUBE_MODULUS / 2), loads=[fx.Pressure("inner")], model=model,
                    supports=[fx.Symmetry("bottom", "z"), fx.Symmetry("top", "z")])


@pytest.mark.parametrize("space, eps, kinematics", [
    ("P0", 0.0, fx.Axisymmetric()), ("P0", 1e-2, fx.PlaneStrain()), ("P1", 1e-2, fx.Axisymmetric()),
    ("P1dg", 1e-2, fx.Axisymmetric()), ("P1dg", 0.0, fx.PlaneStrain())])
def test_residual_and_tangent_are_derivatives(space, eps, kinematics):
    problem = Problem(scene(keeping=fx.MixedPressure(eps=eps, space=space), kinematics=kinematics,
                            loads=[fx.Pressure("bottom")]))
    assert_derivatives(problem, *random_state(problem, size=0.003))


@pytest.mark.parametrize("space, order, volume_order, last", [
    ("P0", 1.8, 0.95, 6e-5), ("P1", 2.85, 1.9, 2.5e-6), ("P1dg", 2.85, 1.9, 2.5e-6)])
def test_tube_converges_to_the_exact_pressure(space, order, volume_order, last):
    """p = mu (ln(la/lb) + (lb^-2 - la^-2)/2) at an inner stretch la = 1.5; J - 1 in the mean square."""
    la = 1.5
    lb = np.sqrt(1 + (la**2 - 1) / 4)
    exact = TUBE_MODULUS * (np.log(la / lb) + (lb**-2 - la**-2) / 2)
    errors = []
    for n in (8, 16):
        path = fx.trace(tube(n, fx.MixedPressure(space=space)), progress=False,
                        until=fx.displacement(la - 1, at=(1.0, 0.0), component="r"))
        errors.append([abs(path.last.measures["pressure"] / exact - 1), path.last.measures["volume_error"]])
    orders = np.log2(np.array(errors[0]) / errors[1])
    assert orders[0] > order and orders[1] > volume_order, orders
    assert errors[1][0] < last


@pytest.mark.parametrize("space", SPACES)
def test_discontinuous_pressures_keep_the_volume_of_each_element(space):
    path = fx.trace(treloar((10, 1), model=fx.MixedPressure(space=space)), until=fx.pole_stretch(3.0), progress=False)
    forms = path.problem.forms
    q = ufl.TestFunction(fem.functionspace(forms.domain, ("DG", 0)))
    change, volume = (fem.assemble_vector(forms.compile(f * q * forms.weight * forms.dx)).array
                      for f in (forms.J - 1, forms.constant(1.0)))
    assert (np.abs(change / volume).max() < 1e-9) == (space != "P1")


@pytest.mark.parametrize("space, error", [("P0", 1e-5), ("P1", 1.5e-6), ("P1dg", 1.5e-6)])
def test_limit_point_of_treloars_sheet(space, error):
    path = fx.trace(treloar((40, 2), model=fx.MixedPressure(space=space)), until=fx.pole_stretch(8.5), progress=False)
    limit, = path.limit_points
    assert limit.measures["pressure"] == pytest.approx(0.493271, abs=error)
    assert limit.measures["pole_stretch"] == pytest.approx(2.1950, abs=1e-3)
    assert path.counts.steps <= 25 and path.counts.iterations <= 150, path.counts


@pytest.mark.thorough
def test_pressure_jumps_between_layers_in_all_spaces():
    """Three spaces, one two-layer sheet; the mean pressures of the layers differ by what the layers' stresses do."""
    found = []
    for space in SPACES:
        mesh = fx.mesh.disc(radius=1.0, thickness={"soft": 0.05, "stiff": 0.05}, elements=(20, 2))
        given = fx.Scene(mesh=mesh, materials={"soft": fx.NeoHookean(c10=1.0), "stiff": fx.NeoHookean(c10=10.0)},
                         supports=[fx.Symmetry("axis"), fx.SimplySupported("rim")], loads=[fx.Pressure("bottom")],
                         model=fx.MixedPressure(space=space))
        path = fx.trace(given, until=fx.pole_height(0.8), progress=False)
        problem, forms = path.problem, path.problem.forms
        problem.x.array_w[:] = path.last.x
        problem.set_state(problem.x, path.last.control)
        fields = ufl.split(forms.w)
        means = []
        for name, tag in mesh.layers.items():
            p = fields[1 + forms.pressure_of[name]]
            means.append(forms.integral(p * forms.weight * forms.dx(tag)) / (forms.volume / 2))
        found.append([path.last.measures["pressure"], *means])
    reference = found[SPACES.index("P1")]
    for other in found:
        assert other[0] == pytest.approx(reference[0], rel=1e-3)
        assert other[1:] == pytest.approx(reference[1:], abs=1e-3 * np.abs(reference[1:]).max())
    assert abs(reference[2] / reference[1]) > 5


@pytest.mark.parametrize("space", SPACES)
def test_probe_reads_the_element_of_the_displacement(space):
    """In the middle of an element, where the bubble counts, and on an edge."""
    problem = Problem(tube(2, fx.MixedPressure(space=space)))
    x, _ = random_state(problem)
    problem.set_state(x, 0.0)
    geometry = problem.forms.domain.geometry
    corners = geometry.x[_compat.cell_nodes(problem.forms.domain)[0][:3], :2]
    points = np.array([corners.mean(axis=0), corners[:2].mean(axis=0), [0.5, 0.3, 0.2] @ corners])
    reference = np.array([[1 / 3, 1 / 3], [0.5, 0.0], [0.3, 0.2]])
    exact = _compat.compile_expression(problem.forms.u, reference).eval(
        problem.forms.domain, np.array([0], dtype=np.int32))
    at = probe(problem, points)
    assert at.displacement(x) == pytest.approx(exact.reshape(3, 2), rel=1e-12)
    factors = np.array([[1.0, -2.0], [0.5, 0.3], [0.1, 0.7]])
    row = problem.x.duplicate()
    problem.fill(row, at.row(factors))
    assert row.dot(x) * problem.forms.length == pytest.approx(np.sum(factors * exact.reshape(3, 2)), rel=1e-12)


def test_arc_length_does_not_depend_on_the_pressure_space():
    """A rigid motion is as long in all spaces, but for the ends, where P2 has lumped masses below 0 that count as 0."""
    sizes = []
    for space in SPACES:
        problem = Problem(tube(2, fx.MixedPressure(space=space)))
        problem.forms.w.x.array[:] = 0
        problem.forms.w.sub(0).interpolate(lambda X: np.ones((2, X.shape[1])))
        x = problem.x.duplicate()
        problem.fill(x, problem.forms.w.x.array)
        sizes.append(problem.inner(x, x))
    assert sizes[2] == pytest.approx(2.0, rel=1e-12) and sizes == pytest.approx([2.0] * 3, rel=0.01)
    bubble = basix.ufl.element("Bubble", "triangle", 3)
    assert problem.forms.displacement_element.dim == 6 + bubble.dim


SCRIPT = """
import json
import formingx as fx
numbers, counts = [], []
for space in ("P0", "P1", "P1dg"):
    mesh = fx.mesh.disc(radius=1.25, thickness={"a": 0.04, "b": 0.042}, elements=(12, 1))
    scene = fx.Scene(mesh=mesh, materials={"a": fx.NeoHookean(c10=2.0), "b": fx.NeoHookean(c10=1.1)},
                     supports=[fx.Symmetry("axis"), fx.SimplySupported("rim")], loads=[fx.Pressure("bottom")],
                     model=fx.MixedPressure(space=space))
    path = fx.trace(scene, until=fx.pole_stretch(3.0), intermediate=[fx.pressure(0.3)], progress=False)
    numbers += [*path["pressure"], *path["pole_height"], *path["strain_energy"], *path.profile().thickness_ratio]
    counts += [path.counts.steps, path.counts.iterations]
if path.problem.comm.rank == 0:
    print(json.dumps({"numbers": numbers, "counts": counts}))
"""


@pytest.mark.thorough
def test_ranks_agree_with_two_layers():
    serial, *others = [run_json(SCRIPT, ranks) for ranks in (1, 2, 3)]
    for other in others:
        assert other["counts"] == serial["counts"]
        assert other["numbers"] == pytest.approx(serial["numbers"], rel=1e-8)
