"""The second variation against tangents, rigid motions and energies; critical points against exact bifurcations."""

import numpy as np
import pytest
import scipy.sparse as sp
from conftest import run_json, treloar
from dolfinx import fem

import formingx as fx
import formingx.exact.stability as exact
from formingx.errors import InputError
from formingx.extensions.stability.second_variation import SecondVariation
from formingx.extensions.stability.top_load import _slenderness
from formingx.problem.problem import Problem


def sparse(matrix):
    pointers, columns, values = matrix.getValuesCSR()
    return sp.csr_matrix((values, columns, pointers), shape=matrix.getSize())


def ring(material, supports=None, **scene):
    mesh = fx.mesh.disc(radius=2.0, thickness=0.8, elements=(4, 2), inner_radius=0.5)
    return fx.Scene(mesh=mesh, materials=material, supports=supports or [fx.Clamped("rim")], **scene)


def column(nu, material=None, elements=(6, 16), half=False):
    """A solid cylinder between frictionless plates, or half of it."""
    height = np.pi / nu
    mesh = fx.mesh.disc(radius=1.0, thickness=height / 2 if half else height, elements=elements)
    return fx.Scene(mesh=mesh, materials=material or fx.NeoHookean(c10=1.0), supports=[
        fx.Symmetry("axis"), fx.Symmetry("bottom", "z", mirror=half), fx.PrescribedDisplacement("top", "z")])


def contact_scene():
    mesh = fx.mesh.disc(radius=1.0, thickness=0.2, elements=(8, 2))
    return fx.Scene(mesh=mesh, materials=fx.MooneyRivlin(c10=1.0, c01=0.3), loads=[fx.Pressure("top")],
                    supports=[fx.Symmetry("axis"), fx.Clamped("rim")],
                    contacts=[fx.Contact("bottom", fx.tools.plane(-0.3).reversed(), "none")])


@pytest.mark.parametrize("make, until", [
    (lambda: column(1.0, fx.Ogden(mu=(1.4, -0.3), alpha=(2.5, -2.0))), fx.travel(-0.3)),
    (lambda: treloar(), fx.pole_height(1.0)), (contact_scene, fx.pressure(4.0))],
    ids=["Ogden", "follower pressure", "contact"])
def test_second_variation_at_n_0_is_the_tangent(make, until):
    path = fx.trace(make(), until=until, progress=False)
    problem, variation = path.problem, SecondVariation(path.problem)
    with problem.state_context(path.last):
        n, free = problem.n_owned, np.ones(problem.n_owned, dtype=bool)
        free[problem.constrained] = False
        K = sparse(problem.tangent(problem.x, problem.control))[:n][:, :n][free][:, free]
        variation.fill(0)
        to_mode = variation._to_mode[:n][free]
        found = sparse(variation.matrix)[to_mode]
        # what pins a rigid motion is torsion here, of which the path knows nothing
        assert abs(found[:, to_mode] - (K + K.T) / 2).max() < 1e-12 * abs(K).max()
        assert abs(found[:, variation._unknowns[:, 2]]).max() == 0 or not problem.scene.contacts


@pytest.mark.parametrize("material", [
    fx.NeoHookean(c10=1.0), fx.Ogden(mu=(1.4, -0.3), alpha=(2.5, -2.0)),
    pytest.param(fx.Gent(mu=2.0, Jm=8.0), marks=pytest.mark.thorough),
    pytest.param(fx.Viscoelastic(fx.NeoHookean(c10=0.5), branches=[(1.0, 2.0)]), marks=pytest.mark.thorough)],
    ids=lambda m: type(m).__name__)
def test_rigid_motions_have_no_energy(material):
    """Torsion and a shift across the axis, which frictionless plates leave free, of a body that is compressed."""
    path = fx.trace(column(1.0, material, (3, 6)), until=fx.travel(-0.5), progress=False)
    variation = SecondVariation(path.problem)
    with path.problem.state_context(path.last):
        for n, free in ((0, 1), (1, 1), (2, 0)):
            variation.fill(n)
            assert len(variation.rigid_motions) == free
            variation._constrain_rigid = lambda: None
            matrix = sparse(variation.fill(n))
            for mode in variation.rigid_motions:
                assert np.abs(matrix @ mode).max() < 1e-10 * abs(matrix).max()
            del variation._constrain_rigid


@pytest.mark.parametrize("component", [pytest.param(0, marks=pytest.mark.thorough), 2], ids=["radial", "hoop"])
def test_spin_lowers_the_energy_of_a_mode(component):
    """By rho w^2/2 times the integral of the squared motion across the axis, in the radial and the hoop direction."""
    variation = {spin: SecondVariation(Problem(ring(fx.NeoHookean(c10=1.0), loads=[fx.CentrifugalLoad(3.0, spin)])))
                 for spin in (0.0, 0.7)}
    quadratic = []
    for found in variation.values():
        forms = found.problem.forms
        x = np.zeros(found.matrix.getLocalSize()[0])
        sub, dofs = found.space.sub(0).sub(component).collapse()
        mode = fem.Function(sub)
        mode.interpolate(lambda X: (2 - X[0]) * (0.3 + X[1]))
        x[np.asarray(dofs)] = mode.x.array / forms.length
        quadratic.append(x @ (sparse(found.fill(2)) @ x) * forms.stress * forms.volume)
    g, w = np.polynomial.legendre.leggauss(6)
    R, Z = np.meshgrid(1.25 + 0.75 * g, 0.4 + 0.4 * g, indexing="ij")
    squared = 2 * np.pi * R * np.outer(0.75 * w, 0.4 * w) * ((2 - R) * (0.3 + Z)) ** 2
    assert quadratic[1] - quadratic[0] == pytest.approx(-3.0 * 0.7 * squared.sum(), rel=1e-9)


def test_waves_along_the_depth_of_a_strip():
    """A motion V along the depth, k waves: 2 c10 |grad V|^2 + 4 c10 k^2 V^2 over an undeformed neo-Hookean strip."""
    mesh, k = fx.mesh.disc(radius=2.0, thickness=0.8, elements=(4, 2), inner_radius=0.5), 3.0
    variation = SecondVariation(Problem(fx.Scene(mesh=mesh, materials=fx.NeoHookean(c10=1.5),
                                                 kinematics=fx.PlaneStrain(), supports=[fx.Clamped("rim")])))
    forms, x = variation.problem.forms, np.zeros(variation.matrix.getLocalSize()[0])
    sub, dofs = variation.space.sub(0).sub(2).collapse()
    mode = fem.Function(sub)
    mode.interpolate(lambda X: (2 - X[0]) * (0.3 + X[1]))
    x[np.asarray(dofs)] = mode.x.array / forms.length
    quadratic = x @ (sparse(variation.fill(k)) @ x) * forms.stress * forms.volume
    g, w = np.polynomial.legendre.leggauss(6)
    R, Z = np.meshgrid(1.25 + 0.75 * g, 0.4 + 0.4 * g, indexing="ij")
    density = 2 * 1.5 * ((0.3 + Z) ** 2 + (2 - R) ** 2) + 4 * 1.5 * (k * (2 - R) * (0.3 + Z)) ** 2
    assert quadratic == pytest.approx((np.outer(0.75 * w, 0.4 * w) * density).sum(), rel=1e-9)


@pytest.mark.parametrize("ogden, same", [
    pytest.param(fx.Ogden(mu=2.0, alpha=2.0), fx.NeoHookean(c10=1.0), marks=pytest.mark.thorough),
    (fx.Ogden(mu=(2.0, -0.6), alpha=(2.0, -2.0)), fx.MooneyRivlin(c10=1.0, c01=0.3))], ids=["neo-Hooke", "Mooney"])
def test_second_variation_of_ogden_equals_that_of_special_cases(ogden, same):
    """At rest, where all stretches coincide, and far from it, on the same state."""
    one, two = (Problem(column(1.0, material, (3, 4))) for material in (ogden, same))
    a, b = SecondVariation(one), SecondVariation(two)
    for path in (fx.trace(two.scene, until=fx.travel(-1.2), progress=False),):
        for state in (path.states[0], path.last):
            for n in range(9):
                with one.state_context(state), two.state_context(state):
                    A, B = sparse(a.fill(n)), sparse(b.fill(n))
                assert abs(A - B).max() < 1e-8 * abs(B).max()


@pytest.mark.parametrize("n", [1, 2, 3])
@pytest.mark.parametrize("material", [pytest.param("Mooney", marks=pytest.mark.thorough), "Ogden"])
def test_second_variation_equals_differences_of_the_energy_in_three_dimensions(n, material):
    """Second difference of the energy of a body in space, in Cartesian coordinates, along a mode."""
    c10, c01, mu, alpha = 1.0, 0.3, 1.7, 3.2
    law = fx.MooneyRivlin(c10=c10, c01=c01) if material == "Mooney" else fx.Ogden(mu=mu, alpha=alpha)
    problem = Problem(ring(law, quadrature_degree=8))
    variation = SecondVariation(problem)
    L = problem.forms.length

    def base(R, Z):
        return 0.1 * R * Z + 0.05 * R, -0.2 * Z + 0.04 * R**2

    def mode(R, Z):
        return (2 - R) * (0.3 + Z), (2 - R) * (0.5 - 0.4 * Z + 0.2 * R), (2 - R) * (0.7 * Z - 0.1)
    for i in range(2):
        sub, dofs = problem.forms.space.sub(0).sub(i).collapse()
        f = fem.Function(sub)
        f.interpolate(lambda X, i=i: base(X[0], X[1])[i] / L)
        problem.forms.w.x.array[np.asarray(dofs)] = f.x.array
    p0 = 0.3
    problem.forms.w.x.array[np.asarray(problem.forms.space.sub(1).collapse()[1])] = p0 / problem.forms.stress
    problem.fill(problem.x, problem.forms.w.x.array)
    x = np.zeros(variation.matrix.getLocalSize()[0])
    X, Y, m = variation._X[:, 0], variation._X[:, 1], float(n == 1)
    for i in range(3):
        sub, dofs = variation.space.sub(0).sub(i).collapse()
        f = fem.Function(sub)
        f.interpolate(lambda P, i=i: mode(P[0], P[1])[i] / L + (i == 2) * m * mode(P[0], P[1])[0] / L)
        x[np.asarray(dofs)] = f.x.array
    assert len(X) == len(Y)
    quadratic = x @ (sparse(variation.fill(n)) @ x) * problem.forms.stress * problem.forms.volume

    g, w = np.polynomial.legendre.leggauss(10)
    R, Z = np.meshgrid(1.25 + 0.75 * g, 0.4 + 0.4 * g, indexing="ij")
    area = np.outer(0.75 * w, 0.4 * w) * R
    t = np.linspace(0, 2 * np.pi, 24, endpoint=False)
    place = np.stack(np.broadcast_arrays(R[..., None] * np.cos(t), R[..., None] * np.sin(t), Z[..., None]))

    def position(P, eps):
        R, t, Z = np.hypot(P[0], P[1]), np.arctan2(P[1], P[0]), P[2]
        (u, v), (U, W, V) = base(R, Z), mode(R, Z)
        r, h, z = R + u + eps * U * np.cos(n * t), eps * V * np.sin(n * t), Z + v + eps * W * np.cos(n * t)
        return np.stack([r * np.cos(t) - h * np.sin(t), r * np.sin(t) + h * np.cos(t), z])

    def energy(eps, d=1e-4):
        step = [d * np.eye(3)[j][:, None, None, None] for j in range(3)]
        F = np.stack([(8 * (position(place + s, eps) - position(place - s, eps))
                       - position(place + 2 * s, eps) + position(place - 2 * s, eps)) / (12 * d) for s in step], -1)
        F = np.moveaxis(F, 0, -2)
        C = np.swapaxes(F, -1, -2) @ F
        J, I1 = np.linalg.det(F), np.trace(C, axis1=-2, axis2=-1)
        I2 = (I1**2 - np.trace(C @ C, axis1=-2, axis2=-1)) / 2
        if material == "Mooney":
            W = c10 * (I1 - 3) + c01 * (I2 - 3) - 2 * (c10 + 2 * c01) * np.log(J)
        else:
            W = mu / alpha * (np.linalg.eigvalsh(C) ** (alpha / 2)).sum(-1) - mu * np.log(J)
        return float(((W + p0 * (J - 1)) * area[..., None]).sum() * 2 * np.pi / len(t))
    h = 2e-3
    second = (-energy(2 * h) + 16 * energy(h) - 30 * energy(0) + 16 * energy(-h) - energy(-2 * h)) / (12 * h**2)
    assert quadratic / 2 == pytest.approx(second, rel=2e-6)         # the mean of cos^2 is half that of 1


@pytest.mark.parametrize("nu, n", [(0.5, 1), (1.0, 1)])
def test_buckling_of_a_cylinder_is_exact(nu, n):
    path = fx.trace(column(nu, elements=(6, 24)), until=fx.travel(-0.35 * np.pi / nu), progress=False)
    loss = path.stability([n]).first
    assert loss.number == n and loss.solved
    assert 1 + loss.control / (np.pi / nu) == pytest.approx(exact.cylinder(nu, n), abs=1e-5)


@pytest.mark.parametrize("n", [0, 1])
def test_modes_that_cross_in_one_long_step(n):
    """A tube inflated in six states: the mode that is lost in the last step crosses another one there first."""
    ratio = 0.8
    mesh = fx.mesh.disc(radius=1.0, inner_radius=ratio, thickness=np.pi / 2, elements=(2, 10))
    scene = fx.Scene(mesh=mesh, materials=fx.NeoHookean(c10=0.5), loads=[fx.Pressure("inner")],
                     supports=[fx.Symmetry("bottom", "z"), fx.Symmetry("top", "z")])
    path = fx.trace(scene, until=fx.displacement(2.2 * ratio, at=(ratio, 0.0), component="r"), progress=False)
    (loss,) = path.stability([n], "all").critical_points
    inner = np.sqrt(1 + loss.state.measures["enclosed_volume"] / (np.pi * ratio**2 * np.pi / 2))
    assert len(path.states) < 10 and inner == pytest.approx(exact.inflated_tube(ratio, 2, n), rel=1e-4)


def test_symmetric_and_antisymmetric_modes_of_a_half_are_those_of_the_whole():
    """What a half cylinder loses, with its image and against it, is what the whole one loses."""
    whole, half = (fx.trace(column(0.2, elements=e, half=h), until=fx.travel(-d), progress=False)
                   for e, h, d in (((2, 32), False, 1.0), ((2, 16), True, 0.5)))
    a = [1 + loss.control / (np.pi / 0.2) for loss in whole.stability([1, 2]).critical_points]
    found = half.stability([1, 2])
    b = [1 + 2 * loss.control / (np.pi / 0.2) for loss in found.critical_points]
    assert a == pytest.approx(sorted(b, reverse=True), abs=1e-7) and len(a) == 2
    assert {loss.antisymmetric_about for loss in found.critical_points} == {None, "bottom"}


def test_ring_under_outer_pressure():
    A = 0.8
    mesh = fx.mesh.disc(radius=1.0, inner_radius=A, thickness=0.025, elements=(8, 1))
    scene = fx.Scene(mesh=mesh, materials=fx.NeoHookean(c10=0.5), loads=[fx.Pressure("rim")],
                     supports=[fx.Symmetry("bottom", "z"), fx.Symmetry("top", "z")])
    path = fx.trace(scene, until=fx.displacement(-0.02, at=(A, 0.0), component="r"), progress=False)
    found = path.stability(range(4))
    assert found.first.number == 2 and len(found.bifurcations) == 1
    assert found.first.control == pytest.approx(0.0112425992232, rel=2e-5)      # `exact.tube(0.8, 2)`
    assert repr(found.first).startswith("CriticalPoint(n=2, lost at pressure 0.0112")
    with pytest.raises(InputError, match="CriticalPoint.view3d: file 'mode.svg'"):
        found.first.view3d("mode.svg")
    with pytest.raises(InputError, match="^CriticalPoint.view3d: scale = 0: must be greater than 0"):
        found.first.view3d("mode.png", scale=0)


def test_a_limit_point_is_no_bifurcation():
    """A hinged sheet through its maximum of pressure: a limit point is none that alarms."""
    path = fx.trace(treloar(elements=(10, 2)), until=fx.pole_stretch(4.0), progress=False)
    found = path.stability(range(5))
    assert found.bifurcations == [] and [loss.limit_point for loss in found.critical_points] == [True]
    assert "limit point" in str(found)


@pytest.mark.thorough
def test_forming_a_pot_and_a_bottle_is_stable():
    """The pot of the README, plug and vacuum, and a bottle being blown: stretched everywhere, they stand."""
    pot = fx.tools.pot(mouth=38.0, base=28.0, depth=40.0, sheet=1.2, fillet=8.0, lip=3.0, nose=20.0)
    scene = fx.Scene(mesh=fx.mesh.disc(radius=40.0, thickness=1.2, elements=(30, 1)),
                     materials=fx.NeoHookean(c10=0.4), supports=[fx.Symmetry("axis"), fx.Clamped("rim")],
                     loads=[fx.Pressure("bottom", name="vacuum")],
                     contacts=[fx.Contact("top", pot.mould, "stick", separates=False, name="mould"),
                               fx.Contact("bottom", pot.plug, "none", direction=(0, 1), name="plug")])
    path = fx.Process(scene).run([fx.Stage("plug", control="plug", until=fx.travel(22.0)),
                                  fx.Stage("vacuum", control="vacuum", until=fx.pressure(0.09))],
                                 step=fx.StepControl(target=8), progress=False)
    assert path.stability(range(7), 12).bifurcations == []
    bottle = fx.tools.bottle(radius=3, height=10, neck=1.5, shoulder=2, neck_height=1.5, base=-2.9, fillet=0.8,
                             shoulder_fillet=0.8)
    scene = fx.Scene(mesh=fx.mesh.parison(inner_radius=1.1, thickness=0.3, length=10.6, elements=(40, 1)),
                     materials=fx.MooneyRivlin(c10=50.0, c01=15.0), loads=[fx.Pressure("inner")],
                     supports=[fx.Symmetry("axis"), fx.Clamped("neck")],
                     contacts=[fx.Contact("outer", bottle, "stick")])
    path = fx.trace(scene, until=fx.pressure(100.0), progress=False)
    assert path.stability(range(7), 12).bifurcations == []


@pytest.mark.parametrize("friction", ["none", 0.3, "stick"])
def test_a_sheet_under_a_plug_is_stable_with_friction(friction):
    """Coulomb friction makes the tangent unsymmetric; a sliding point is no unstable mode."""
    sheet = fx.mesh.disc(radius=33.0, thickness=0.8, elements=(30, 1))
    plug = fx.tools.cylinder(radius=19.2, z=0.8, fillet=8.0)
    scene = fx.Scene(mesh=sheet, materials=fx.NeoHookean(c10=0.3),
                     supports=[fx.Symmetry("axis"), fx.SimplySupported("rim")],
                     contacts=[fx.Contact("top", plug, friction, direction=(0, -1))])
    path = fx.trace(scene, until=fx.travel(6.0), progress=False)
    assert not path.limit_points and len(path.stability([0, 2]).critical_points) == 0


@pytest.mark.thorough
def test_membranes_and_loads_without_second_variation_are_refused():
    path = fx.trace(treloar(model=fx.Membrane()), until=fx.pole_height(1.0), progress=False)
    with pytest.raises(InputError, match="membrane"):
        path.stability([2])

    class Hanging(fx.Load):
        def virtual_work(self, body, value):
            return body.integral(value * body.du[1])
    path = fx.trace(ring(fx.NeoHookean(c10=1.0), loads=[Hanging()]), until=fx.displacement(0.01, at=(0.5, 0.0)),
                    progress=False)
    with pytest.raises(InputError, match="mode_work"):
        path.stability([2])
    with pytest.raises(InputError, match="whole"):
        path.stability([2.5])
    with pytest.raises(InputError, match="1e\\+09: waves that are shorter than the shortest edge"):
        path.stability([1e9])
    with pytest.raises(InputError, match="at least one"):
        path.stability([2], states=[])


RANKS = """
import json, numpy as np, formingx as fx
from mpi4py import MPI
mesh = fx.mesh.disc(radius=1.0, thickness=np.pi, elements=(4, 12))
scene = fx.Scene(mesh=mesh, materials=fx.NeoHookean(c10=1.0), supports=[fx.Symmetry("axis"), fx.Symmetry("bottom", "z"),
                 fx.PrescribedDisplacement("top", "z")])
path = fx.trace(scene, until=fx.travel(-1.2), progress=False)
found = path.stability(range(3))
if MPI.COMM_WORLD.rank == 0:
    print(json.dumps([[loss.number, loss.control, *loss.position] for loss in found.critical_points]))
"""


@pytest.mark.thorough
def test_ranks():
    one, two = run_json(RANKS, 1), run_json(RANKS, 2)
    assert np.array(one)[:, :2] == pytest.approx(np.array(two)[:, :2], rel=1e-8) and len(one) == 1


def test_deformed_mesh_is_the_deformed_body():
    """Its volume is that of the body, its boundaries are where the deformed ones were."""
    path = fx.trace(treloar(elements=(8, 1)), until=fx.pole_height(1.0), progress=False)
    mesh, old = path.deformed_mesh(), path.problem.scene.mesh
    assert mesh.layers.keys() == old.layers.keys() and mesh.boundaries.keys() == old.boundaries.keys()
    profile = path.profile()
    assert mesh.nodes_of("top")[-1] == pytest.approx(profile.top[-1], abs=1e-12)
    assert mesh.nodes_of("axis")[[0, -1], 1] == pytest.approx([profile.bottom[0, 1], profile.top[0, 1]], abs=1e-12)
    again = Problem(fx.Scene(mesh=mesh, materials=fx.NeoHookean(c10=2.0), supports=[
        fx.Symmetry("axis"), fx.SimplySupported("rim")], loads=[fx.Pressure("bottom")]))
    assert again.forms.volume == pytest.approx(path.problem.forms.volume, rel=1e-5)


def test_deformed_mesh_of_new_elements():
    """A blown sheet with new elements has its volume and its boundaries, and bears what the old one does."""
    path = fx.trace(treloar(elements=(16, 2)), until=fx.pole_height(1.0), progress=False)
    old, new = path.deformed_mesh(), path.deformed_mesh(size=0.03)
    assert new.boundaries.keys() == old.boundaries.keys() and new.layers.keys() == old.layers.keys()
    paths = [fx.trace(fx.Scene(mesh=mesh, materials=fx.NeoHookean(c10=2.0), supports=[
        fx.Symmetry("axis"), fx.SimplySupported("rim")], loads=[fx.Pressure("bottom")]), until=fx.pressure(0.1),
        progress=False) for mesh in (old, new)]
    one, two = (p.problem.forms.volume for p in paths)
    assert two == pytest.approx(one, rel=1e-8)
    one, two = (p.last.measures["enclosed_volume"] for p in paths)
    assert two == pytest.approx(one, rel=1e-3)
    with pytest.raises(InputError, match="size = 0: must be"):
        path.deformed_mesh(size=0)
    with pytest.raises(InputError, match="one layer"):
        layers = fx.mesh.disc(radius=2.0, thickness={"a": 0.1, "b": 0.1}, elements=(4, 1))
        fx.trace(fx.Scene(mesh=layers, materials=fx.NeoHookean(c10=1.0), loads=[fx.Pressure("bottom")], supports=[
            fx.Symmetry("axis"), fx.Clamped("rim")]), until=fx.pressure(0.01), progress=False).deformed_mesh(size=0.1)


def inflate(mesh, ratio):
    """A tube inflated at its length until its inner radius would be so much larger, were it even."""
    scene = fx.Scene(mesh=mesh, materials=fx.NeoHookean(c10=0.5), loads=[fx.Pressure("inner")],
                     supports=[fx.Symmetry("bottom", "z"), fx.Symmetry("top", "z")])
    return fx.trace(scene, until=fx.enclosed_volume(np.pi**2 * 0.8**2 * (ratio**2 - 1)), progress=False,
                    step=fx.StepControl(largest=0.03))


def test_branch_points_are_those_that_a_run_warns_of(caplog):
    """Half a sphere under outer pressure: three modes n = 0 are lost between 1 and 1.4 times Zoelly's pressure."""
    h, mu = 0.05, 1.0
    mesh = fx.mesh.sphere(inner_radius=1 - h / 2, thickness=h, elements=(24, 1))
    scene = fx.Scene(mesh=mesh, materials=fx.NeoHookean(c10=mu / 2), loads=[fx.Pressure("outer")],
                     supports=[fx.Symmetry("axis"), fx.Symmetry("equator", "z")])
    zoelly = 4 * mu * h**2                                   # 2 E (h/R)^2 / sqrt(3 (1 - nu^2))
    step = fx.StepControl(length=2e-3, largest=2e-3)
    path = fx.trace(scene, until=fx.pressure(1.2 * zoelly), intermediate=[fx.pressure(1.08 * zoelly)], step=step,
                    progress=False)
    path = fx.trace(scene, start=path, until=fx.pressure(1.4 * zoelly), step=step, progress=False)
    said = [record.getMessage() for record in caplog.records if "another path branches off" in record.getMessage()]
    found = path.branch_points
    assert len(found) == 3 and len(said) == 3
    for (before, behind), words in zip(found, said):
        assert f"between {path.record.describe(before)} and {path.record.describe(behind)}" in words
        assert 1.0 < before.measures["pressure"] / zoelly < behind.measures["pressure"] / zoelly < 1.4
    back = fx.trace(scene, start=path, until=fx.pole_height(0.0), step=step, progress=False)
    assert len(back.branch_points) == 6 and len(back.states) > len(path.states)


@pytest.mark.thorough
def test_imperfections_reduce_the_limit_load(caplog):
    """A tube that bulges from the start bears less, by the power 2/3 of its imperfection (Koiter, 1945)."""
    mesh = fx.mesh.disc(radius=1.0, inner_radius=0.8, thickness=np.pi, elements=(2, 10))
    path = inflate(mesh, 2.02)
    said = [record.getMessage() for record in caplog.records if "another path branches off" in record.getMessage()]
    caplog.clear()
    loss = path.stability([0]).first
    (before, behind), = path.branch_points
    assert before is loss.left and behind is loss.right
    assert len(said) == 1 and path.record.describe(before) in said[0] and said[0] in str(fx.check(path))
    bent = fx.with_imperfection(mesh, loss, 1e-2)
    assert np.abs(bent.nodes_of("inner")[:, 0] - 0.8).max() == pytest.approx(
        1e-2 * np.abs(loss.amplitudes[loss.points[:, 0] < 0.8 + 1e-9, 0]).max(), rel=1e-6)
    drops = []
    for amplitude in (2.5e-3, 5e-3, 1e-2):
        path = inflate(fx.with_imperfection(mesh, loss, amplitude), 2.1)
        drops.append(loss.control - max(limit.measures["pressure"] for limit in path.limit_points))
    assert not caplog.records                               # a limit point is none
    assert min(drops) > 0 and np.diff(np.log(drops)) / np.log(2) == pytest.approx([2 / 3] * 2, abs=0.05)
    with pytest.raises(InputError, match="of another mesh"):
        fx.with_imperfection(fx.mesh.disc(radius=1.0, thickness=0.3, elements=(3, 1)), loss, 0.1)


def test_hoop_resultants():
    """Of an even disc pushed in at its rim, of two layers: h dW/dl = 2 c10 h (l - l^-5); of a membrane at its pole."""
    mesh = fx.mesh.disc(radius=2.0, thickness={"one": 0.1, "two": 0.3}, elements=(4, (1, 2)))
    scene = fx.Scene(mesh=mesh, materials={"one": fx.NeoHookean(c10=1.0), "two": fx.NeoHookean(c10=5.0)}, supports=[
        fx.Symmetry("axis"), fx.Symmetry("bottom", "z"), fx.PrescribedDisplacement("rim", "r")])
    path = fx.trace(scene, until=fx.travel(-0.2), progress=False)      # a stretch of 0.9
    found = path.hoop_resultants()
    assert found.resultant == pytest.approx(2 * (0.1 + 5 * 0.3) * (0.9 - 0.9**-5), rel=1e-8)
    assert found.compressed.all() and found.minimum[0] == found.resultant.min()
    assert np.ptp(path.hoop_resultants(path.states[0]).resultant) == 0
    path = fx.trace(treloar((40, 1), model=fx.Membrane()), until=fx.pole_stretch(3.0), progress=False)
    found = path.hoop_resultants()
    c10, h = 2.0, 0.082
    assert found.points[0, 0] < 0.1 and not found.compressed.any()
    assert found.resultant[0] == pytest.approx(2 * c10 * h * (3 - 3.0**-5), rel=2e-3)
    strip = fx.Scene(mesh=fx.mesh.disc(radius=1.0, thickness=0.1, elements=(2, 1)), kinematics=fx.PlaneStrain(),
                     materials=fx.NeoHookean(c10=1.0), supports=[fx.Symmetry("axis", "r"),
                     fx.Symmetry("bottom", "z"), fx.PrescribedDisplacement("rim", "r")])
    with pytest.raises(InputError, match="plane strain"):
        fx.trace(strip, until=fx.travel(0.1), progress=False).hoop_resultants()


def test_a_run_stops_where_it_is_unstable():
    scene = column(1.0, elements=(4, 10))
    path = fx.trace(scene, until=fx.travel(-2.0), stop_at=fx.instability(modes=range(3)), progress=False)
    assert "1 waves become unstable" in path.ended
    before, last = (1 + state.measures["travel"] / np.pi for state in path.states[-2:])
    assert last < exact.cylinder(1.0, 1) < before
    with pytest.raises(InputError, match="stop_at"):
        fx.trace(scene, until=fx.travel(-0.1), stop_at=[1], progress=False)


def test_top_load_of_a_tube():
    """A short tube on a plate: its force grows, it buckles where the path says, and what is asked for is there."""
    mesh = fx.mesh.disc(radius=1.0, inner_radius=0.8, thickness=4.0, elements=(1, 12))
    found = fx.top_load(mesh, material=fx.NeoHookean(c10=1.0), travel=0.8, neck="top", foot="bottom", modes=[1, 2],
                        step=fx.StepControl(largest=0.1))
    assert found.largest_force > 0 and str(found).startswith("top load, elastic")
    for n in (1, 2):
        pair, loss = found.buckling(n), found.first_of(n)
        assert (pair is None) == (loss is None)
        if pair is not None:
            assert 0 < pair[1] <= 0.8
            assert np.interp(pair[1], found.travel, found.force) == pytest.approx(pair[0], rel=2e-2)
    whole = np.trapezoid(found.force, found.travel)
    assert 0 < found.energy <= whole * (1 + 1e-12)
    with pytest.raises(InputError, match="top_load: neck"):
        fx.top_load(mesh, material=fx.NeoHookean(c10=1.0), travel=0.8, modes=[1])
    ends = {"neck": "top", "foot": "bottom", "material": fx.NeoHookean(c10=1.0)}
    with pytest.raises(InputError, match="must be at least 0"):        # before anything is run
        fx.top_load(mesh, travel=0.8, modes=[-2], **ends)
    with pytest.raises(InputError, match="'bottom' does not reach it"):
        fx.top_load(mesh, travel=0.05, modes=[1], floor=fx.tools.plane(-9.0).reversed(), **ends)


def thin_tube(wall):
    """A thin tube of radius and length 1."""
    return fx.mesh.disc(radius=1 + wall / 2, inner_radius=1 - wall / 2, thickness=1.0, elements=(1, 24))


@pytest.mark.parametrize("wall", (0.01, pytest.param(0.003, marks=pytest.mark.thorough)))
def test_top_load_finds_the_first_mode_by_itself(wall):
    """Of a thin tube: the default numbers of waves enclose the first mode, which is solved for; walls set the steps."""
    press = {"material": fx.NeoHookean(c10=1.0), "neck": "top", "foot": "bottom", "travel": 0.9 * wall}
    found = fx.top_load(thin_tube(wall), **press)
    numbers = found.stability.numbers
    assert found.first.solved and 2 < found.first.number < numbers[-1] - 1 and len(numbers) > 0.8 / wall**0.5
    assert len(found.path) > 3 and "interpolated" not in str(found).split("first")[-1]
    # a smooth minimum of the force over the number of waves
    n = found.first.number
    forces = [found.buckling(k)[0] for k in (n - 2, n - 1, n, n + 1, n + 2)]
    assert np.all(np.diff(forces, 2) > 0)
    classical = 2 * np.pi * 3.0 * wall**2 / np.sqrt(3 * (1 - 0.25)) * 2       # E = 3 mu, mu = 2 c10; a free edge: half
    assert 0.2 * classical < forces[2] < classical


@pytest.mark.parametrize("elements", (12, 40))
def test_radius_over_wall_of_a_curved_body(elements):
    """The largest ratio of a parison is at its outer face, whose radius is 1 + h; edges round its end are curved."""
    for h in (0.3, 0.03, 0.003):
        body = fx.mesh.parison(inner_radius=1.0, thickness=h, length=2.0, elements=(elements, 1))
        scene = fx.Scene(mesh=body, materials=fx.NeoHookean(c10=1.0), loads=[fx.Pressure("inner")],
                         supports=[fx.Symmetry("axis"), fx.Clamped("neck")])
        assert _slenderness(scene) == pytest.approx((1 + h) / h, rel=1e-9)


def test_top_load_of_a_body_on_its_head():
    """A pot that was formed with its base up is pressed upwards; both give the same forces."""
    body = thin_tube(0.1)
    options = {"material": fx.NeoHookean(c10=1.0), "travel": 0.05, "modes": [2, 3]}
    upright, upside_down = (fx.top_load(body, neck=neck, foot=foot, **options)
                            for neck, foot in (("top", "bottom"), ("bottom", "top")))
    assert upright.up and not upside_down.up and upright.largest_force > 0.01
    assert upside_down.force == pytest.approx(upright.force, rel=1e-6)
    assert upside_down.travel == pytest.approx(upright.travel) and upside_down.travel[-1] == pytest.approx(0.05)
    assert upside_down.energy == pytest.approx(upright.energy, rel=1e-6)
    with pytest.raises(InputError, match="'top' does not reach it|without a force|starts inside"):
        fx.top_load(body, neck="bottom", foot="top", up=True, **options)


def test_branches_of_a_tube_are_images_of_each_other():
    """The two bulges of an inflated tube, one at each end, are as large at the same volume, and need less pressure."""
    ratio, length, critical = 0.8, np.pi, 1.98640828
    mesh = fx.mesh.disc(radius=1.0, inner_radius=ratio, thickness=length, elements=(2, 10))
    scene = fx.Scene(mesh=mesh, materials=fx.NeoHookean(c10=0.5), loads=[fx.Pressure("inner")],
                     supports=[fx.Symmetry("bottom", "z"), fx.Symmetry("top", "z")])
    path = fx.trace(scene, until=fx.displacement(1.02 * ratio, at=(ratio, 0.0), component="r"), progress=False)
    loss = path.stability([0]).first
    assert loss.state.measures["enclosed_volume"] == pytest.approx(
        np.pi * length * ratio**2 * (critical**2 - 1), rel=1e-4)
    ends = [fx.trace(scene, start=loss.branch(sense), until=fx.enclosed_volume(
        1.05 * loss.state.measures["enclosed_volume"]), progress=False).last for sense in (1, -1)]
    pressures = [end.measures["pressure"] for end in ends]
    assert pressures[0] == pytest.approx(pressures[1], rel=1e-9) and pressures[0] < loss.control
