"""A body that cools while it is formed: dissipated work as heat, other ranks, restarts."""

import json
import re

import numpy as np
import pytest
from conftest import run_json
from test_restart import same

import formingx as fx
from formingx.problem.problem import Problem

POLYMER = fx.ThermalProperties(conductivity=0.17, density=2.0, heat_capacity=3.0)
RELAXING = fx.Viscoelastic(fx.NeoHookean(c10=0.2), [(1.0, 0.5), (0.4, 3.0)])


def pulled(material=RELAXING, boundaries=(), work_to_heat: float | None = 1.0):
    """A disc that is pulled at its rim: a homogeneous deformation."""
    mesh = fx.mesh.disc(radius=1.0, thickness=0.4, elements=(3, 2))
    return fx.Scene(mesh=mesh, materials=material, temperature=20.0,
                    heat=fx.Cooling(POLYMER, boundaries, unit="C", tolerance=0.01, work_to_heat=work_to_heat),
                    supports=[fx.Symmetry("axis"), fx.Symmetry("bottom", normal="z", guide=True),
                              fx.PrescribedDisplacement("rim", "r", name="rim")])


def pull(scene, **options):
    stages = [fx.Stage("pull", control="rim", until=fx.travel(1.0), duration=1.0), fx.Stage("wait", duration=4.0)]
    return fx.Process(scene).run(stages, progress=False, **options)


def test_adiabatic_work_becomes_heat():
    """rho c dT = what is dissipated, all over the body; the work done is what is stored and what is dissipated."""
    scene = pulled()
    path = pull(scene, accuracy="fine")
    volume = np.pi * 0.4
    with path.problem.state_context(path.last):
        T = path.problem.temperature.T.x.array.copy()
    assert np.ptp(T) < 1e-8
    lost = path.last.measures["dissipated_energy"]
    heat, power = 6.0 * volume * (T.mean() - 20.0), path["dissipated_power"]
    given = np.sum(np.diff(path["process_time"]) * (power[1:] + power[:-1]) / 2)     # as the heat equation takes it
    assert heat == pytest.approx(given, rel=1e-9) and heat == pytest.approx(lost, rel=3e-4) and T.mean() > 20.1
    force, travel = path["support_force"], path["rim_travel"] if "rim_travel" in path.columns else path["travel"]
    work = np.sum(np.diff(travel) * (force[1:] + force[:-1]) / 2)
    assert abs(work) == pytest.approx(path.last.measures["strain_energy"] + lost, rel=5e-3)


def test_temperature_rise_is_proportional_to_the_share_of_work():
    rises = {}
    for share in (1.0, 0.5, None):
        scene = pulled(work_to_heat=share)
        path = pull(scene, accuracy="draft")
        with path.problem.state_context(path.last):
            rises[share] = path.problem.temperature.T.x.array.mean() - 20.0
    assert rises[0.5] == pytest.approx(rises[1.0] / 2, rel=1e-9) and abs(rises[None]) < 1e-9


def test_dissipation_of_elastic_materials_is_refused():
    with pytest.raises(fx.InputError, match="no material of the scene dissipates work"):
        pulled(fx.NeoHookean(c10=1.0))
    with pytest.raises(fx.InputError, match="work_to_heat = -1"):
        pulled(work_to_heat=-1.0)
    with pytest.raises(fx.InputError, match="Cooling: tools"):
        fx.Cooling(POLYMER, unit="C", tools=np.zeros(3))


def test_the_name_of_a_cooling_has_all_its_arguments():
    air, given = fx.Convection("top", h=2e-5, air=20.0), {"plug": (0.3, 30.0)}
    for work in (None, 0.5):
        cooling = fx.Cooling(POLYMER, [air], unit="K", tools=given, tolerance=0.02, work_to_heat=work)
        same = eval(repr(cooling), vars(fx))
        assert repr(same) == repr(cooling)
        assert (same.unit, same.tools, same.tolerance, same.work_to_heat) == ("K", cooling.tools, 0.02, work)


def pressed():
    """A hot relaxing sheet under a cold conducting plug, with friction by temperature and work as heat."""
    tool = fx.tools.male(radius=0.4, height=1.0, base=-1.0, fillet=0.2).mirrored().moved(z=0.05)
    wall = fx.ConductingTool(thickness=0.2, conductivity=1.0, heat_capacity=4.0, back=30.0, elements=6, finest=1e-2)
    stiff = fx.table({20.0: 3.0, 90.0: 1.4, 150.0: 1.0, 180.0: 0.8})
    sheet = fx.Viscoelastic(fx.NeoHookean(c10=stiff), [(stiff, 0.5)], shift=fx.Arrhenius(40e3, 150.0, unit="C"))
    return fx.Scene(mesh=fx.mesh.disc(radius=1.0, thickness=0.05, elements=(8, 1)), materials=sheet, temperature=150.0,
                    supports=[fx.Symmetry("axis"), fx.Clamped("rim")],
                    expansion=fx.ThermalExpansion(linear=1e-4, stress_free=150.0),
                    heat=fx.Cooling(fx.ThermalProperties(conductivity=0.01, density=1.0, heat_capacity=1.0),
                                    [fx.Convection("bottom", h=1e-3, air=60.0)], unit="C", tolerance=0.5,
                                    tools={"plug": (0.3, wall)}, work_to_heat=1e-3),
                    contacts=[fx.Contact("top", tool, fx.table({20.0: 0.1, 150.0: 0.5, 180.0: 0.5}), direction=(0, -1),
                                         name="plug", penalty=2e4, ramp=1e-5)])       # stiffer: round-off shows


def drawn_over(length=0.5, conductance=0.1):
    """A ball without friction, cold, in steps of a length."""
    n, ball = 12, fx.tools.sphere(radius=0.8, z=0.05)
    scene = fx.Scene(mesh=fx.mesh.disc(radius=1.0, thickness=0.05, elements=(n, 1)), temperature=150.0,
                     materials=fx.NeoHookean(c10=1.0), supports=[fx.Symmetry("axis"), fx.Clamped("rim")],
                     heat=fx.Cooling(fx.ThermalProperties(conductivity=0.01, density=1.0, heat_capacity=1.0),
                                     unit="C", tools={"ball": (conductance, 30.0)}, tolerance=0.5),
                     contacts=[fx.Contact("top", ball, "none", direction=(0, -1), name="ball")])
    return fx.Process(scene).run([fx.Stage("push", control="ball", until=fx.travel(0.4), duration=0.5)], progress=False,
                                 accuracy=0.5, step=fx.StepControl(length=length, largest=length))


def test_contact_with_heat_flow_closes_one_node_per_step(monkeypatch):
    """When a node touches decides how cold it becomes: a step brings one, half an element (where none cools, more)."""
    def spreads():
        return 12 * np.diff(drawn_over()["contact_length"]).max()
    assert spreads() < 1.01
    monkeypatch.setattr(fx.Cooling, "conducts", lambda cooling, contact: False)
    assert spreads() > 1.01


def test_new_contact_conducts_for_half_of_its_step():
    """All of it would chill too much: 0.9 degrees in the mean of long steps, of 7; half of it 0.3."""
    means = []
    for length in (0.5, 0.005):
        path = drawn_over(length, 0.02)
        means.append(path.temperature(np.array([[R, 0.025] for R in np.linspace(0.0, 0.7, 15)])).mean())
    assert 0 < means[1] - means[0] < 0.5


def test_heat_flows_through_the_shape_in_the_middle_of_a_step():
    """A flux through a face that grows from pi to 4 pi in a second: q times the integral of the area, 7 pi/3."""
    scene = fx.Scene(mesh=fx.mesh.disc(radius=1.0, thickness=0.4, elements=(2, 1)), temperature=20.0,
                     materials=fx.NeoHookean(c10=1.0),
                     heat=fx.Cooling(fx.ThermalProperties(conductivity=1e3, density=2.0, heat_capacity=3.0),
                                     [fx.HeatFlux("top", flux=1.0)], unit="C", tolerance=0.01),
                     supports=[fx.Symmetry("axis"), fx.Symmetry("bottom", normal="z"),
                               fx.PrescribedDisplacement("rim", "r", name="rim")])
    path = fx.Process(scene).run([fx.Stage("pull", control="rim", until=fx.travel(1.0), duration=1.0)], accuracy=0.5,
                                 step=fx.StepControl(length=0.2, largest=0.2), progress=False)
    assert 4 < len(path) < 20
    assert path.temperature(np.array([[0.5, 0.2]]))[0] - 20 == pytest.approx(7 / 3 / (6 * 0.4), rel=0.01)


def press(scene, travel=0.15, **options):
    push = fx.Stage("push", control="plug", until=fx.travel(travel), duration=0.5)
    return fx.Process(scene).run([push, fx.Stage("hold", duration=0.5)], progress=False, accuracy="draft", **options)


def told(path):
    """Numbers of the last state: forces, temperatures of the sheet, wall."""
    T = path.temperature(np.array([[R, Z] for R in (0.0, 0.3, 0.7) for Z in (0.0, 0.05)]))
    m = path.last.measures
    return [*T.tolist(), m["tool_force"], m["pole_height"], m["dissipated_energy"], *path.profile().thickness_ratio[:3],
            float(len(path))]


@pytest.mark.thorough
def test_a_restarted_run_equals_an_uninterrupted_one(tmp_path):
    scene = pressed()
    whole = press(scene, checkpoint=tmp_path / "run")
    assert told(whole)[1] < 120 and whole.last.measures["tool_force"] != 0
    for number in (len(whole) // 2, len(whole) - 2):
        start = fx.load(tmp_path / "run", scene, state=number)
        again = press(scene, start=start)
        same(again, whole, rel=1e-9)
        assert told(again) == pytest.approx(told(whole), rel=1e-9)


@pytest.mark.thorough
def test_saved_temperatures_belong_to_their_points():
    """Of the body and of a conducting tool: rows in another order are found, and moved points are refused."""
    history = Problem(pressed()).history.parts[-1]
    data = history.save(history.get())
    for part, key in ((data, "temperature"), (data["tools"][0], "excess")):
        part[key] = np.arange(float(np.size(part[key]))).reshape(np.shape(part[key]))[::-1]
        part["points"] = np.array(part["points"])[::-1]
    loaded = history.load(data)
    assert np.array_equal(loaded.temperature, data["temperature"][::-1])
    assert np.array_equal(loaded.tool_excess[0], data["tools"][0]["excess"][::-1])
    for part in (data["tools"][0], data):
        part["points"] = part["points"] + 1e-6
        with pytest.raises(fx.InputError, match="the temperature history belongs to another mesh"):
            history.load(data)


RANKS = """
import json, sys
sys.path.insert(0, "tests")
from test_cooling import press, pressed, told
scene = pressed()
found = told(press(scene, 0.06))
if scene.mesh.comm.rank == 0:
    print(json.dumps(found))
"""


@pytest.mark.thorough
def test_two_ranks_agree_with_one():
    one, two = (run_json(RANKS, ranks) for ranks in (1, 2))
    assert two == pytest.approx(one, rel=1e-9)


def laid_on(layers, stays=0.1):
    """(path, z and temperatures on the axis) of a sheet of 1 mm at 150 degrees that air presses on cold aluminium."""
    tool = fx.ConductingTool(thickness=0.02, back=30.0, conductivity=200.0, heat_capacity=2.43e6)
    heat = fx.Cooling(fx.ThermalProperties(conductivity=0.17, density=1050.0, heat_capacity=1800.0), unit="C",
                      tools={"table": (1000.0, tool)}, tolerance=0.02)
    scene = fx.Scene(mesh=fx.mesh.disc(radius=0.01, thickness=1e-3, elements=(2, layers)), temperature=150.0, heat=heat,
                     materials=fx.NeoHookean(c10=fx.table({20.0: 2e6, 150.0: 1e6})),
                     supports=[fx.Symmetry("axis"), fx.SimplySupported("rim")], loads=[fx.Pressure("top", name="air")],
                     contacts=[fx.Contact("bottom", fx.tools.plane(0.0).reversed(), "none", name="table")])
    path = fx.Process(scene).run([fx.Stage("press", control="air", until=fx.pressure(1e3), duration=stays)],
                                 progress=False)
    with path.problem.state_context(path.last):
        T = path.problem.temperature.T
        X, values = T.function_space.tabulate_dof_coordinates(), T.x.array
        axis = np.flatnonzero(X[:, 0] < 1e-12)
    return path, X[axis, 1], values[axis]


@pytest.mark.thorough
def test_a_warning_names_a_mesh_too_coarse_for_heat(caplog):
    """Right after it was laid on a tool; the estimate is within a factor of 3. Its layers are fine enough."""
    _, z, T = laid_on([2 ** (k / 3) for k in range(16)])
    order = np.argsort(z)
    assert "in space" not in caplog.text
    for layers in (1, 4, [1, 2, 4, 8]):
        caplog.clear()
        path, there, found = laid_on(layers)
        error = np.abs(found - np.interp(there, z[order], T[order])).max()
        history, = (h for h in path.problem.forms.histories if hasattr(h, "errors_in_space"))
        assert error / 3 < history.errors_in_space([path.last])[0] < 3 * error
        assert "The error of the temperature in space is about" in caplog.text and error > 0.2
        proposed = json.loads(re.search(r"such as elements=\(n, (\[.*?\])\)", caplog.text).group(1))
        caplog.clear()
        _, there, found = laid_on(proposed)
        error = np.abs(found - np.interp(there, z[order], T[order])).max()
        assert error < 2e-3 * 120 and "in space" not in caplog.text


def test_a_warning_names_the_end_of_a_contact(caplog):
    """A sheet lies on a colder tool up to half of its radius: elements along it, not through it, decide the error."""
    heat = fx.Cooling(fx.ThermalProperties(conductivity=0.17, density=1050.0, heat_capacity=1800.0), unit="C",
                      tools={"table": (1000.0, 30.0)}, tolerance=2.0)
    errors = []
    for elements in (10, [1, 1, 2, 3]), (10, [1, 1, 2, 2, 4, 4, 6, 6]), (40, [1, 1, 2, 3]):
        tool = fx.tools.cylinder(radius=5e-3, z=0.0).mirrored()
        scene = fx.Scene(mesh=fx.mesh.disc(radius=0.01, thickness=1e-3, elements=elements), temperature=150.0,
                         heat=heat, materials=fx.NeoHookean(c10=1e6),
                         supports=[fx.Symmetry("axis"), fx.Clamped("rim")],
                         contacts=[fx.Contact("bottom", tool, "none", name="table")])
        caplog.clear()
        fx.Process(scene).run([fx.Stage("lie", duration=5.0)], progress=False)
        found = re.search(r"about (.*?) degrees at time .* at \(R, Z\) = \(0\.005.*, 0\), where contact with 'table'"
                          r" ends: use shorter elements along the face", caplog.text)
        errors.append(float(found.group(1)))
    assert errors[1] > 0.8 * errors[0] and errors[2] < 0.7 * errors[0], errors


@pytest.mark.thorough
def test_a_face_that_bridges_a_fillet_between_its_nodes_counts_as_touching():
    """All nodes of a sheet touch a cup whose lip has a small fillet; elements half as long through the wall agree."""
    mould = fx.tools.cup(radius=34.0, depth=14.0, mouth=1.0, fillet=8.0, lip=3.0, draft=5.0)
    heat = fx.Cooling(fx.ThermalProperties(conductivity=0.2e-3, density=1.05e-3, heat_capacity=1.8), unit="C",
                      tools={"mould": (0.5e-3, 20.0)})
    found = []
    for rows in 3, 8:
        scene = fx.Scene(mesh=fx.mesh.disc(radius=40.0, thickness=1.0, elements=(24, rows)), temperature=150.0,
                         materials=fx.NeoHookean(c10=0.05), heat=heat, loads=[fx.Pressure("bottom", name="air")],
                         supports=[fx.Symmetry("axis"), fx.SimplySupported("rim")],
                         contacts=[fx.Contact("top", mould, "stick", name="mould")])
        path = fx.Process(scene).run([fx.Stage("blow", control="air", until=fx.pressure(0.15), duration=1.0),
                                      fx.Stage("hold", duration=2.0)], progress=False)
        found.append(path.temperature([[R, Z] for R in (0.0, 10.0, 20.0, 32.1, 38.0) for Z in (0.0, 0.5, 1.0)]))
        error, = path.problem.history.parts[-1].errors_in_space([path.last])
        assert error < 2.0                                       # of 130
    assert np.abs(found[0] - found[1]).max() < 2.0
    warned, = [float(re.search("about (.*?) degrees", finding.text).group(1)) for finding in path.findings()
               if finding.about == "temperature"]
    largest = max(path.problem.history.parts[-1].errors_in_space(path.states[1:]))
    assert largest > 20.0 and warned < 0.7 * largest             # ends of contacts that moved on are left out


@pytest.mark.parametrize("change, message", [
    ({}, None), ({"conductance": 500.0}, "conductance 500 is 2.5e.06 times conductivity over thickness"),
    ({"density": 1.05e-9}, "the diffusivity, .* is 1.06e.05, and the body 20 long"),
    ({"hot": 423.0}, "up to 423 hot.*degrees Celsius, 'C', or kelvin"), ({"unit": "K"}, "down to 30 cold.*unit='K'"),
    ({"hot": 423.0, "tool": 303.0, "unit": "K"}, None), ({"duration": None}, "takes no time, so that no heat")],
    ids=lambda value: ", ".join(value) if isinstance(value, dict) else "")
def test_mixed_units_of_heat_are_reported(change, message):
    """In W, mm, s and degrees Celsius."""
    given = {"conductance": 5e-4, "density": 1.05e-3, "hot": 150.0, "tool": 30.0, "unit": "C", "duration": 0.3} | change
    polymer = fx.ThermalProperties(conductivity=0.2e-3, density=given["density"], heat_capacity=1.8)
    heat = fx.Cooling(polymer, unit=given["unit"], tools={"mould": (given["conductance"], given["tool"])})
    scene = fx.Scene(mesh=fx.mesh.disc(radius=20.0, thickness=1.0, elements=(8, [1, 2, 2, 1])), heat=heat,
                     temperature=given["hot"], materials=fx.NeoHookean(c10=0.2),
                     supports=[fx.Symmetry("axis"), fx.Clamped("rim")], loads=[fx.Pressure("bottom", name="air")],
                     contacts=[fx.Contact("top", fx.tools.plane(4.0), "none", name="mould")])
    stage = fx.Stage("blow", control="air", until=fx.pressure(0.02), duration=given["duration"])
    report = fx.check(scene, stages=[stage])
    assert re.search(message, str(report)) if message else report.healthy, str(report)
