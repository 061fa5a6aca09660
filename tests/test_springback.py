"""Springback of formed parts: `Path.springback`."""

import json

import numpy as np
import pytest
import ufl
from conftest import drawn, run
from test_solidification import BASE, air, balance, block, draw

import formingx as fx
from formingx import _compat
from formingx.extensions.heat import cooling
from formingx.extensions.release.part import trimmed_mesh
from formingx.forms.transfer import restrict_fields
from formingx.problem.problem import Problem


def blown(material, **more):
    """A sheet that is blown against a plate in half a second."""
    scene = fx.Scene(**{"mesh": fx.mesh.disc(radius=1.0, thickness=0.1, elements=(12, 2)), "materials": material,
                        "supports": [fx.Symmetry("axis"), fx.SimplySupported("rim")],
                        "loads": [fx.Pressure("bottom", name="air")],
                        "contacts": [fx.Contact("top", fx.tools.plane(0.4), 0.2, name="stop")]} | more)
    return fx.Process(scene).run([fx.Stage("blow", control="air", until=fx.pressure(0.08), duration=0.5)],
                                 progress=False, accuracy="draft")


@pytest.fixture(scope="module")
def path():
    return blown(fx.Viscoelastic(fx.NeoHookean(c10=0.2), [(0.6, 0.5)]))


@pytest.mark.parametrize("trim", [None, 0.7])
def test_an_elastic_part_recovers_its_reference_shape(trim):
    part = blown(fx.NeoHookean(c10=0.4)).springback(trim=trim)
    assert part.before.height.max() > 0.05 and part.height < 1e-7 and part.flange_angle > 10
    F = part.path.stress().at_quadrature_points().deformation_gradient
    assert np.abs(F - np.eye(3)).max() < 1e-6
    assert abs(part.trim_radius - (trim or 1.0)) < 0.06 and part.diameter < 2.001


def test_a_relaxing_part_recovers_in_time(path):
    """At once, and after more and more time; trimmed it is what the same material is without its rim."""
    part = path.springback(duration=0.3, accuracy="draft")
    heights = [part.path.wall(s).height.max() for s in (part.path.states[0], part.path.state("release"),
                                                        part.path.state("cool"))]
    assert heights[0] > heights[1] > heights[2] > 0.2 * heights[0]
    assert heights[0] == pytest.approx(path.wall().height.max(), rel=1e-12)
    assert part.path.last.time == pytest.approx(0.8)
    assert "springback of the height" in str(part) and part.springback == pytest.approx(heights[0] - heights[2])
    gone = path.springback(duration=60.0, accuracy="draft")
    assert gone.height < 1e-2 * heights[0]


def test_fields_of_a_part_are_those_of_the_whole(path):
    """Displacement, pressure, what the material remembers: to round-off."""
    source, mesh = path.problem, path.problem.scene.mesh
    line = np.column_stack([np.linspace(0, 1, 13), np.full(13, 0.05)])
    here = Problem(fx.Scene(mesh=trimmed_mesh(mesh, line, 9), materials=source.scene.materials,
                            supports=[fx.Symmetry("axis"), fx.PinnedNode(0.0, 0.0)]))
    restrict_fields(source, path.last, here)
    assert set(here.scene.mesh.boundaries) == set(mesh.boundaries)
    assert here.scene.mesh.nodes_of("rim")[:, 0] == pytest.approx(0.75)
    both = []
    with source.state_context(path.last):
        for problem in (source, here):
            cells = np.arange(len(problem.forms.cells_of(["sheet"])), dtype=np.int32)
            F = problem.forms.F
            values = _compat.compile_expression(ufl.as_vector([F[0, 0], F[0, 1], F[1, 0], F[1, 1], F[2, 2], ufl.split(
                problem.forms.w)[1] * problem.forms.stress, *problem.forms.X]), np.array([[0.2, 0.5], [0.6, 0.1]]))
            both.append(values.eval(problem.forms.domain, cells).reshape(-1, 8))
    found = both[1]
    at = np.argmin(np.hypot(*(both[0][:, None, 6:] - found[None, :, 6:]).transpose(2, 0, 1)), axis=0)
    same = np.hypot(*(both[0][at] - found)[:, 6:].T) < 1e-9      # a triangle may be numbered from another corner
    assert np.sum(same) > 0.3 * len(found)
    assert found[same] == pytest.approx(both[0][at][same], abs=1e-11)


@pytest.mark.parametrize("trim", [None, 0.8e-3])
def test_a_solidified_block_keeps_the_exact_stretch(trim):
    """Drawn to 1.5, chilled in its grip, let go and trimmed: the balance of rubber and glass."""
    scene = block(fx.Solidification(BASE, modulus=200.0, between=(75, 85)), air(20.0))
    path = fx.Process(scene).run([draw(0.5), fx.Stage("chill", duration=20.0)], progress=False)
    part = path.springback(20.0, trim=trim)
    F = part.path.stress().at_quadrature_points().deformation_gradient
    assert F[:, 0, 0] == pytest.approx(balance(200.0, 1.5), rel=1e-7)
    assert part.shrinkage == pytest.approx(1 - balance(200.0, 1.5) / 1.5, rel=1e-5)


def test_wrong_springback_arguments_are_refused(path):
    for words, arguments in (("no heat=Cooling", {"temperature": 20.0}),
                             ("the part goes from", {"trim": 7.0}), ("must be", {"duration": -1.0})):
        with pytest.raises(fx.InputError, match=words):
            path.springback(**arguments)
    membrane = fx.trace(fx.Scene(mesh=fx.mesh.disc(radius=1.0, thickness=0.1, elements=(4, 1)), materials=BASE,
                                 supports=[fx.Symmetry("axis"), fx.SimplySupported("rim")], model=fx.Membrane(),
                                 loads=[fx.Pressure("bottom")]), until=fx.pole_height(0.3), progress=False)
    with pytest.raises(fx.InputError, match="a membrane has no bending stiffness"):
        membrane.springback()


@pytest.mark.thorough
def test_setting_pot_quick(tmp_path):
    """What sets keeps its shape and shrinks; the rubber goes back."""
    run("demos/setting_pot.py", "--out", tmp_path, "--quick")
    found = json.loads((tmp_path / "summary.json").read_text())
    assert 0.1 < found["sets"]["shrinkage_percent"] < 0.6 and found["sets"]["springback"] < 0.1
    assert found["neither"]["springback"] > 10 * found["sets"]["springback"]
    assert found["sets"]["height"] > 6 and found["sets"]["least_wall"] > 0.03
    assert drawn(tmp_path / "setting_pot.png")


RUBBER = fx.NeoHookean(c10=0.5e6)
WARM = {"sets": fx.Solidification(RUBBER, modulus=8e8, between=(90, 120)),
        "relaxes and sets": fx.Solidification(fx.Viscoelastic(fx.NeoHookean(c10=0.4e6), [(0.4e6, 0.5)],
                                                              shift=fx.Arrhenius(100e3, 150.0, unit="C")),
                                              modulus=8e8, between=(90, 120)),
        "stiffens": fx.NeoHookean(c10=fx.table({19: 2e6, 151: 0.5e6}))}


@pytest.fixture(scope="module")
def chilled():
    """A cap that was blown hot and chilled from above for 20 s, warm within: of a material of `WARM`."""
    polymer = fx.ThermalProperties(conductivity=0.17, density=1050.0, heat_capacity=1800.0)
    found = {}

    def of(name):
        if name not in found:
            scene = fx.Scene(mesh=fx.mesh.disc(radius=0.05, thickness=0.002, elements=(8, [2, 1])),
                             materials=WARM[name], temperature=150.0,
                             expansion=fx.ThermalExpansion(linear=7e-5, stress_free=150.0),
                             heat=fx.Cooling(polymer, [fx.Convection("top", h=100.0, air=20.0)], unit="C",
                                             tolerance=0.5),
                             supports=[fx.Symmetry("axis"), fx.Clamped("rim")],
                             loads=[fx.Pressure("bottom", name="air")])
            found[name] = fx.Process(scene).run([
                fx.Stage("blow", control="air", until=fx.pressure(4e4), duration=0.5),
                fx.Stage("chill", duration=20.0)], accuracy="draft", progress=False)
        return found[name]
    return of


@pytest.mark.parametrize("name", [
    "stiffens", *(pytest.param(name, marks=pytest.mark.thorough) for name in ("sets", "relaxes and sets"))])
def test_faces_of_a_warm_part_may_be_chilled_at_once(chilled, name):
    """What stiffens or sets as the faces go to 20 C: elastic parts go to their free size, set ones keep their shape."""
    path = chilled(name)
    assert path.temperature([(0.0, 0.0)]).min() > 85                    # within, not all has set
    part = path.springback(20.0, accuracy="draft")
    assert part.path.temperature([(0.0, 0.0), (0.0, 0.002)]) == pytest.approx(20.0, abs=1e-4)
    if name == "stiffens":
        assert part.diameter == pytest.approx(0.1 * (1 - 7e-5 * 130), rel=1e-5) and part.height < 1e-5 * part.diameter
    else:
        assert 0.5 * 7e-5 * 130 < part.shrinkage < 7e-5 * 130 and abs(part.springback) < 0.01 * part.height


@pytest.mark.thorough
def test_sudden_chill_is_the_limit_of_a_large_conductance(chilled, monkeypatch):
    part = chilled("sets").springback(20.0, accuracy="draft")
    monkeypatch.setattr(cooling, "_SUDDEN_CONDUCTANCE", 1e3)
    slower = chilled("sets").springback(boundaries=[fx.FixedTemperature(face, temperature=20.0) for face in (
        "bottom", "top")], duration=part.path.last.time - 20.5, accuracy="draft")
    assert slower.shrinkage == pytest.approx(part.shrinkage, rel=0.01)
    assert slower.min_wall == pytest.approx(part.min_wall, rel=1e-3)
