"""The membrane: its equations, membrane theory, the thin solid, and what it refuses."""

import numpy as np
import pytest
from conftest import run_json, treloar
from scipy.interpolate import CubicSpline
from test_derivatives import assert_derivatives, difference, random_state

import formingx as fx
from formingx.exact.inflation import membrane_inflation, membrane_limit_point
from formingx.problem.problem import Problem
from formingx.results.evaluate.tension import Tension

MATERIALS = [
    fx.NeoHookean(c10=2.0),
    fx.MooneyRivlin(c10=1.5, c01=0.4),
    fx.Ogden(mu=(1.4, -0.3), alpha=(2.5, -2.0)),
]


def sheet(elements=20, material=MATERIALS[0], thickness=0.01, on="bottom", supports=None, model=None, **scene):
    """A disc (or strip) of radius 1 under a pressure, as a membrane."""
    body = fx.mesh.disc(radius=1.0, thickness=thickness, elements=(elements, 1))
    return fx.Scene(mesh=body, materials=material, loads=[fx.Pressure(on)], model=model or fx.Membrane(),
                    supports=supports or [fx.Symmetry("axis"), fx.SimplySupported("rim")], **scene)


def trace(scene, until, **options):
    return fx.trace(scene, until=until, progress=False, **options)


@pytest.mark.parametrize("kinematics", [fx.Axisymmetric(), fx.PlaneStrain()], ids=lambda k: type(k).__name__)
@pytest.mark.parametrize("material", MATERIALS, ids=lambda m: type(m).__name__)
def test_residual_and_tangent_are_derivatives(material, kinematics):
    scene = sheet(4, material, kinematics=kinematics)
    problem = Problem(scene)
    assert_derivatives(problem, *random_state(problem))


@pytest.mark.parametrize("on", ["bottom", "top"])
def test_pressure_does_the_work_p_dV(on):
    problem = Problem(sheet(4, on=on))
    forms, (x, d) = problem.forms, random_state(problem, size=0.05)
    volume = fx.enclosed_volume(1.0).bind(problem)
    derivative = problem.x.duplicate()
    problem.control_derivative(x, 0.0, derivative)
    work = -derivative.dot(d) * forms.stress * forms.volume / forms.control_scale
    assert work == pytest.approx(difference(lambda y: volume.value(y, 0.0), x, d, 1e-5), rel=1e-8)


def test_limit_point_is_that_of_membrane_theory():
    """Adkins and Rivlin: p r0/(c10 h0) = 3.75835 at a pole stretch of 2.196; the pressure converges with order 4."""
    stretch, exact = membrane_limit_point(radius=1.0, thickness=0.01, c10=2.0)
    found = [trace(sheet(n), fx.pole_stretch(3.0)).limit_points[0].measures for n in (5, 10, 20, 40)]
    errors = np.array([m["pressure"] / exact.pressure - 1 for m in found])
    assert np.all(np.log2(errors[:-1] / errors[1:]) > 3.8) and abs(errors[-1]) < 1e-7
    assert found[-1]["pressure"] / 0.02 == pytest.approx(3.75835, abs=5e-6)
    assert found[-1]["pole_stretch"] == pytest.approx(stretch, rel=1e-4)
    assert found[-1]["pole_height"] == pytest.approx(1.174, abs=5e-4)


@pytest.mark.parametrize("c01", [0.0, 0.1])
def test_shape_converges_to_membrane_theory(c01):
    """At given pole heights: pressure and thickness everywhere, against the ordinary differential equation."""
    states = [membrane_inflation(s, radius=1.0, thickness=0.01, c10=1.0, c01=c01) for s in (1.25, 2.0, 4.0)]
    targets = [fx.pole_height(state.height) for state in states]
    errors = []
    for n in (10, 20, 40):
        path = trace(sheet(n, fx.MooneyRivlin(c10=1.0, c01=c01)), targets[-1], intermediate=targets[:-1])
        row = []
        for target, exact in zip(targets, states):
            profile = path.profile(path.target_state(target))
            thickness = CubicSpline(exact.R, exact.thickness_ratio)(np.maximum(profile.reference_radius, exact.R[0]))
            row += [path.target_state(target).measures["pressure"] / exact.pressure - 1,
                    np.abs(profile.thickness_ratio / thickness - 1).max()]
        errors.append(np.abs(row))
    orders = np.log2(errors[1] / errors[2])
    assert np.all(orders[::2] > 2.5) and np.all(orders[1::2] > 1.7), orders
    assert np.all(errors[2][::2] < 1e-5) and np.all(errors[2][1::2] < 3e-3), errors[2]


def test_table_of_a_mooney_disc():
    """Oden's disc (radius 7.5 in, 0.5 in thick, 80 and 20 psi) as a membrane: pressure in psi, pole height in in."""
    table = {10: 3.338, 20: 4.941, 30: 7.092, 40: 11.178, 45: 14.484}
    body = fx.mesh.disc(radius=7.5, thickness=0.5, elements=(40, 1))
    scene = fx.Scene(mesh=body, materials=fx.MooneyRivlin(c10=80.0, c01=20.0), loads=[fx.Pressure("bottom")],
                     supports=[fx.Symmetry("axis"), fx.SimplySupported("rim")], model=fx.Membrane())
    targets = [fx.pressure(p) for p in table]
    path = trace(scene, targets[-1], intermediate=targets[:-1])
    assert not path.limit_points
    for target, height in zip(targets, table.values()):
        assert path.target_state(target).measures["pole_height"] == pytest.approx(height, abs=1e-3)


@pytest.mark.parametrize("angle", [np.pi / 3, np.pi / 2])
def test_plane_strain_strip_is_an_arc(angle):
    """l = phi/sin phi, p = 2 (c10 + c01) (h0/a) (l - l^-3) sin phi, and the same thickness everywhere."""
    stretch = angle / np.sin(angle)
    exact = 2 * (1.5 + 0.4) * 0.01 * (stretch - stretch**-3) * np.sin(angle)
    errors = []
    for n in (5, 10, 20):
        path = trace(sheet(n, MATERIALS[1], kinematics=fx.PlaneStrain()), fx.pole_height(np.tan(angle / 2)))
        errors.append(abs(path.last.measures["pressure"] / exact - 1))
        assert not path.limit_points
    assert np.log2(errors[1] / errors[2]) > 3.5 and errors[2] < 1e-5
    assert path.profile().thickness_ratio == pytest.approx(np.full(41, 1 / stretch), rel=2e-3)
    assert path.last.measures["pole_stretch"] == pytest.approx(stretch, rel=2e-3)


def test_pressure_of_a_flat_membrane_grows_as_the_cube_of_the_height():
    """A flat membrane without stretch has no stiffness; nothing but its own geometry gives it one."""
    heights = (1e-4, 1e-3, 1e-2, 0.1)
    ratios = [trace(sheet(), fx.pole_height(h)).last.measures["pressure"] / h**3 for h in heights]
    assert ratios[0] == pytest.approx(ratios[1], rel=1e-5)
    assert ratios[1] == pytest.approx(ratios[2], rel=1e-3)
    assert ratios[3] < 0.98 * ratios[2]
    small = membrane_inflation(1.0001, radius=1.0, thickness=0.01, c10=2.0)
    assert ratios[2] == pytest.approx(small.pressure / small.height**3, rel=1e-3)


@pytest.mark.parametrize("length", [1e-3, 0.01, 1.0])
def test_first_step_does_not_matter(length):
    numbers = [trace(sheet(), fx.pole_stretch(4.0), step=fx.StepControl(length=first)).last.measures
               for first in (0.1, length)]
    for name in ("pressure", "pole_height", "enclosed_volume"):
        assert numbers[1][name] == pytest.approx(numbers[0][name], rel=1e-9)


@pytest.mark.parametrize("increments", [1, 4])
def test_fixed_pressure_steps_start_from_the_flat_membrane(increments):
    path = fx.solve(sheet(), to=0.04, increments=increments)
    traced = trace(sheet(), fx.pressure(0.04))
    assert path.last.measures["pole_height"] == pytest.approx(traced.last.measures["pole_height"], rel=1e-9)
    assert path.counts.iterations <= 6 * path.counts.steps


def test_thin_solid_tends_to_the_membrane():
    """The limit pressure of the solid, over thickness, differs from the membrane's as the square of the thickness."""
    def limit(thickness, model):
        path = trace(sheet(40, fx.NeoHookean(c10=1.0), thickness=thickness, model=model), fx.pole_stretch(2.4))
        return path.limit_points[0].measures["pressure"] / thickness

    membrane = limit(0.01, fx.Membrane())
    assert limit(0.2, fx.Membrane()) == pytest.approx(membrane, rel=1e-12)
    errors = np.array([limit(h, fx.MixedPressure()) / membrane - 1 for h in (0.1, 0.05, 0.025)])
    assert np.all(errors > 0) and errors[1] == pytest.approx(2.05e-4, rel=0.02)
    assert np.all(np.abs(np.log2(errors[:-1] / errors[1:]) - 2) < 0.1)


def test_only_the_model_changes():
    """Treloar's script with another model: same columns, same targets, profile and limit point."""
    models = fx.MixedPressure(), fx.Membrane()
    paths = [trace(treloar((20, 1), model=model), fx.pole_stretch(4.0)) for model in models]
    assert paths[0].columns == paths[1].columns
    limits = [path.limit_points[0].measures for path in paths]
    for name in ("pressure", "pole_height", "pole_stretch"):
        assert limits[1][name] == pytest.approx(limits[0][name], rel=1e-3)
    # a solid's volume is that under its lower face, a membrane's that under its mid-surface
    assert limits[1]["enclosed_volume"] == pytest.approx(limits[0]["enclosed_volume"], rel=0.1 * 0.082 / 1.25)
    ratios = [path.profile().thickness_ratio for path in paths]
    assert ratios[0].shape == ratios[1].shape
    assert np.abs(ratios[1] / ratios[0] - 1)[:-4].max() < 0.02
    assert ratios[1][0] == pytest.approx(1 / 16, rel=1e-9)
    assert np.abs(paths[1]["mass_error"]).max() < 1e-12 and np.abs(paths[1]["volume_error"]).max() < 1e-12


def test_layers_add_up():
    layers = {"lower": 0.004, "upper": 0.006}
    materials = {"lower": fx.NeoHookean(c10=1.0), "upper": fx.MooneyRivlin(c10=0.5, c01=0.2)}
    both = trace(sheet(material=materials, thickness=layers), fx.pole_stretch(3.0)).last.measures
    mean = trace(sheet(material=fx.MooneyRivlin(c10=0.7, c01=0.12)), fx.pole_stretch(3.0)).last.measures
    for name in ("pressure", "pole_height", "strain_energy"):
        assert both[name] == pytest.approx(mean[name], rel=1e-10)


def test_reference_volume_of_an_uneven_sheet(tmp_path):
    """A sheet thicker at the rim and bent: the mid-surface and its thickness come from the mesh alone."""
    import gmsh
    gmsh.initialize()
    try:
        gmsh.option.setNumber("General.Terminal", 0)
        geo = gmsh.model.geo
        points = [geo.addPoint(r, z, 0, 0.1) for r, z in ((0, 0.2), (1, 0), (1, 0.1), (0, 0.25))]
        lines = [geo.addLine(a, b) for a, b in zip(points, points[1:] + points[:1])]
        face = geo.addPlaneSurface([geo.addCurveLoop(lines)])
        geo.synchronize()
        gmsh.model.addPhysicalGroup(2, [face], name="sheet")
        for name, line in zip(("bottom", "rim", "top", "axis"), lines):
            gmsh.model.addPhysicalGroup(1, [line], name=name)
        gmsh.model.mesh.generate(2)
        gmsh.model.mesh.setOrder(2)
        gmsh.write(str(tmp_path / "cone.msh"))
    finally:
        gmsh.finalize()
    scene = fx.Scene(mesh=fx.mesh.read(tmp_path / "cone.msh"), materials=fx.NeoHookean(c10=1.0), model=fx.Membrane(),
                     supports=[fx.Symmetry("axis"), fx.SimplySupported("rim")], loads=[fx.Pressure("bottom")])
    path = trace(scene, fx.pole_height(0.5))
    exact = 2 * np.pi * (0.05 / 2 + 0.05 / 3)                 # of (h(0) + (h(1) - h(0)) R) R, h from 0.05 to 0.1
    assert path.problem.forms.volume == pytest.approx(exact, rel=1e-12)
    at_rest = path.profile(path.states[0])
    assert at_rest.thickness_ratio == pytest.approx(np.ones_like(at_rest.reference_radius), rel=1e-12)
    assert at_rest.bottom[:, 1] == pytest.approx(0.2 * (1 - at_rest.reference_radius), abs=1e-12)


@pytest.mark.parametrize("supports, on, words", [
    ([fx.Symmetry("axis"), fx.Clamped("rim")], "bottom", "no bending stiffness"),
    ([fx.Symmetry("axis"), fx.SimplySupported("rim"), fx.Symmetry("top", "z")], "bottom", "held at its ends only"),
    (None, "rim", "its upper face only"),
])
def test_supports_that_membranes_cannot_have_are_refused(supports, on, words):
    with pytest.raises(fx.InputError, match=words):
        Problem(sheet(supports=supports, on=on))


def test_no_stress_through_the_thickness():
    with pytest.raises(fx.InputError, match="nor between its layers"):
        Problem(sheet()).forms.bodies  # noqa: B018


def test_displacement_targets_off_the_mid_surface_are_refused():
    with pytest.raises(fx.InputError, match="mid-surface"):
        trace(sheet(), fx.displacement(0.1, at=(0.5, 0.0)))
    path = trace(sheet(), fx.displacement(0.1, at=(0.5, 0.005)))
    assert path.profile().middle[20, 1] == pytest.approx(0.105, rel=1e-6)


def test_unknown_model():
    with pytest.raises(fx.InputError, match="model = 'shell'"):
        sheet(model="shell")


SCRIPT = """
import json, sys
sys.path.insert(0, "tests")
import formingx as fx
from test_membrane import sheet, trace
path = trace(sheet(7, thickness={"a": 0.004, "b": 0.006}), fx.pole_stretch(3.0), intermediate=[fx.pressure(0.05)])
profile = path.profile()
numbers = [*path["pressure"], *path["pole_height"], *path["enclosed_volume"], *profile.thickness_ratio]
if path.problem.comm.rank == 0:
    print(json.dumps({"numbers": numbers, "counts": [path.counts.steps, path.counts.iterations]}))
"""


@pytest.mark.thorough
def test_ranks_agree():
    serial, *others = [run_json(SCRIPT, ranks) for ranks in (1, 2, 3)]
    for other in others:
        assert other["counts"] == serial["counts"]
        assert other["numbers"] == pytest.approx(serial["numbers"], rel=1e-9)


@pytest.mark.parametrize("alpha", [pytest.param(-5.0, marks=pytest.mark.thorough), -2.0])
def test_negative_ogden_exponents(alpha):
    """The solid with a negative exponent reaches the stretch of the membrane; with -2 it is the pure I2 solid."""
    material = fx.Ogden(mu=-2.0, alpha=alpha)
    solid, thin = (trace(sheet(40, material, thickness=0.05, model=model), fx.pole_stretch(2.5)).last.measures
                   for model in (fx.MixedPressure(), fx.Membrane()))
    assert solid["pressure"] == pytest.approx(thin["pressure"], rel=2e-3)
    if alpha == -2.0:
        mooney = trace(sheet(40, fx.MooneyRivlin(c10=0.0, c01=1.0), thickness=0.05, model=fx.MixedPressure()),
                       fx.pole_stretch(2.5)).last.measures
        assert solid["pressure"] == pytest.approx(mooney["pressure"], rel=1e-9)


@pytest.mark.parametrize("material", [MATERIALS[1], pytest.param(
    fx.Viscoelastic(MATERIALS[0], [(1.0, 1.0)]), marks=pytest.mark.thorough)], ids=["rubber", "relaxes"])
@pytest.mark.parametrize("stretch", [0.93, 1.04])
def test_compressive_resultants_are_reported(material, stretch, caplog, tmp_path):
    """A flat sheet whose rim moves: the resultant over mu h is (1 - l^-6)(c10 + l^2 c01)/(c10 + c01) all over."""
    body = fx.mesh.disc(radius=1.0, thickness={"a": 0.01, "b": 0.02}, elements=(4, 1))
    scene = fx.Scene(mesh=body, materials=material, model=fx.Membrane(),
                     supports=[fx.Symmetry("axis"), fx.PrescribedDisplacement("rim", "r"), fx.Symmetry("rim", "z")])
    try:
        path = trace(scene, fx.travel(stretch - 1))
    except fx.ConvergenceError as error:
        path = error.path
    least = Tension(path.problem).smallest(path.last)
    c10, c01 = (1.5, 0.4) if material is MATERIALS[1] else (1.0, 0.0)
    assert least.value == pytest.approx((1 - stretch**-6) * (c10 + stretch**2 * c01) / (c10 + c01), rel=1e-9)
    said = "membrane is in compression, first in state" in caplog.text
    assert said == least.compressed == (stretch < 1)
    assert ("membrane is in compression" in path.report(tmp_path / "run.html").read_text()) == said


def test_wall_at_an_element_boundary_is_the_mean_of_both_elements():
    """Which of them a point counts to is left to round-off: the wall is not."""
    walls = [trace(sheet(10, thickness=lambda R, k=k: 0.01 * (1 + 1e-6 * np.sin(k * R))), fx.pole_stretch(1.5))
             .profile().thickness for k in (0, 37, 61, 83)]
    assert abs(np.array(walls) / walls[0] - 1).max() < 1e-5


@pytest.mark.parametrize("plane_strain", (False, True))
@pytest.mark.parametrize("modulus", (0.03, 0.3))
def test_a_flat_membrane_sags_under_its_weight_and_is_blown_through(plane_strain, modulus):
    """It leaves the flat state under a constant weight; sag and height are those of a thin solid sheet."""
    def run(model):
        scene = fx.Scene(mesh=fx.mesh.disc(radius=100.0, thickness=1.0, elements=(10, 1)), model=model,
                         materials=fx.NeoHookean(c10=modulus / 2),
                         kinematics=fx.PlaneStrain() if plane_strain else None,
                         supports=[fx.Symmetry("axis", "r"), fx.SimplySupported("rim")],
                         loads=[fx.Gravity(1e-6, 9.81), fx.Pressure("bottom", name="air")])
        return fx.trace(scene, until=fx.pressure(1e-3 * modulus), progress=False)
    membrane, solid = run(fx.Membrane()), run(None)
    assert membrane["pole_height"][[0, -1]] == pytest.approx(solid["pole_height"][[0, -1]], rel=3e-3)
    assert membrane["pole_height"][0] < -2 and membrane["pole_height"][-1] > 15 and not membrane.limit_points


def between_pressures(model, constant=None):
    above = fx.Pressure("top", constant, name="above")
    return fx.Scene(mesh=fx.mesh.disc(radius=100.0, thickness=1.0, elements=(8, 1)), model=model,
                    materials=fx.NeoHookean(c10=0.01), supports=[fx.Symmetry("axis"), fx.SimplySupported("rim")],
                    loads=[above, fx.Pressure("bottom", name="below")])


@pytest.mark.parametrize("model", (fx.Membrane(), None))
def test_absolute_pressures_act_by_their_difference(model):
    """Both faces at 0.1, many times the modulus times thickness over radius, then one grows by 2e-5."""
    both = [(0.0, 0.0), (1.0, 0.1)]
    path = fx.Process(between_pressures(model)).run([
        fx.Stage("both", amplitudes={"above": both, "below": both}),
        fx.Stage("blow", control="below", until=fx.pressure(0.1 + 2e-5))], progress=False)
    alone = fx.Scene(mesh=path.scene.mesh, model=model, materials=path.scene.materials, supports=path.scene.supports,
                     loads=[fx.Pressure("bottom")])
    exact = fx.trace(alone, until=fx.pressure(2e-5), progress=False)["pole_height"][-1]
    assert path["pole_height"][-1] == pytest.approx(exact, rel=1e-8 if model else 5e-4)
    assert not path.limit_points and not path.branch_points


def test_a_constant_pressure_before_the_driven_one_is_named():
    with pytest.raises(fx.ConvergenceError, match="only their difference deforms the body. Give the difference alone"):
        fx.trace(between_pressures(None, 0.1), until=fx.pressure(0.1001), progress=False)
