"""Bad input: an error that names the thing, its value and what is allowed, before any solve."""

import math
from decimal import Decimal
from fractions import Fraction

import numpy as np
import pytest
from conftest import treloar

import formingx as fx

MESH = {"radius": 1.0, "thickness": 0.1, "elements": (4, 1)}
NONE = np.array([])


@pytest.mark.parametrize("change, words", [
    ({"radius": 0.0}, "radius = 0.0.*greater than 0"),
    ({"radius": math.nan}, "radius = nan.*finite"),
    ({"radius": "wide"}, "radius = 'wide'.*number"),
    ({"thickness": -0.1}, "thickness.*-0.1.*greater than 0"),
    ({"thickness": {}}, "at least one layer"),
    ({"elements": (0, 1)}, "elements along the radius = 0.*at least 1"),
    ({"elements": (4, 1.5)}, "elements.*1.5.*whole number"),
    ({"elements": 4}, "elements = 4.*along the radius"),
    ({"grading": 0}, "grading = 0.*greater than 0"),
    ({"inner_radius": 2.0}, "inner_radius = 2.0.*below radius"),
    ({"thickness": {"a": 1, "b": 1}, "elements": (4, (1, 1, 1))}, "2 layers need as many"),
])
def test_mesh(change, words):
    with pytest.raises(fx.InputError, match=words):
        fx.mesh.disc(**{**MESH, **change})


@pytest.mark.parametrize("make, words", [
    (lambda: fx.NeoHookean(c10=0.0), "no stiffness"),
    (lambda: fx.NeoHookean(c10=-1.0), "no stiffness"),
    (lambda: fx.NeoHookean(c10=math.inf), "finite"),
    (lambda: fx.mesh.read("a\0b.msh"), "must be the name of a file"),
    (lambda: fx.MooneyRivlin(c10=1.0, c01=-0.1), "not stable.*c01"),
    (lambda: fx.MooneyRivlin(c10=0.0, c01=0.0), "no stiffness"),
    (lambda: fx.Yeoh(c10=1.0, c20=-1e300, c30=0.1), "c20 greater than .* = -0.547"),
    (lambda: fx.Ogden(mu=(1.0, 1.0), alpha=(2.0,)), "as many"),
    (lambda: fx.Ogden(mu=(1.0, 0.1), alpha=(2.0, -2.0)), "not stable.*mu alpha > 0"),
    (lambda: fx.Hyperelastic(lambda I1, I2, a: a * (3 - I1), a=1.0), "no stiffness"),
    (lambda: fx.Hyperelastic(lambda I1, I2, a: a * I1, b=1.0), r"constants \['a'\]"),
    (lambda: fx.Hyperelastic(lambda I1, I2: None), "energy fails"),
    (lambda: fx.Hyperelastic(lambda I1, I2, a: a[0], a=1.0), "energy fails: .*"),
    (lambda: fx.Hyperelastic(lambda F: F, of="F"), r"shape \(3, 3\): must be a UFL scalar"),
    (lambda: fx.Hyperelastic("I1 - 3"), "energy = 'I1 - 3'.*function"),
    (lambda: fx.Ogden(mu=np.array("x"), alpha=2.0), "must be a number"),
    (lambda: fx.displacement(1.0, at=(0, 0), component=np.array([1.0, 2.0])), "component = .*'r' or 'z'"),
    (lambda: fx.SimplySupported("rim", weight=np.zeros(2)), "weight = .*'area' or 'stiffness'"),
    (lambda: fx.Symmetry("axis", normal=np.zeros(2)), "normal = .*'r' or 'z'"),
    (lambda: fx.MixedPressure(eps=-1e-3), "eps = -0.001.*negative"),
    (lambda: fx.DisplacementPenalty(eps=0), "eps = 0.*greater than 0"),
    (lambda: fx.DisplacementPenalty(points=5), "points = 5.*3, 4, 7"),
    (lambda: fx.Pressure("bottom", math.nan), "Pressure.*nan.*finite"),
    (lambda: fx.Symmetry("axis", normal="w"), "normal = .w.*.r. or .z."),
    (lambda: fx.pole_stretch(-1), "pole_stretch = -1.*greater than 0"),
    (lambda: fx.mesh.read("no such file.msh"), "not there"),
    (lambda: fx.DisplacementPenalty(stress_free=NONE), "stress_free = .*True or False"),
    (lambda: fx.Tool([(0, 0), (1, 0)], closed=NONE), "closed = .*True or False"),
    (lambda: fx.StepControl(largest=NONE), "largest = .*must be a number"),
    (lambda: fx.Contact("top", fx.tools.plane(z=1.0), points=NONE), "points = .*must be a number"),
    (lambda: fx.Clamped(None), "Clamped: on = None: must be the name of a boundary"),
    (lambda: fx.Pressure(None), "Pressure: on = None: must be the name of a boundary"),
    (lambda: fx.Contact(None, fx.tools.plane(z=1.0)), "Contact: on = None: must be the name of a boundary"),
])
def test_objects(make, words):
    with pytest.raises(fx.InputError, match=words):
        make()


def test_numbers_of_any_type():
    """Constants are kept as floats."""
    for made in (fx.Yeoh(c10=Decimal("0.5"), c20=Fraction(1, 8), c30=np.float32(0.25)),
                 fx.Ogden(mu=np.array(1.0), alpha=np.array(2)), fx.Ogden(mu=[Decimal(1)], alpha=[Decimal(2)])):
        assert made.shear_modulus == pytest.approx(1.0, rel=1e-12)
        assert {type(value) for value in made.parameters.values()} == {float}


def scene(**change):
    arguments = {"mesh": fx.mesh.disc(**MESH), "materials": {"sheet": fx.NeoHookean(c10=1.0)},
                 "supports": [fx.Symmetry("axis"), fx.Clamped("rim")], "loads": [fx.Pressure("bottom")]}
    return fx.Scene(**{**arguments, **change})


@pytest.mark.parametrize("change, words", [
    ({"materials": {}}, "'sheet' has no material"),
    ({"materials": {"sheet": fx.NeoHookean(c10=1.0), "skin": fx.NeoHookean(c10=1.0)}}, "layer 'skin'.*known: 'sheet'"),
    ({"materials": {"sheet": 2.0}}, "must be a formingx material"),
    ({"loads": [fx.Pressure("botom")]}, "'botom' is not known; known: 'axis', 'rim', 'bottom', 'top'"),
    ({"supports": [fx.Symmetry("axis")]}, "too little support.*translation along Z"),
    ({"supports": [fx.Clamped("rim")]}, "touches the axis"),
    ({"loads": [fx.Pressure("bottom"), fx.Pressure("top")]}, "one control drives a run"),
    ({"mesh": "disc"}, "mesh = 'disc'"),
    ({"quadrature_degree": 0}, "quadrature_degree = 0"), ({"quadrature_degree": 1e300}, "must be at most 30"),
])
def test_scene(change, words):
    with pytest.raises(fx.InputError, match=words):
        scene(**change)


def test_runs():
    with pytest.raises(fx.InputError, match="progress = .*must be True or False"):
        fx.trace(scene(), until=fx.pressure(0.1), progress=np.zeros(2))
    with pytest.raises(fx.InputError, match="increments = 1000000000000: must be at most max_steps = 1000"):
        fx.solve(scene(), to=0.1, increments=10**12)
    with pytest.raises(fx.InputError, match="pressure = -1e.99: it is 5e.98 times the shear modulus, 2"):
        fx.trace(scene(), until=fx.pressure(-1e99), progress=False)


def test_plane_strain_needs_three_motions_held():
    with pytest.raises(fx.InputError, match="too little support.*translation along Z"):
        scene(supports=[fx.Symmetry("axis")], kinematics=fx.PlaneStrain())
    with pytest.raises(fx.InputError, match="too little support.*rotation"):
        scene(supports=[fx.PinnedNode(0.0, 0.0)], kinematics=fx.PlaneStrain())


def test_mesh_across_the_axis(tmp_path):
    file = tmp_path / "crossing.msh"
    fx.mesh.write(fx.mesh.disc(**MESH), file, shift=(-0.5, 0.0))
    with pytest.raises(fx.InputError, match="crosses the axis: its smallest R is -0.5"):
        scene(mesh=fx.mesh.read(file))


def test_pinned_node_that_is_not_there():
    with pytest.raises(fx.InputError, match="no node"):
        fx.trace(scene(supports=[fx.Symmetry("axis"), fx.PinnedNode(0.123, 0.456)]), until=fx.pressure(0.1))


def test_hinge_of_layers_too_different():
    """What a hinge would ask of a soft layer is refused; where the soft layer is on top, or clamped, it runs."""
    hard, soft = fx.NeoHookean(c10=1e4), fx.NeoHookean(c10=1.0)
    mesh = fx.mesh.disc(radius=1.0, thickness={"lower": 0.03, "upper": 0.03}, elements=(10, 1))

    def layered(lower, upper, rim):
        return scene(mesh=mesh, materials={"lower": lower, "upper": upper}, supports=[fx.Symmetry("axis"), rim])
    weighted = fx.SimplySupported("rim", weight="stiffness")
    with pytest.raises(fx.InputError, match="'upper' is 1e.04 times softer than 'lower'.*weight='stiffness'"):
        layered(hard, soft, fx.SimplySupported("rim"))
    with pytest.raises(fx.InputError, match="squeeze layer 'lower', 1e.04 times softer.*use Clamped"):
        layered(soft, hard, weighted)
    for lower, upper, rim in ((hard, soft, weighted), (soft, hard, fx.Clamped("rim"))):
        path = fx.trace(layered(lower, upper, rim), until=fx.pole_stretch(2.5))
        assert path.counts.iterations < 100
    with pytest.raises(fx.InputError, match="weight = 'mass'"):
        fx.SimplySupported("rim", weight="mass")


def test_nothing_driven():
    for run in (lambda s: fx.trace(s, until=fx.pressure(1.0)), lambda s: fx.solve(s, to=1.0)):
        with pytest.raises(fx.InputError, match="nothing is driven"):
            run(scene(loads=[fx.Pressure("bottom", 0.1)]))


def test_moved_nodes():
    """One node of a good mesh moved so that elements lie over each other, or turn inside out: no scene."""
    for by, words in ((-0.6, "lie over each other|touches or crosses itself|inside out"), (math.nan, "finite")):
        mesh = fx.mesh.disc(radius=1.0, thickness=0.3, elements=(4, 2))
        x = mesh.domain.geometry.x
        x[np.argmin(np.hypot(x[:, 0] - 0.5, x[:, 1] - 0.15)), 0] += by
        with pytest.raises(fx.InputError, match=words):
            scene(mesh=mesh)


def test_tool_with_its_solid_on_the_other_side():
    cup = fx.tools.cup(radius=1.25, depth=0.4, mouth=0.1, fillet=0.1)
    with pytest.raises(fx.InputError, match=r"starts inside the tool.*use tool.reversed\(\)"):
        scene(contacts=[fx.Contact("top", cup.reversed())])


def test_column_and_value_that_a_path_does_not_have():
    path = fx.trace(treloar(), until=fx.pressure(0.1))
    with pytest.raises(fx.InputError, match="column 'height' is not known; known: pressure"):
        path["height"]
    with pytest.raises(fx.InputError, match="intermediate = Target.*must be a list of targets"):
        fx.trace(treloar(), until=fx.pressure(0.1), intermediate=fx.pressure(0.05))
    with pytest.raises(fx.InputError, match="does not pass pressure = 0.3"):
        path.at(fx.pressure(0.3))
    with pytest.raises(fx.InputError, match="does not pass pressure = 0.10001: its values lie between 0 and 0.1"):
        path.at(fx.pressure(0.10001))


def test_the_last_state_of_a_path_is_found_by_a_value_of_six_digits():
    """A pole height of 0.5123456 is written 0.512346: the path ends just before it."""
    path = fx.trace(treloar(), until=fx.pole_height(0.5123456), progress=False)
    found = path.at(fx.pole_height(0.512346))
    assert found.measures["pole_height"] == pytest.approx(0.512346, rel=1e-10)
    assert path.last.measures["pressure"] < found.measures["pressure"] < (1 + 1e-5) * path.last.measures["pressure"]


def test_no_state_is_found_beyond_a_maximum_of_the_pressure():
    path = fx.trace(treloar(), until=fx.pressure(0.6), at_limit_point="stop", progress=False)
    with pytest.raises(fx.InputError, match="does not pass pressure"):
        path.at(fx.pressure(path.last.measures["pressure"] * (1 + 1e-6)))


def test_a_body_does_not_pass_the_axis():
    """A ring whose inner edge is driven beyond it: J > 0 there, for two factors change their sign."""
    mesh = fx.mesh.disc(radius=10.0, inner_radius=2.0, thickness=1.0, elements=(16, 2))
    scene = fx.Scene(mesh=mesh, materials=fx.NeoHookean(c10=1.0),
                     supports=[fx.PrescribedDisplacement("inner", "r"), fx.Clamped("rim")])
    with pytest.raises(fx.ConvergenceError, match="turned inside out") as error:
        fx.trace(scene, until=fx.travel(-3.0), progress=False)
    assert -2.0 < error.value.path["travel"][-1] < -1.9
