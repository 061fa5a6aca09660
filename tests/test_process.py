"""Processes in stages: final states independent of the division into stages; nothing is compiled twice."""

import json

import numpy as np
import pytest
from conftest import run_json
from test_contact import support_force

import formingx as fx
from formingx.forms.formulation import Formulation
from formingx.forms.schedule import StepData
from formingx.problem.problem import Problem
from formingx.results.show.plots import main_columns
from formingx.solve.state import State

Stage, tools = fx.Stage, fx.tools
STEP = fx.StepControl(target=8)
PLUG = tools.sphere(radius=3, z=0.5)
FLOOR = fx.Contact("bottom", tools.plane(1.5).mirrored(), "stick", name="floor")    # everything below Z = -1.5


def disc(elements=(10, 1)):
    return fx.mesh.disc(radius=10.0, thickness=0.5, elements=elements)


def plugged(friction="none", elements=(10, 1), more=(), plug=PLUG, **options):
    """A clamped disc under pressure from below, and a round plug above it."""
    return fx.Scene(mesh=disc(elements), materials=fx.NeoHookean(c10=1.0), **options,
                    supports=[fx.Symmetry("axis"), fx.Clamped("rim")], loads=[fx.Pressure("bottom", name="air")],
                    contacts=[fx.Contact("top", plug, friction, direction=(0, -1), name="plug"), *more])


def run(scene, *stages, **options):
    return fx.Process(scene).run(stages, progress=False, **options)


def plug(name, travel, **options):
    return Stage(name, control="plug", until=fx.travel(travel), step=STEP, **options)


def air(name, pressure, **options):
    return Stage(name, control="air", until=fx.pressure(pressure), step=STEP, **options)


def same(a, b, size=1e-8, n=None):
    return np.abs(a.x - b.x)[:n].max() < size * np.abs(b.x).max()


def end(path, stage):
    return [s for s in path.states if s.stage == stage][-1]


@pytest.fixture(scope="module")
def there_and_back():
    return run(plugged(), air("low", 0.02), plug("down", 2.0), air("high", 0.05), plug("up", 0.0),
               air("low again", 0.02), plug("away", -3.0), air("release", 0.0))


def test_an_elastic_process_returns(there_and_back):
    path = there_and_back
    assert same(end(path, "low again"), end(path, "low"))
    assert np.abs(path.last.x).max() < 1e-8 and path.last.measures["air_pressure"] == 0
    for stage, column, value in (("down", "plug_travel", 2.0), ("up", "plug_travel", 0.0),
                                 ("away", "plug_travel", -3.0), ("high", "air_pressure", 0.05)):
        assert end(path, stage).measures[column] == pytest.approx(value, abs=1e-12)
    assert end(path, "high").measures["plug_travel"] == 2.0


def test_the_order_of_stages_does_not_matter_without_friction(there_and_back):
    other = run(plugged(), plug("down", 2.0), air("high", 0.05))
    assert same(other.last, end(there_and_back, "high"))


@pytest.mark.parametrize("friction", ["none", 0.3, 1.0, "stick"])
def test_a_plug_in_strokes_leaves_the_sheet_undeformed(friction):
    """Back at rest the plug touches the pole without force: there its force grows as the square of the depth."""
    scene = fx.Scene(mesh=fx.mesh.disc(radius=10.0, thickness=0.3, elements=(20, 1)), materials=fx.NeoHookean(c10=0.2),
                     supports=[fx.Symmetry("axis"), fx.Clamped("rim")],
                     contacts=[fx.Contact("top", tools.sphere(radius=3.0, z=0.3), friction, direction=(0, -1))])
    strokes = [Stage(f"{way} {k}", control=scene.driven, until=fx.travel(depth * (way == "down")))
               for k, depth in enumerate((1.0, 2.0, 2.0)) for way in ("down", "up")]
    path = run(scene, *strokes)
    for k in range(3):
        rest = end(path, f"up {k}").measures
        assert abs(rest["pole_height"]) < 1e-9 and rest["tool_force"] < 1e-10 * path["tool_force"].max()
    second, third = (end(path, f"down {k}").measures["tool_force"] for k in (1, 2))
    assert third == pytest.approx(second, rel=1e-3)            # where it sticks depends on the steps, a little


def test_one_stage_is_a_trace():
    scene = fx.Scene(mesh=disc(), materials=fx.NeoHookean(c10=1.0), loads=[fx.Pressure("bottom")],
                     supports=[fx.Symmetry("axis"), fx.Clamped("rim")])
    targets = {"until": fx.pole_stretch(2.0), "intermediate": [fx.pressure(0.05)]}
    traced = fx.trace(scene, progress=False, **targets)
    staged = run(scene, Stage("up", control=scene.loads[0], **targets))
    assert [s.control for s in traced.states] == [s.control for s in staged.states]
    assert traced.columns == staged.columns and np.array_equal(traced.last.x, staged.last.x)


def test_a_process_passes_a_limit_point_and_returns():
    """A stage that ends on the falling branch; the next goes back by pole height, through the maximum, to rest."""
    mesh = fx.mesh.disc(radius=1.25, thickness=0.082, elements=(10, 1))
    p = fx.Pressure("bottom")
    scene = fx.Scene(mesh=mesh, materials=fx.NeoHookean(c10=2.0), loads=[p],
                     supports=[fx.Symmetry("axis"), fx.SimplySupported("rim")])
    path = run(scene, Stage("blow", control=p, until=fx.pole_stretch(4.0)),
               Stage("back", control=p, until=fx.pole_height(0.1)))
    first, second = path.limit_points
    assert (first.stage, second.stage) == ("blow", "back")
    assert first.measures["pressure"] == pytest.approx(second.measures["pressure"], rel=1e-9)
    first_at_this_height = path.state_at(fx.pole_height(0.1))
    assert first_at_this_height.measures["pressure"] == pytest.approx(path.last.measures["pressure"], rel=1e-9)


def test_stages_with_tables_hit_the_knots_exactly():
    """Knots are hit exactly; the end is that of driving one thing after the other; what waits stays."""
    tables = {"plug": [(0, 0), (1, 1.0), (2, 1.0), (4, 2.0)], "air": [(2.5, 0.0), (3, 0.02), (5, 0.05)]}
    path = run(plugged(), Stage("machine", amplitudes=tables, intermediate=[fx.process_time(3.5)], step=STEP))
    times, met = path["process_time"], [s for s in path.states if s.kind == "target"]
    assert np.all(np.diff(times) >= 0)
    assert [s.measures["process_time"] for s in met] == pytest.approx([1, 2, 2.5, 3, 3.5, 4, 5], abs=1e-12)
    for column, thing in (("plug_travel", "plug"), ("air_pressure", "air")):
        exact = np.interp(times, *np.transpose(tables[thing]))
        assert path[column] == pytest.approx(exact, abs=1e-12)
    assert same(path.last, run(plugged(), plug("down", 2.0), air("high", 0.05)).last)
    half = run(plugged(), Stage("a", amplitudes={"plug": [(1, 1.0), (3, 2.0)]}, until=fx.process_time(2), step=STEP),
               Stage("b", amplitudes={"plug": [(4, 2.0)]}, step=STEP))
    assert end(half, "a").measures["plug_travel"] == pytest.approx(1.5, abs=1e-12)
    assert half.last.measures["plug_travel"] == pytest.approx(2.0, abs=1e-12)
    assert half.last.measures["process_time"] == pytest.approx(4.0, abs=1e-12)


@pytest.mark.parametrize("end", [1e-20, 1e-12, 1e12])
def test_tables_do_not_depend_on_the_unit_of_time(end):
    """Without materials that know time a table is the same in any unit of time."""
    scene = fx.Scene(mesh=disc(), materials=fx.NeoHookean(c10=1.0), loads=[fx.Pressure("bottom", name="air")],
                     supports=[fx.Symmetry("axis"), fx.Clamped("rim")])
    path = run(scene, Stage("up", amplitudes={"air": [(0.0, 0.0), (end, 0.05)]}))
    assert path.last.measures["process_time"] == pytest.approx(end)
    assert path.last.measures["pressure"] == pytest.approx(0.05)


def test_a_table_beyond_a_limit_point_is_refused():
    p = fx.Pressure("bottom")
    mesh = fx.mesh.disc(radius=1.25, thickness=0.082, elements=(10, 1))
    scene = fx.Scene(mesh=mesh, materials=fx.NeoHookean(c10=2.0), loads=[p],
                     supports=[fx.Symmetry("axis"), fx.SimplySupported("rim")])
    with pytest.raises(fx.ConvergenceError, match="Stage 'blow'.*limit point") as error:
        run(scene, Stage("blow", amplitudes={p: [(0, 0), (1, 0.6)]}))
    assert error.value.path.last.measures["pressure"] == pytest.approx(0.4933, rel=0.02)


def test_nothing_is_compiled_between_stages(monkeypatch):
    compiled, compile_ = [], Formulation.compile
    monkeypatch.setattr(Formulation, "compile", lambda self, form: compiled.append(1) or compile_(self, form))
    scene = plugged()
    run(scene, air("a", 0.02))
    one = len(compiled)
    run(scene, air("a", 0.02), plug("b", 1.0), Stage("c", amplitudes={"plug": [(1, 0.0)]}, step=STEP), air("d", 0.01))
    assert one > 0 and len(compiled) == 2 * one


def kinds():
    """A scene in which a pressure, a support and a tool can be driven."""
    mesh = fx.mesh.disc(radius=10.0, inner_radius=1.0, thickness=0.5, elements=(10, 1))
    return fx.Scene(mesh=mesh, materials=fx.NeoHookean(c10=1.0),
                    supports=[fx.Clamped("rim"), fx.PrescribedDisplacement("inner", name="pin")],
                    loads=[fx.Pressure("bottom", name="air"), fx.Pressure("top", 0.001)],
                    contacts=[fx.Contact("top", tools.sphere(radius=1, r=4.0, z=0.5), "stick", direction=(0, -1),
                                         name="bar")],
                    kinematics=fx.PlaneStrain())


@pytest.mark.parametrize("number", range(5), ids=["air", "none", "clamp", "pin", "bar"])
def test_derivative_by_control_after_a_change_of_stage(number):
    """dF/dcontrol, and with it everything driven at once by a table, is the derivative of F."""
    path = run(kinds(), Stage("bar", control="bar", until=fx.travel(0.5), step=STEP),
               Stage("pin", control="pin", until=fx.travel(-0.3), step=STEP),
               Stage("air", control="air", until=fx.pressure(0.01)))
    problem, state, h = path.problem, path.last, 1e-8 if number in (1, 4) else 1e-6      # a ramp is narrow
    rate = [0.0] * 6
    rate[number] = 1.0
    if number == 1:                                                         # all together
        rate = [0.3, 0.0, 0.0, -0.5, 0.2, 0.1]
    base = StepData(**state.setting).amplitudes(state.control)
    problem.enter(StepData(base, rate, [], stage=9), state.x, 0.0)
    plus, minus, exact, x = (problem.x.duplicate() for _ in range(4))
    for out, control in ((plus, h), (minus, -h)):
        x.setArray(state.x)
        x.array_w[problem.constrained] += control * problem.constrained_rate
        problem.residual(x, control, out)
    x.setArray(state.x)
    problem.residual(x, 0.0, exact)
    assert exact.norm() < 1e-8 * problem.force_scale
    problem.control_derivative(x, 0.0, exact)
    free = np.setdiff1d(np.arange(len(state.x)), problem.constrained)
    numeric = (plus.array - minus.array) / (2 * h)
    assert np.abs(exact.array[free]).max() > 1e-4 or number == 2
    np.testing.assert_allclose(numeric[free], exact.array[free], atol=1e-5 * np.abs(exact.array).max())
    assert np.array_equal(exact.array[problem.constrained], -problem.constrained_rate)


@pytest.mark.parametrize("friction", ["none", "stick", 0.3])
def test_forces_balance(friction):
    """The plug's force from its tractions is that of the supports less the resultant of the pressure."""
    path = run(plugged(friction, (20, 2)), plug("down", 2.0), air("press", 0.02),
               tolerances=fx.Tolerances(residual=1e-10))
    pressure = 0.02 * np.pi * 10.0**2                       # of a follower pressure inside a clamped rim, along Z
    force = path.last.measures["tool_force"]
    assert force > 0.5
    assert support_force(path.problem, path.last, 1) + pressure == pytest.approx(force, rel=1e-6)


def test_tools_on_both_faces_with_their_own_friction():
    path = run(plugged(0.2, (20, 2), more=[FLOOR]), plug("down", 1.8), air("vacuum", -0.02))
    last = path.last.measures
    assert last["floor_force"] < -0.1 and last["plug_force"] > 0.1 and "tool_force" not in path.columns
    assert support_force(path.problem, path.last, 1) - 0.02 * np.pi * 100 == pytest.approx(
        last["floor_force"] + last["plug_force"], rel=1e-5)
    assert end(path, "down").measures["floor_force"] < 0


def test_forces_of_tools_balance(tmp_path):
    """A plug from below, a mould above, both with names: the plug resists its travel, and all forces are in balance."""
    mould = tools.cup(radius=9.0, depth=4.0, mouth=0.5, fillet=1.0, lip=0.5)
    scene = fx.Scene(mesh=disc((20, 2)), materials=fx.NeoHookean(c10=1.0), loads=[fx.Pressure("bottom", name="air")],
                     supports=[fx.Symmetry("axis"), fx.Clamped("rim")],
                     contacts=[fx.Contact("top", mould, "stick", name="mould"),
                               fx.Contact("bottom", tools.male(radius=4.0, height=20.0, base=-20.0, fillet=1.0), "none",
                                          direction=(0, 1), name="plug")])
    path = run(scene, plug("up", 3.8), air("blow", 0.3), tolerances=fx.Tolerances(residual=1e-10))
    assert [c for c in path.columns if c.endswith("force")] == ["plug_force", "mould_force"]
    for state in (end(path, "up"), path.last):
        with path.problem.state_context(state):
            found, clamp = state.measures, support_force(path.problem, state, 1)     # of the clamp on the body, along Z
        pressure = found["air_pressure"] * np.pi * 100                           # inside a clamped rim
        assert found["plug_force"] - found["mould_force"] + clamp + pressure == pytest.approx(
            0, abs=1e-6 * max(found["plug_force"], pressure))
    assert end(path, "up").measures["plug_force"] > 1 and path.last.measures["mould_force"] > 1
    forces = path.tool_forces()
    assert list(forces) == ["mould", "plug"] and np.array_equal(forces["plug"], path["plug_force"])
    path.to_csv(tmp_path / "pot.csv")
    assert {"plug_force", "mould_force"} < set((tmp_path / "pot.csv").read_text().splitlines()[0].split(","))
    path.report(tmp_path / "pot.html")
    assert "plug force" in (text := (tmp_path / "pot.html").read_text()) and "mould force" in text
    assert path.plot(*main_columns(path.columns)[::-1]).get_ylabel() == "plug force"


def test_two_tools_on_one_face():
    ring = fx.Contact("top", tools.sphere(radius=1.0, r=6.0, z=0.5), 0.1, direction=(0, -1), name="ring")
    path = run(plugged("stick", (20, 2), more=[ring]), plug("plug", 1.0), Stage("ring", control="ring", step=STEP,
                                                                                until=fx.travel(1.0, of="ring")))
    assert path.last.measures["ring_travel"] == 1.0 == path.last.measures["plug_travel"]
    assert path.last.measures["ring_force"] > 0.01 and end(path, "plug").measures["ring_force"] == 0


def test_the_force_of_a_removed_tool_fades_away():
    """Its force fades away; the sheet is then as if it had never been there; it comes back only where no body is."""
    path = run(plugged("stick"), plug("down", 2.0), Stage("gone", inactive=["plug"], step=STEP),
               air("blow", 0.02, inactive=["plug"]), plug("home", -4.0, inactive=["plug"]), plug("again", -1.0))
    alone = run(plugged(), air("blow", 0.02, inactive=["plug"]))
    assert np.abs(end(path, "gone").x).max() < 1e-8
    assert same(end(path, "blow"), alone.last) and same(end(path, "home"), end(path, "blow"), 1e-12)
    assert end(path, "gone").measures["tool_force"] == 0 < path.last.measures["tool_force"]
    with pytest.raises(fx.InputError, match="Stage 'again'.*takes part again where the body is, which reaches 2.51"):
        run(plugged("stick"), air("blow", 0.02, inactive=["plug"]), plug("again", 1.0))


def test_an_inactive_load_has_no_value_in_its_columns(tmp_path):
    """It leaves and comes back gradually, and its columns say what acts; its value waits for it."""
    path = run(plugged(), air("on", 0.05), Stage("off", inactive=["air"], step=STEP),
               plug("down", 0.5, inactive=["air"]),
               plug("up", 0.0, inactive=["air"]), Stage("on again", step=STEP))
    found = {stage: np.array([s.measures["air_pressure"] for s in path.states if s.stage == stage])
             for stage in ("off", "down", "on again")}
    assert found["off"][0] == 0.05 == found["on again"][-1] and not found["down"].any()
    assert np.all(np.diff(found["off"]) < 0) and found["off"][-1] == 0
    assert np.all(np.diff(found["on again"]) > 0) and found["on again"][0] == 0
    assert same(path.last, run(plugged(), air("on", 0.05)).last)
    half = path.state_at(fx.pressure(0.025, of="air"), after=end(path, "down"))
    assert half.stage == "on again" and half.measures["air_pressure"] == pytest.approx(0.025, abs=1e-10)
    path.to_csv(tmp_path / "off.csv")
    rows = [line.split(",") for line in (tmp_path / "off.csv").read_text().splitlines()]
    assert {row[rows[0].index("air_pressure")] for row in rows if row[0] == "down"} <= {"0", "0.0"}


def gripped():
    return fx.Scene(mesh=disc(), materials=fx.NeoHookean(c10=1.0), loads=[fx.Pressure("bottom", name="air")],
                    supports=[fx.Symmetry("axis"), fx.SimplySupported("rim"), fx.Clamped("rim")])


def test_supports_that_open_and_close():
    """A grip that opens leaves the hinge's state; one that closes holds the rim as it is then."""
    hinged, grip = gripped(), 2
    grip, hinge = hinged.supports[2], hinged.supports[1]
    path = run(hinged, air("up", 0.05, inactive=[hinge]), Stage("open", inactive=[grip]),
               Stage("close", inactive=[hinge]),
               air("down", 0.0, inactive=[hinge]), Stage("loose", inactive=[grip]))
    plain = run(hinged, air("up", 0.05, inactive=[grip]))
    held, opened = path.problem, end(path, "open")
    assert same(opened, plain.last)
    own = held.forms.space.dofmap.index_map.size_local
    assert same(end(path, "close"), plain.last, n=own)      # without the hinge's force
    held.enter(StepData(**end(path, "down").setting), end(path, "down").x, 0.0)
    assert np.abs(end(path, "down").x - opened.x)[held.constrained].max() < 1e-14
    assert end(path, "down").measures["pole_height"] > 0.1                  # the turned rim keeps it bent
    assert np.abs(path.last.x).max() < 1e-8


def test_a_hold_records_its_state():
    path = run(plugged(), plug("down", 1.0), Stage("hold"), plug("up", 0.5))
    held = [s for s in path.states if s.stage == "hold"]
    assert len(held) == 1 and np.array_equal(held[0].x, end(path, "down").x) and held[0].setting["rate"] == [0.0] * 5


STAGES = [plug("down", 1.0, intermediate=[fx.travel(0.5)]), Stage("gone", inactive=["plug"], step=STEP),
          Stage("hold", inactive=["plug"]),
          Stage("tables", amplitudes={"air": [(0, 0), (1, 0.01), (2, 0.01), (3, 0.02)]}, inactive=["plug"], step=STEP),
          plug("home", -4.0, inactive=["plug"]), plug("again", -1.5)]


@pytest.mark.thorough
def test_a_process_continues_from_any_state():
    """From every state whose step was complete, as plain data: the same states follow."""
    whole = run(plugged("stick"), *STAGES)
    for k, state in enumerate(whole.states):
        if not state.stepping:
            continue
        kept = State(state.x, state.control, state.direction, state.slope, dict(state.measures), state.history,
                        state.kind, state.target, state.history_variables, stage=state.stage,
                        setting=json.loads(json.dumps(state.setting)),
                        stepping=json.loads(json.dumps(state.stepping)))
        rest = run(plugged("stick"), *STAGES, start=kept)
        assert [s.stage for s in rest.states] == [s.stage for s in whole.states[k:]], k
        assert same(rest.last, whole.last, 1e-10), k


def test_checkpoint(tmp_path):
    whole = run(plugged("stick"), *STAGES, checkpoint=tmp_path / "whole")
    scene = plugged("stick")
    for k in (3, len(whole) // 2, None):
        path = run(scene, *STAGES, start=fx.load(tmp_path / "whole", scene, state=k))
        assert len(path) == len(whole) and same(path.last, whole.last, 1e-10)


def test_record_and_csv_of_a_process_are_complete(tmp_path, there_and_back):
    path = there_and_back
    assert {"plug_travel", "air_pressure", "tool_force"} <= set(path.columns)
    path.to_csv(tmp_path / "process.csv")
    rows = [line.split(",") for line in (tmp_path / "process.csv").read_text().splitlines()]
    assert rows[0][:3] == ["stage", "kind", "iterations"] and len(rows) == len(path) + 1
    assert [row[0] for row in rows[1:]] == [s.stage for s in path.states]
    found = path.state_at(fx.travel(1.0, of="plug"))
    assert found.stage == "down" and found.measures["plug_travel"] == pytest.approx(1.0, abs=1e-10)
    assert found.measures["air_pressure"] == pytest.approx(0.02)
    travel, pole = path.curve("plug_travel", "pole_height", points=3)
    assert len(travel) > len(path) and travel.min() == -3.0
    # measures of an earlier state are those of its own stage
    assert path.value("tool_force", end(path, "high")) == end(path, "high").measures["tool_force"]


AT_REST = Stage("up", control="air", until=fx.pressure(0.1))


@pytest.mark.parametrize("make, words", [
    (lambda: Stage("a", control="plug"), "without a target"),
    (lambda: Stage("a", until=fx.travel(1)), "drives nothing"),
    (lambda: Stage("a", control="plug", until=3.0), "must be a target"),
    (lambda: Stage("a", control="plug", amplitudes={"air": [(0, 0)]}), "both control and amplitudes"),
    (lambda: Stage("", control="plug", until=fx.travel(1)), "must be a word"),
    (lambda: Stage("a", amplitudes={"air": [(0, 0), (2, 1), (1, 2)]}), "goes back in time.*1 after 2"),
    (lambda: Stage("a", amplitudes={"air": [(0, 0), (0, 1)]}), "goes back in time"),
    (lambda: run(plugged(), Stage("a", amplitudes={"air": [(0, 0), (1, 1e166)]})),
     r"the table of Pressure.* goes to 1e\+166: it is 5e\+165 times the shear modulus, 2"),
    (lambda: run(plugged(), plug("a", 1e12)), "travel = 1e.12: it is 1e.11 times the length of the body, 10"),
    (lambda: fx.Process(plugged()).run([plug("a", 1.0)], progress=np.zeros((2, 2))), "must be True or False"),
    (lambda: Stage("a", amplitudes={"air": [(0, 0, 1)]}), r"must be \[\(time, value\)"),
    (lambda: Stage("a", amplitudes={}), "must be {item"),
    (lambda: Stage("a", amplitudes={"air": [(0, 0), (1, 1)]}, until=fx.pressure(1)), "until a process_time"),
    (lambda: run(plugged()), "at least one Stage"),
    (lambda: run(plugged(), AT_REST, AT_REST), "two stages are called 'up'"),
    (lambda: run(plugged(), plug("a", 1), "b"), "must be a formingx.Stage"),
    (lambda: run(plugged(), Stage("a", control="ram", until=fx.travel(1))), "'ram' is not in the scene.*'plug'"),
    (lambda: run(plugged(), Stage("a", control=fx.Pressure("top"), until=fx.pressure(1))), "not in the scene"),
    (lambda: run(plugged(), plug("a", 1, inactive=["seal"])), "'seal' is not in the scene"),
    (lambda: run(plugged(), air("a", 1, inactive=["air"])), "both driven and left out"),
    (lambda: run(kinds(), Stage("a", control=kinds, until=fx.travel(1))), "not in the scene"),
    (lambda: run(gripped(), air("a", 1, inactive=gripped().supports)), "not in the scene"),
    (lambda: (lambda s: run(s, air("a", 1, inactive=s.supports[1:])))(gripped()), "'a'.*free to move"),
    (lambda: (lambda s: run(s, air("a", 1, inactive=s.supports[:1])))(gripped()), "'a'.*touches the axis"),
    (lambda: (lambda s: run(s, Stage("a", control=s.supports[1], until=fx.travel(1))))(plugged()),
     "cannot be driven"),
    (lambda: run(plugged(), Stage("a", control="air", until=fx.travel(1, of="plug"))), "does not drive that"),
    (lambda: run(plugged(), Stage("a", control="air", until=fx.travel(1, of="hoop"))), "of = 'hoop' is not known"),
    (lambda: run(plugged(), air("a", 0.01), Stage("b", amplitudes={"air": [(0, 0), (1, 1)]})), "it stands at 0.01"),
    (lambda: run(plugged(), Stage("a", amplitudes={"air": [(1, 0.01)]}),
                 Stage("b", amplitudes={"air": [(0.5, 0), (3, 1)]})),
     "process time is 1 already"),
    (lambda: fx.trace(plugged(), until=fx.pressure(1)), "one control drives a run"),
    (lambda: fx.solve(plugged(), to=1), "one control drives a run"),
    (lambda: run(plugged(more=[FLOOR]), plug("a", 1), plug("b", 2.5)),
     "'b': tools overlap.*at travel 2.0.*into each other"),
    (lambda: run(plugged(more=[FLOOR]), Stage("b", amplitudes={"plug": [(1, 2.5)]}, step=STEP)), "'b': tools overlap"),
    (lambda: run(plugged(plug=tools.cylinder(radius=12, z=0.5)), plug("a", 1)), "'a'.*whole height.*'rim'"),
    (lambda: plugged(more=[fx.Contact("top", PLUG, direction=(1, -1), name="plug")]), "two items are called 'plug'"),
])
def test_bad_input(make, words):
    with pytest.raises(fx.InputError, match=words):
        make()


RANKS = """
import json, sys
sys.path.insert(0, "tests")
from test_process import STAGES, plugged, run
path = run(plugged("stick"), *STAGES)
found = [[s.measures[k] for k in ("pole_height", "tool_force", "air_pressure", "plug_travel")] for s in path.states]
if path.problem.comm.rank == 0:
    print(json.dumps([path.counts.steps, path.counts.iterations, *sum(found, [])]))
"""


@pytest.mark.thorough
def test_ranks_agree():
    one, two = (run_json(RANKS, ranks) for ranks in (1, 2))
    assert two == pytest.approx(one, rel=1e-8, abs=1e-10)


def test_frictionless_processes_have_no_history_variables():
    assert not Problem(plugged()).history.path_dependent and Problem(gripped()).contacts == []


def test_a_restart_with_other_stages_is_refused():
    path = run(plugged(), plug("down", 1.0))
    with pytest.raises(fx.InputError, match="last state is of stage 'down', number 1, but stage 1 is 'blow' now"):
        fx.Process(path.problem.scene).run([air("blow", 0.01)], start=path, progress=False)


def test_tables_follow_one_another():
    """A table ends at 0 up to round-off; the next one begins with 0."""
    path = run(plugged(), Stage("one", amplitudes={"plug": [(0, 0), (1, 1.0), (1.7, 0)]}, step=STEP),
               Stage("two", amplitudes={"plug": [(1.7, 0), (2.7, 1.0)]}, step=STEP))
    assert path["plug_travel"][-1] == pytest.approx(1.0)


def test_tools_of_a_stage_start_where_the_previous_stage_ended():
    """How far a plug has come at a pole height is known when the next stage begins; what was computed is kept."""
    floor = fx.Contact("bottom", tools.plane(2.0).mirrored(), "none", name="floor")
    by_height = Stage("by height", control="plug", until=fx.pole_height(-1.0), step=STEP)
    with pytest.raises(fx.InputError, match="Stage 'too far'.*tools overlap") as caught:
        run(plugged(more=[floor]), by_height, plug("too far", 3.5))
    assert caught.value.path.last.measures["pole_height"] == pytest.approx(-1.0)


def test_a_controlled_item_is_not_constant_too():
    scene = fx.Scene(mesh=disc(), materials=fx.NeoHookean(c10=1.0),
                     supports=[fx.Symmetry("axis"), fx.Clamped("rim"),
                               fx.PrescribedDisplacement("rim", "z", name="lift")])
    with pytest.raises(fx.InputError, match="Clamped.*holds the same component of the same boundary"):
        fx.trace(scene, until=fx.travel(1.0), progress=False)
    with pytest.raises(fx.InputError, match="Stage 'lift'.*holds the same component"):
        run(scene, Stage("lift", control="lift", until=fx.travel(1.0)))


def test_a_state_of_the_path_that_meets_a_target_is_found(there_and_back):
    path = there_and_back
    assert path.state_at(fx.travel(2.0, of="plug")) is end(path, "down")
    assert path.state_at(fx.travel(1.5)).stage == "down"             # whatever was looked at before
    path.value("tool_force", path.last)
    assert path.state_at(fx.travel(1.5)).stage == "down"
    with pytest.raises(fx.InputError, match="after: must be a state of this path"):
        path.state_at(fx.travel(1.5), after=State(np.zeros(1), 0.0, np.zeros(1), 0.0))
    with pytest.raises(fx.InputError, match="column 'travel' is not known"):
        path.curve("travel")


def test_a_measure_in_amplitudes_needs_a_control():
    with pytest.raises(fx.InputError, match="enclosed_volume is an output quantity: give control="):
        fx.Stage("a", amplitudes={fx.enclosed_volume: [(0.0, 0.0), (1.0, 100.0)]})


def test_a_tool_whose_name_has_a_space_has_one_column_of_force():
    tools = [fx.Contact("top", fx.tools.sphere(radius=9.0, z=0.5), direction=(0, -1), name="plug 1"),
             fx.Contact("bottom", fx.tools.plane(-5.0).reversed(), name="mould")]
    scene = fx.Scene(mesh=fx.mesh.disc(radius=20.0, thickness=0.5, elements=(8, 1)), materials=fx.NeoHookean(c10=0.3),
                     supports=[fx.Symmetry("axis"), fx.SimplySupported("rim")], contacts=tools)
    path = fx.Process(scene).run([fx.Stage("a", control="plug 1", until=fx.travel(1.0))], progress=False)
    assert [column for column in path.columns if "force" in column] == ["plug 1_force", "mould_force"]
