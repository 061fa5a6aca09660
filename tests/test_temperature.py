"""Constants that depend on the temperature of a scene, and time-temperature superposition."""

import numpy as np
import pytest

import formingx as fx
from formingx import _compat
from formingx.problem.problem import Problem

HOT = {130.0: 2.0, 150.0: 0.6, 170.0: 0.2}


def scene(material, temperature=None, model=None, thickness=0.05, elements=(6, 1), **more):
    body = fx.mesh.disc(radius=1.0, thickness=thickness, elements=elements)
    return fx.Scene(mesh=body, materials=material, loads=[fx.Pressure("bottom")], model=model, temperature=temperature,
                    supports=[fx.Symmetry("axis"), fx.SimplySupported("rim")], **more)


def inflate(scene, stretch=1.5):
    return fx.trace(scene, until=fx.pole_stretch(stretch), progress=False)


@pytest.mark.parametrize("model", [fx.Membrane(), fx.MixedPressure()], ids=["membrane", "solid"])
def test_uniform_temperature_is_the_plain_material(model):
    """Between two points of the table, too; the same states to round-off."""
    material = fx.NeoHookean(c10=fx.table(HOT))
    paths = [inflate(s) for s in (scene(material, 143.0, model), scene(material.at_temperature(143.0), None, model))]
    assert paths[0]["pressure"] == pytest.approx(paths[1]["pressure"], rel=1e-9)
    assert paths[0].problem.forms.stress == pytest.approx(2 * fx.table(HOT)(143.0), rel=1e-12)


@pytest.mark.parametrize("model", [fx.Membrane(), fx.MixedPressure()], ids=["membrane", "solid"])
def test_constants_are_evaluated_at_the_temperature_of_each_point(model):
    """c10(T(R)) is a constant that varies with R."""
    c10 = fx.table(HOT)

    def temperature(R, Z):                              # quadratic: exact in the elements
        return 160 - 20 * R**2
    a = inflate(scene(fx.NeoHookean(c10=c10), temperature, model))
    b = inflate(scene(fx.NeoHookean(c10=lambda R, Z: c10(temperature(R, Z))), None, model))
    assert a["pressure"] == pytest.approx(b["pressure"], rel=1e-9)
    even = inflate(scene(fx.NeoHookean(c10=0.4), None, model))
    assert np.all(a.profile().thickness_ratio[6:] > 1.02 * even.profile().thickness_ratio[6:])  # a hot pole thins more


def test_temperature_given_in_all_ways(tmp_path):
    field = tmp_path / "T.csv"
    field.write_text("R,Z,T\n0,0,160\n1,0,140\n0,0.05,160\n1,0.05,140\n")
    mesh = fx.mesh.disc(radius=1.0, thickness=0.05, elements=(3, 1))
    heated = fx.heat(mesh, fx.ThermalProperties(conductivity=0.2, density=1e3, heat_capacity=2e3), start=150.0,
                     times=1.0, unit="C")
    material = fx.NeoHookean(c10=fx.of_temperature(lambda T: np.exp(-(T - 150) / 20)))
    ways = {"number": 150.0, "run": heated, "table": fx.table({0.0: 160.0, 1.0: 140.0}), "file": field}
    moduli = {name: scene(material, T, elements=(3, 1)).shear_modulus("sheet") for name, T in ways.items()}
    assert moduli["number"] == pytest.approx(2.0) and moduli["run"] == pytest.approx(2.0)
    assert 2 * np.exp(0.45) < moduli["table"] < 2 * np.exp(0.5)                # largest near the rim, at 140
    assert moduli["file"] == pytest.approx(moduli["table"], rel=1e-9)


@pytest.mark.parametrize("text, words", [
    ("R,Z,T\n0,0,160\n1,0,140\n", "all its points have the same Z, and the body is not flat: leave the column Z out"),
    ("R,T\n0,160\n1,140\n0,150\n", "two temperatures, 150 and 160, at R = 0"),
    ("R,Z,T\n0,0,160\n1,1,140\n2,2,150\n", "lie on one line"), ("R,Z\n0,0\n1,1\n", "column 'T' is not known"),
    ("x,T\n0,0\n1,1\n", "must have T, and R, Z or both"), ("R,T [C]\n0,0\n1,1\n", "column 'T' is in 'C'"),
    ("R;T\n0;160\n0,5;140\n", "lies outside"), ("R,T\n0,160\n1,0x10\n", "row 2 of the data is empty or not a")])
def test_temperature_files_that_are_refused(tmp_path, text, words):
    (tmp_path / "T.csv").write_text(text)
    with pytest.raises(fx.InputError, match=words):
        scene(fx.NeoHookean(c10=1.0), tmp_path / "T.csv", elements=(3, 1))


def test_a_temperature_along_the_radius(tmp_path):
    (tmp_path / "T.csv").write_text("R;T\n1;140\n0;160\n0,5;150,0\n")
    material = fx.NeoHookean(c10=fx.of_temperature(lambda T: np.exp(-(T - 150) / 20)))
    found = [scene(material, T, elements=(3, 1)).shear_modulus("sheet") for T in (tmp_path / "T.csv",
                                                                                lambda R, Z: 160 - 20 * R)]
    assert found[0] == pytest.approx(found[1], rel=1e-9)


def test_constants_follow_a_temperature_that_changes():
    """The stiffness of the forms is that of the new temperature; outside the table that at its end."""
    here = scene(fx.NeoHookean(c10=fx.table(HOT)), 150.0, fx.MixedPressure())
    problem = Problem(here)
    c10 = problem.forms.terms[0].constants["c10"]
    assert np.allclose(c10.x.array, 0.6)
    problem.temperature.T.x.array[:] = 130.0
    problem.forms.update_temperature()
    assert np.allclose(c10.x.array, 2.0)
    problem.temperature.T.x.array[:] = 120.0
    problem.forms.update_temperature()
    assert np.allclose(c10.x.array, 2.0)


@pytest.mark.parametrize("kind", [
    fx.Viscoelastic, pytest.param(fx.TransientNetwork, marks=pytest.mark.thorough)])
def test_time_temperature_superposition(kind):
    """sigma(T, t) = sigma(T0, t/aT): a whole scene at T, aT times as fast, follows the same path."""
    shift, T = fx.WLF(8.86, 101.6, 150.0), 158.0
    rest, branches = fx.NeoHookean(c10=0.2), [(1.0, 2.0), (0.5, 20.0)]
    shifted = kind(rest, branches, shift=shift)
    found = []
    for material, temperature, time in ((shifted, 150.0, 3.0), (shifted, T, 3.0 * float(shift(T))),
                                        (kind(rest, branches), None, 3.0)):
        body = scene(material, temperature, fx.Membrane())
        blow = fx.Stage("blow", control=body.loads[0], until=fx.pressure(0.03), duration=time)
        found.append(fx.Process(body).run([blow], progress=False, accuracy="draft").last.measures)
    assert found[0]["process_time"] == pytest.approx(3.0) and shift(T) < 0.3
    for other in found[1:]:
        assert other["pole_height"] == pytest.approx(found[0]["pole_height"], rel=1e-8)


def test_entropic_modulus():
    c10 = fx.entropic(2.0, 150.0, unit="C")
    material = fx.Viscoelastic(fx.NeoHookean(c10=c10), [(c10, 1.0)])
    warm = material.at_temperature(170.0)
    assert warm.shear_modulus == pytest.approx(6.0 * (170 + 273.15) / (150 + 273.15), rel=1e-12)
    assert scene(material, 170.0).shear_modulus("sheet") == pytest.approx(warm.shear_modulus, rel=1e-9)


@pytest.mark.parametrize("material, temperature, words", [
    (fx.NeoHookean(c10=fx.table(HOT)), None, "give Scene a temperature"),
    (fx.NeoHookean(c10=fx.table(HOT)), 180.0, "temperature = 180: must be from 130 to 170"),
    (fx.NeoHookean(c10=fx.of_temperature(lambda T: 160 - T)), 170.0, "no stiffness"),
    (fx.Viscoelastic(None, [(1.0, 1.0)], shift=fx.WLF(8.86, 101.6, 150.0)), 20.0, "must be above reference - c2"),
    (fx.NeoHookean(c10=1.0), fx.table({0.0: 150.0, 0.5: 140.0}), "R = "),
    (fx.NeoHookean(c10=1.0), fx.Scene, r"must be a number, a table\({R: value}\), a function of"),
    (fx.NeoHookean(c10=1.0), {0.0: 150.0, 1.0: 140.0}, r"must be a number, a table\({R: value}\), a function of"),
    (fx.NeoHookean(c10=1.0), "a\0b.csv", "must be the name of a file"),
    (fx.NeoHookean(c10=1.0), lambda R, Z: R / 0, "not a finite number"),
    (fx.NeoHookean(c10=1.0), lambda R: R, r"the function of arrays \(R, Z\) fails: TypeError"),
])
@pytest.mark.filterwarnings("ignore:divide by zero", "ignore:invalid value")
def test_wrong_temperatures_are_refused(material, temperature, words):
    with pytest.raises(fx.InputError, match=words):
        scene(material, temperature)


@pytest.mark.parametrize("material, used", [
    (fx.NeoHookean(c10=1.0), False), (fx.NeoHookean(c10=fx.table(HOT)), True),
    (fx.Viscoelastic(fx.NeoHookean(c10=1.0), [(1.0, 1.0)]), False),
    (fx.Viscoelastic(fx.NeoHookean(c10=1.0), [(1.0, 1.0)], shift=fx.WLF(8.86, 101.6, 150.0)), True)])
def test_a_temperature_without_effect_is_found(material, used):
    assert ("it has no effect" in str(fx.check(scene(material, 150.0)))) != used


SHEET = fx.ThermalProperties(conductivity=0.17, density=1050.0, heat_capacity=1800.0)      # SI


def cooled(tools=None, contacts=(), h=100.0, through=2, **more):
    """A sheet of 1 mm at 150 C with air of 20 C above."""
    body = fx.mesh.disc(radius=0.02, thickness=1e-3, elements=(6, through))
    heat = fx.Cooling(SHEET, [fx.Convection("top", h=h, air=20.0)] if h else [], unit="C", tools=tools, tolerance=0.01)
    return fx.Scene(mesh=body, materials=fx.NeoHookean(c10=fx.table({20: 4e6, 130: 1e6, 150: 0.6e6})),
                    loads=[] if contacts else [fx.Pressure("bottom")], contacts=contacts, temperature=150.0, heat=heat,
                    supports=[fx.Symmetry("axis"), fx.Clamped("rim")], **more)


def test_a_sheet_cools_while_it_waits():
    """At rest the temperature is that of `fx.heat`, and comes back with each state."""
    scene = cooled(through=4)
    path = fx.Process(scene).run([fx.Stage("wait", duration=2.0)], progress=False, accuracy="draft")
    alone = fx.heat(scene.mesh, SHEET, [fx.Convection("top", h=100.0, air=20.0)], start=150.0, times=2.0, unit="C",
                    tolerance=0.01)
    points = np.array([[0.0, 0.0], [0.01, 1e-3]])
    c10 = path.problem.forms.terms[0].constants["c10"].ufl_operands[0]        # times how it goes on in a step
    with path.problem.state_context(path.last):
        assert path.problem.temperature.at_points(points) == pytest.approx(alone.at_points(points)[-1], abs=0.05)
        stiffer = c10.x.array.max()
    with path.problem.state_context(path.states[0]):
        assert np.all(path.problem.temperature.T.x.array == 150.0)
        assert c10.x.array == pytest.approx(0.6e6)
    assert stiffer > 0.7e6


def test_relaxation_times_are_those_in_the_middle_of_a_step():
    """Relaxation times are evaluated in the middle of a step, moduli at its end."""
    heat = fx.Cooling(SHEET, [fx.Convection("top", h=100.0, air=20.0)], unit="C")
    melt = fx.Viscoelastic(fx.NeoHookean(c10=fx.table({20: 2.0, 150: 1.0})), [(1.0, 4.0)],
                           shift=fx.Arrhenius(100e3, 150.0, unit="C"))
    terms, = Problem(scene(melt, 150.0, fx.MixedPressure(), heat=heat)).forms.terms
    forms, rate, begins, step = terms.forms, 0.7, 1.0, 0.4
    terms.start.value, forms._time[0].value, forms._time[1].value = begins, begins + step, 0.0
    for coefficient in terms._coefficients:
        coefficient._rate.x.array[:], coefficient._since.value = rate, begins
    found = {name: _compat.compile_expression(terms.constants[name], terms.places).eval(
        forms.domain, np.arange(2, dtype=np.int32)) for name in ("c10", "tau_1")}
    assert found["c10"] == pytest.approx(1.0 * np.exp(rate * step))
    assert found["tau_1"] == pytest.approx(4.0 * np.exp(rate * step / 2))


def test_a_sheet_that_cools_needs_more_pressure():
    def height(h):
        scene = cooled(h=h)
        blow = fx.Stage("blow", control=scene.loads[0], until=fx.pressure(6e4), duration=2.0)
        return fx.Process(scene).run([blow], progress=False, accuracy="draft").last.measures["pole_height"]
    assert height(100.0) < 0.98 * height(0.0)


def test_a_tool_takes_heat_only_where_and_while_it_touches():
    tool = fx.tools.male(radius=8e-3, height=0.02, base=-0.02, fillet=2e-3).mirrored().moved(z=1.5e-3)
    plug = fx.Contact("top", tool, direction=(0.0, -1.0), name="plug", friction="stick")
    scene = cooled({"plug": (1000.0, 30.0)}, [plug], h=0)
    push = fx.Stage("push", control="plug", until=fx.travel(4e-3), intermediate=[fx.travel(0.4e-3)], duration=0.5)
    path = fx.Process(scene).run([push], progress=False, accuracy="draft")
    with path.problem.state_context(path.target_state(fx.travel(0.4e-3))):
        assert np.all(np.abs(path.problem.temperature.T.x.array - 150.0) < 1e-9)      # it has not come to the sheet yet
    *under, beside = path.temperature(np.array([[R, 1e-3] for R in (0.0, 0.002, 0.004, 0.006, 0.019)]))
    assert min(under) < 110 and beside > 149.9, under
