"""Calls with arguments of a wrong type or number raise an error that names the allowed ones."""

import collections
import cProfile
import inspect
import pickle
import pstats

import numpy as np
import pytest
from conftest import treloar

import formingx as fx
from formingx import _calls
from formingx.extensions.adapt.column_factors import column_factors
from formingx.extensions.contact_events.reduced_contact import CondensedPoints


@pytest.fixture(scope="module")
def path():
    return fx.trace(treloar(elements=(8, 1)), until=fx.pole_height(0.2), progress=False)


@pytest.mark.parametrize("call, words", [
    (lambda p: fx.mesh.disc(1.0, 0.1), r"disc: too many positional .*: must be disc\(radius=\.\.\., thickness=\.\.\."),
    (lambda p: fx.mesh.disc(radius=1.0, thicknes=0.1),
     r"disc: thicknes= is not known: did you mean thickness=\?: must be disc"),
    (lambda p: fx.StepControl(lenght=0.1),
     r"StepControl: lenght= .* mean length=\?: must be StepControl\(length=0.1, target=4"),
    (lambda p: fx.Pressure("bottom", 1.0, None, None, 3), r"must be Pressure\(on, value=None, name=None, above=None\)"),
    (lambda p: fx.SimplySupported(of="rim"), r"must be SimplySupported\(on, weight="),
    (lambda p: fx.trace(p.problem.scene, fx.pole_height(0.1), 3), "trace: too many positional"),
    (lambda p: fx.tools.cup(1, 2), "cup: too many positional"),
    (lambda p: fx.tools.plane(1.0).moved(up=3), r"Tool.moved: up= is not known: must be Tool.moved\(r=0.0, z=0.0\)"),
    (lambda p: p.plot("pole_height"), r"must be Path.plot\(y, x, axes=None, \*\*style\)"),
    (lambda p: p.view3d("there.png", 3), "state = 3: must be a State or None"),
    (lambda p: p.state_at(0.4), "Path.state_at: target = 0.4: must be a Target"),
    (lambda p: p.stress().at_points("pole"), "Stress: points = 'pole': must be points"),
    (lambda p: p.profile().thickness_ratio_at("rim"), "radius = 'rim': must be "),
    (lambda p: p.profile().thickness_ratio_at(5.0), "radius = 5: must be from 0 to 1.25"),
    (lambda p: fx.WLF(10.0, 100.0, 120.0)(np.inf), "temperature = inf: must be above .*, and finite"),
    (lambda p: fx.Units("mm").mass(np.nan, 1.0), "volume = nan: must be a finite number"),
    (lambda p: fx.NeoHookean(c10=1.0).plot("x"), "NeoHookean.plot: axes = .*: must be an Axes or None"),
    (lambda p: fx.KBKZ.of_viscosities(range(3)), "spectrum = .*: must be a list of"),
    (lambda p: column_factors(p, np.nan, None), "max_rotation = nan: must be a finite number"),
    (lambda p: p.stability(states=np.array([])), "stability: states"),
    (lambda p: p.wall().at_height(), r"Wall.at_height: missing"),
    (lambda p: p.problem.scene.mesh.nodes_of("side"), "boundary 'side' is not known; known: 'axis', 'rim'"),
    (lambda p: p.problem.scene.shear_modulus("skin"), "layer 'skin' is not known; known: 'sheet'"),
    (lambda p: fx.NeoHookean(c10=1.0).stress("uniaxial", {}), r"NeoHookean.stress: stretches = {}: must be numbers"),
    (lambda p: fx.tools.plane(1.0).signed_distance([1, 2, 3]), r"must be points \(R, Z\)"),
    (lambda p: fx.tools.box(half=(1, 1), depth=1).signed_distance([1, 2]), r"must be points \(x, y, z\)"),
    (lambda p: fx.tools.box(half=(1, 1, 1), depth=1), "box: half = .*: must be two numbers"),
    (lambda p: fx.tools.box(half=(1, 1), depth=1).moved(x="1"), "moved = .*: must be a number"),
])
def test_wrong_calls(path, call, words):
    with pytest.raises(fx.InputError, match=words):
        call(path)


def test_errors_inside_functions_are_not_hidden():
    """What is raised though all arguments are of the right kind, as by a script's function, goes through."""
    def radius(energy):
        return energy.no_such_thing
    with pytest.raises(AttributeError, match="no_such_thing"):
        fx.trace(treloar(elements=(8, 1)), until=fx.pole_height(0.2), progress=False, record={"r": radius})


def test_calls_inside_a_run_are_not_explained():
    """No iteration passes through them, though every one asks tools and laws."""
    ball = fx.Contact("top", fx.tools.sphere(radius=0.5, z=0.082), direction=(0, -1))
    scene = fx.Scene(mesh=treloar(elements=(16, 1)).mesh, materials=fx.NeoHookean(c10=2.0), contacts=[ball],
                     supports=[fx.Symmetry("axis"), fx.Clamped("rim")])
    profile = cProfile.Profile()
    path = profile.runcall(fx.trace, scene, until=fx.travel(0.3), progress=False)
    calls = collections.Counter()
    for (_, _, name), row in pstats.Stats(profile).stats.items():
        calls[name] += row[1]
    assert path["contact_length"][-1] > 0 and calls["nearest"] > 50 and calls["explained"] < calls["nearest"] / 2
    assert _calls._is_internal(type(path.problem.contacts[0].law)) and _calls._is_internal(CondensedPoints)
    assert not any(hasattr(method, "_is_explained") for base in type(path.problem.contacts[0].law).__mro__
               for method in vars(base).values())


def test_calls_are_unchanged():
    assert list(inspect.signature(fx.mesh.disc).parameters)[:2] == ["radius", "thickness"]
    assert "Treloar" in fx.treloar1944.__doc__ and fx.mesh.disc.__name__ == "disc"
    assert pickle.loads(pickle.dumps(fx.mesh.disc)) is fx.mesh.disc
    assert pickle.loads(pickle.dumps(fx.pressure)) is fx.pressure
    assert np.array_equal(fx.tools.plane(1.0).signed_distance([0.5, 3.0]), [2.0])
