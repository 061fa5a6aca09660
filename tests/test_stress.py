"""Stresses of a state: homogeneous states, thick walls with their order, loaded and free faces, jumps at interfaces."""

import itertools

import numpy as np
import pytest
from conftest import run_json, treloar
from test_closed_forms import cylinder, tube

import formingx as fx
from formingx.exact.inflation import thick_sphere_limit_point, thick_wall
from formingx.problem.problem import Problem

STRETCH = 1.7
MATERIALS = [
    (fx.NeoHookean(c10=2.0), lambda s: 4 * (s**2 - 1 / s)),
    (fx.MooneyRivlin(c10=1.0, c01=0.5), lambda s: 2 * (s**2 - 1 / s) * (1 + 0.5 / s)),
    (fx.Ogden(mu=(1.0, -0.2), alpha=(3.0, -1.5)), lambda s: s**3 - s**-1.5 - 0.2 * (s**-1.5 - s**0.75))]


@pytest.mark.parametrize("material, true_stress", MATERIALS, ids=lambda m: type(m).__name__)
def test_uniaxial_tension(material, true_stress):
    """All stress measures of a homogeneous state, at quadrature points and projected."""
    path = fx.trace(cylinder(material), until=fx.travel(2.0 * (STRETCH - 1)))
    field, s = path.stress(), true_stress(STRETCH)
    for stress in (field.at_points([(0.0, 0.3), (0.4, 1.1), (1.0, 2.0)]), field.at_quadrature_points("sheet")):
        n = len(stress.points)
        assert stress.cauchy == pytest.approx(np.broadcast_to(np.diag([0, s, 0]), (n, 3, 3)), abs=1e-7 * s)
        assert stress.first_piola[:, 1, 1] == pytest.approx(s / STRETCH, rel=1e-7)
        assert stress.second_piola[:, 1, 1] == pytest.approx(s / STRETCH**2, rel=1e-7)
        assert stress.hydrostatic_pressure == pytest.approx(-s / 3, rel=1e-7)
        assert stress.principal_stresses[:, 0] == pytest.approx(s, rel=1e-7)
        assert stress.principal_stretches == pytest.approx(np.tile([STRETCH, *[STRETCH**-0.5] * 2], (n, 1)), rel=1e-7)


@pytest.mark.parametrize("keeping", [fx.MixedPressure(eps=1e-6), fx.DisplacementPenalty(eps=1e-6)],
                         ids=["mixed", "displacements only"])
def test_penalties_have_a_pressure_too(keeping):
    """The part of the stress that the penalty carries is taken where the penalty is integrated."""
    path = fx.trace(cylinder(fx.NeoHookean(c10=2.0), keeping), until=fx.travel(2.0 * (STRETCH - 1)))
    s = MATERIALS[0][1](STRETCH)
    for stress in (path.stress().at_points([(0.5, 0.5)]), path.stress().at_quadrature_points()):
        assert np.abs(stress.cauchy - np.diag([0, s, 0])).max() < 1e-5 * s


def sphere(n, material=None):
    mesh = fx.mesh.sphere(inner_radius=1.0, thickness=1.0, elements=(2 * n, n))
    return fx.Scene(mesh=mesh, materials=material or fx.NeoHookean(c10=1.5), loads=[fx.Pressure("inner")],
                    supports=[fx.Symmetry("axis"), fx.Symmetry("equator", normal="z")])


def wall_errors(stress, kind, stretch, constants):
    """Relative errors (root mean square) of normal and hoop stress and pressure at points of the wall."""
    R = stress.points[:, 0] if kind == "tube" else np.hypot(*stress.points.T)
    direction = np.array([1.0, 0.0]) if kind == "tube" else stress.points
    face, exact = stress.on_face(direction), thick_wall(kind, stretch, inner_radius=1, outer_radius=2, R=R, **constants)
    pairs = [(face.normal, exact.radial), (face.hoop, exact.hoop),
             (stress.hydrostatic_pressure, exact.hydrostatic_pressure)]
    return np.array([np.sqrt(np.mean((a - b) ** 2) / np.mean(b**2)) for a, b in pairs])


@pytest.mark.parametrize("kind", ["tube", "sphere"])
def test_thick_wall_converges(kind):
    """Stress and hydrostatic pressure against the exact solution, raw and projected: order 1.8 or more."""
    constants = {"c10": 1.0, "c01": 0.5 if kind == "tube" else 0.05}
    material, at = fx.MooneyRivlin(**constants), (1.0, 0.25 if kind == "tube" else 0.0)
    raw, projected = [], []
    for n in (6, 12):
        scene = tube((n, n // 2), material) if kind == "tube" else sphere(n, material)
        field = fx.trace(scene, until=fx.displacement(0.5, at=at, component="r")).stress()
        points = field.at_quadrature_points()
        raw.append(wall_errors(points, kind, 1.5, constants))
        projected.append(wall_errors(field.at_points(points.points), kind, 1.5, constants))
    for errors in (raw, projected):
        orders = np.log2(errors[0] / errors[1])
        assert errors[1].max() < 5e-3 and orders.min() > 1.8, (errors, orders)


def test_plane_strain_is_the_tube_too():
    """A quarter of the cross-section in plane strain: curved edges, a stress out of plane, the same exact solution."""
    mesh = fx.mesh.sphere(inner_radius=1.0, thickness=1.0, elements=(16, 8))
    constants = {"c10": 1.0, "c01": 0.5}
    scene = fx.Scene(mesh=mesh, materials=fx.MooneyRivlin(**constants), kinematics=fx.PlaneStrain(),
                     supports=[fx.Symmetry("axis"), fx.Symmetry("equator", normal="z")], loads=[fx.Pressure("inner")])
    path = fx.trace(scene, until=fx.displacement(0.5, at=(1.0, 0.0), component="r"))
    stress = path.stress().at_quadrature_points()
    R = np.hypot(*stress.points.T)
    exact = thick_wall("tube", 1.5, inner_radius=1, outer_radius=2, R=R, **constants)
    assert path.last.measures["pressure"] == pytest.approx(exact.pressure, rel=1e-4)
    face = stress.on_face(stress.points)
    for found, sought in ((face.normal, exact.radial), (face.meridional, exact.hoop), (face.hoop, exact.third)):
        assert np.sqrt(np.mean((found - sought) ** 2)) < 5e-3 * np.abs(exact.hoop).max()


def test_thick_sphere_through_its_limit_point():
    """The exact curve to 1e-4 and its maximum to 1e-6, with 16 elements through the wall; order 2.8 or more."""
    size = {"inner_radius": 1.0, "outer_radius": 2.0, "c10": 1.5}
    stretch, exact = thick_sphere_limit_point(**size)
    errors, maxima = [], []
    for n in (8, 16):
        targets = [fx.displacement(u, at=(1.0, 0.0), component="r") for u in (0.2, 0.5, 1.0, 2.0)]
        path = fx.trace(sphere(n), until=targets[-1], intermediate=targets[:-1])
        pressures = [thick_wall("sphere", 1 + t.value, **size).pressure for t in targets]
        errors.append(max(abs(path.target_state(t).measures["pressure"] / pressure - 1)
                          for t, pressure in zip(targets, pressures)))
        limit, = path.limit_points
        maxima.append(abs(limit.measures["pressure"] / exact.pressure - 1))
        assert path.value(targets[0].bind(path.problem), limit) == pytest.approx(stretch - 1, rel=1e-3)
    assert errors[1] < 2e-5 and np.log2(errors[0] / errors[1]) > 2.8, errors
    assert maxima[1] < 1e-6, maxima


def test_pressure_on_curved_faces_is_integrated_exactly():
    """Degree 5 is exact there too: along an edge u and X are of degree 2, the area vector's tangent of degree 1."""
    class Finer(fx.Pressure):
        quadrature_degree = 15

    path = fx.trace(sphere(2), until=fx.displacement(0.5, at=(1.0, 0.0), component="r"))
    vectors = []
    for load in (fx.Pressure("inner"), Finer("inner")):
        scene = path.problem.scene
        problem = Problem(fx.Scene(mesh=scene.mesh, materials=scene.materials, supports=scene.supports, loads=[load]))
        x, out = problem.x.duplicate(), problem.x.duplicate()
        x.array_w[:] = path.last.x
        problem.control_derivative(x, 1.0, out)
        vectors.append(out.array_r.copy())
    assert vectors[0] == pytest.approx(vectors[1], abs=1e-13 * np.abs(vectors[1]).max())


def test_every_integral_has_a_quadrature_degree():
    """UFL's own estimate for the volume term is 14; p (J - 1) R is a polynomial of degree 5 on straight triangles."""
    forms = Problem(treloar((4, 1))).forms
    for form in (forms.residual, forms.control_derivative):
        assert all(i.metadata()["quadrature_degree"] == 5 for i in form.integrals())


def test_loaded_and_free_faces():
    """The projected normal stress is minus the pressure on the loaded face of a sheet, 0 on the free one."""
    path = fx.trace(treloar((40, 2)), until=fx.pole_stretch(2.0))
    pressure, R = path.last.measures["pressure"], np.linspace(0, 1.1, 12)
    field = path.stress()
    largest = field.at_points([(0.0, 0.041)]).principal_stresses[0, 0]
    for Z, sought in ((0.0, -pressure), (0.082, 0.0)):
        face = field.at_points(np.column_stack([R, np.full(12, Z)])).on_face((0, 1))
        assert np.abs(face.normal - sought).max() < 0.03 * pressure
        assert np.abs(face.shear).max() < 0.03 * pressure and pressure < 0.05 * largest


@pytest.fixture(scope="module")
def stack():
    """Four bonded layers of three materials, two of them the same body's neighbours twice removed."""
    soft, middle, hard = (fx.MooneyRivlin(c10=c, c01=c / 5) for c in (0.2, 0.5, 1.5))
    layers = {"a": middle, "b": soft, "c": hard, "d": soft}
    mesh = fx.mesh.disc(radius=19.1, thickness=dict.fromkeys(layers, 0.3), elements=(40, 1))
    scene = fx.Scene(mesh=mesh, materials=layers, loads=[fx.Pressure("bottom")],
                     supports=[fx.Symmetry("axis"), fx.SimplySupported("rim")])
    return fx.trace(scene, until=fx.pole_height(14.0))


@pytest.mark.thorough
def test_traction_is_continuous_across_interfaces_and_pressure_is_not(stack):
    field, pressure = stack.stress(), stack.last.measures["pressure"]
    R = np.linspace(0, 15, 16)
    for k, (below, above) in enumerate(itertools.pairwise("abcd"), 1):
        points = np.column_stack([R, np.full(len(R), 0.3 * k)])
        lower, upper = field.at_points(points, below), field.at_points(points, above)
        left, right = lower.on_face((0, 1)), upper.on_face((0, 1))
        assert np.abs(left.normal - right.normal).max() < 0.03 * pressure
        assert np.abs(left.shear - right.shear).max() < 0.03 * pressure
        assert np.all((left.normal > -pressure) & (left.normal < 0))
        assert np.abs(lower.hydrostatic_pressure - upper.hydrostatic_pressure).min() > 3 * pressure
        assert upper.principal_stretches == pytest.approx(lower.principal_stretches, rel=2e-3)
        # at the pole: the same equibiaxial stretch and the same normal stress on both sides
        l = lower.principal_stretches[0, 2]
        constants = [stack.problem.scene.materials[name].parameters for name in (below, above)]
        membrane = [2 * (l**2 - l**-4) * (c["c10"] + c["c01"] * l**2) for c in constants]
        jump = upper.hydrostatic_pressure[0] - lower.hydrostatic_pressure[0]
        assert jump == pytest.approx(2 / 3 * (membrane[0] - membrane[1]), rel=5e-3)


@pytest.mark.thorough
def test_quadrature_points_of_a_layer(stack):
    """As many as the rule has, all inside the layer; projected and raw stresses agree on average."""
    raw = stack.stress().at_quadrature_points("c")
    assert len(raw.points) == 80 * 7 and raw.points[:, 1].min() > 0.6 and raw.points[:, 1].max() < 0.9
    projected = stack.stress().at_points(raw.points, "c")
    inside = raw.points[:, 0] < 15
    difference = (projected.hydrostatic_pressure - raw.hydrostatic_pressure)[inside]
    assert np.sqrt(np.mean(difference**2)) < 0.01 * np.abs(raw.hydrostatic_pressure).max()


def test_wrong_requests(stack):
    field = stack.stress()
    with pytest.raises(fx.InputError, match="a membrane has no stress through its thickness"):
        fx.trace(treloar((8, 1), model=fx.Membrane()), until=fx.pole_stretch(1.2)).stress()
    with pytest.raises(fx.InputError, match="which layer.*'a', 'b', 'c', 'd'"):
        field.at_points([(0, 0.1)])
    with pytest.raises(fx.InputError, match="layer 'e' is not known; known: 'a'"):
        field.at_points([(0, 0.1)], "e")
    with pytest.raises(fx.InputError, match=r"\(R, Z\) = \(0, 0.1\) is not in the layer 'c'"):
        field.at_points([(0, 0.1)], "c")


RANKS = """
import json
import numpy as np
import formingx as fx
mesh = fx.mesh.disc(radius=5.0, thickness={"a": 0.3, "b": 0.3, "c": 0.3}, elements=(9, 2))
soft, hard = fx.NeoHookean(c10=0.3), fx.MooneyRivlin(c10=1.0, c01=0.2)
scene = fx.Scene(mesh=mesh, materials={"a": soft, "b": hard, "c": soft}, loads=[fx.Pressure("bottom")],
                 supports=[fx.Symmetry("axis"), fx.SimplySupported("rim")])
path = fx.trace(scene, until=fx.pole_height(2.0), progress=False)
field = path.stress()
R = np.linspace(0, 5, 7)
numbers = [path.last.measures["pressure"]]
for name, Z in (("a", 0.3), ("b", 0.3), ("b", 0.6), ("c", 0.6)):
    stress = field.at_points(np.column_stack([R, np.full(7, Z)]), name)
    numbers += [*stress.hydrostatic_pressure, *stress.principal_stretches.ravel(), *stress.on_face((0, 1)).normal]
raw = field.at_quadrature_points("b").hydrostatic_pressure
numbers += [len(raw), raw.mean()]
ball = fx.mesh.sphere(inner_radius=1.0, thickness={"x": 0.5, "y": 0.5}, elements=(6, 2))
scene = fx.Scene(mesh=ball, materials={"x": soft, "y": hard}, loads=[fx.Pressure("inner")],
                 supports=[fx.Symmetry("axis"), fx.Symmetry("equator", normal="z")])
path = fx.trace(scene, until=fx.displacement(0.5, at=(1.0, 0.0), component="r"), progress=False)
field = path.stress()
numbers += [path.last.measures["pressure"], *field.at_points([(0.9, 1.2)], "x").hydrostatic_pressure]
for error in (field.error(), field.error("y")):
    order = np.lexsort(np.round(error.points, 9).T)
    numbers += [error.total, error.relative, *error.cells[order], *error.volume[order]]
peak = field.peak()
numbers += [peak.value, *peak.point, peak.error, peak.doubtful_error, *field.peak(radii=(0.8, 1.6)).doubtful_point]
if path.problem.comm.rank == 0:
    print(json.dumps([float(n) for n in numbers]))
"""


@pytest.mark.thorough
def test_ranks_agree():
    serial, *others = [run_json(RANKS, ranks) for ranks in (1, 2, 3)]
    for other in others:
        assert other == pytest.approx(serial, rel=1e-8, abs=1e-9)


@pytest.mark.parametrize("stiff, layers", [(500.0, 2), (1000.0, 4)])
def test_stress_in_a_soft_layer_beside_a_stiff_one(stiff, layers):
    """Of a sphere whose inner layer is soft: the difference of hoop and radial stress, far below the mean stress, is
    that of the closed form mu (l^2 - l^-4), with the stretch l of each radius."""
    mesh = fx.mesh.sphere(inner_radius=1.0, thickness={"soft": 0.2, "stiff": 0.2}, elements=(16, layers))
    scene = fx.Scene(mesh=mesh, loads=[fx.Pressure("inner")],
                     supports=[fx.Symmetry("axis"), fx.Symmetry("equator", "z")],
                     materials={"soft": fx.NeoHookean(c10=0.5), "stiff": fx.NeoHookean(c10=stiff / 2)})
    path = fx.trace(scene, until=fx.pole_height(1.6), progress=False)
    field, angles = path.stress(), np.linspace(0.1, 1.45, 12)
    grown = float(np.mean(np.hypot(*path.profile().bottom.T) ** 3)) - 1.0
    for R in (1.0 + 1e-3, 1.1, 1.2 - 1e-3):
        n = np.column_stack([np.cos(angles), np.sin(angles)])
        sigma = field.at_points(R * n, "soft").cauchy
        l = (R**3 + grown) ** (1 / 3) / R
        difference = sigma[:, 2, 2] - np.einsum("ni,nij,nj->n", n, sigma[:, :2, :2], n)
        assert np.abs(sigma[:, 2, 2]).min() > 5 * difference.max()
        assert difference == pytest.approx(np.full(12, l**2 - l**-4), rel=0.06)
    assert field.error("soft").relative < 0.01
