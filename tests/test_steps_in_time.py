"""Steps in time: tables with corners, continued runs, and the error that `accuracy` promises, for any step control."""

import numpy as np
import pytest
from test_time import block

import formingx as fx
from formingx import Stage, StepControl
from formingx.solve.stepping import TimeError

QUICK = [(0, 0), (1, 0), (1.0001, 0.6), (2, 0.6), (2.0001, 0.2), (4, 0.2)]
SLOW = fx.Viscoelastic(fx.NeoHookean(c10=0.5), branches=[(5.0, 0.2), (0.1, 10.0)])


def sheet(mu=0.3, n=14, material=None):
    """A sheet on which a ball comes down."""
    material = material or fx.Viscoelastic(fx.NeoHookean(c10=0.05), branches=[(0.3, 0.5), (0.4, 5.0)])
    return fx.Scene(mesh=fx.mesh.disc(radius=40, thickness=1.2, elements=(n, 1)), materials=material,
                    supports=[fx.Symmetry("axis"), fx.SimplySupported("rim")],
                    contacts=[fx.Contact("top", fx.tools.sphere(radius=15, z=1.2), mu, direction=(0, -1), name="ball")])


def run(scene, *stages, **options):
    return fx.Process(scene).run(stages, progress=False, **{"max_steps": 3000, **options})


@pytest.mark.parametrize("ramp", [1e-3, 1e-4, 3e-7])
def test_a_hold_after_a_quick_ramp_has_no_spurious_rate(ramp):
    """Round-off of a short ramp was taken for what drives the hold: steps of 1e-13, without an end."""
    table = [(0, 0), (1, 0), (1 + ramp, 0.6), (2, 0.6), (2 + ramp, 0.2), (4, 0.2)]
    path = run(block(SLOW), Stage("move", amplitudes={"pull": table}), accuracy="draft", max_steps=200)
    held = [s for s in path.states if 1 + 2 * ramp < s.time < 2 or 2 + 2 * ramp < s.time]
    assert {s.measures["travel"] for s in held} == {0.6, 0.2} and len(path) < 250
    assert all(s.setting["rate"][2] == 0 for s in held)


@pytest.mark.parametrize("corner", [1.0, 1.0001, 2.0, 4.0])
def test_a_target_at_a_corner_of_a_table(corner):
    for stage in (Stage("move", amplitudes={"pull": QUICK}, intermediate=[fx.process_time(corner)]),
                  Stage("flow", control="pull", amplitudes={fx.travel: QUICK}, intermediate=[fx.process_time(corner)])):
        path = run(block(SLOW), stage, accuracy="draft", max_steps=200)
        met = path.target_state(fx.process_time(corner))
        assert met.time == pytest.approx(corner, rel=1e-12) and path.last.time == pytest.approx(4.0, rel=1e-12)
        assert met.measures["travel"] == pytest.approx(np.interp(corner, *np.transpose(QUICK)), abs=1e-9)


@pytest.mark.thorough
def test_step_control_is_restored_from_any_state(tmp_path):
    """From any state, under a step control of one's own, the very same path goes on."""
    scene = sheet()
    stages = [Stage("in", control="ball", until=fx.travel(12), speed=20),
              Stage("out", control="ball", until=fx.travel(4), speed=20)]
    options = {"accuracy": "draft", "step": StepControl(target=8)}
    whole = run(scene, *stages, checkpoint=tmp_path, **options)
    for k in range(1, len(whole) - 1, 9):
        again = run(scene, *stages, start=fx.load(tmp_path, scene, state=k), **options)
        assert len(again) == len(whole)
        for column in whole.columns:
            np.testing.assert_array_equal(again[column], whole[column])


CYCLE = np.array([0.0, 1.0, 2.0, 3.0]), np.array([1.0, 2.0, 0.7, 1.5])
LAWS = [(fx.Viscoelastic, 1e-3), (fx.Viscoelastic, 0.05), (fx.Viscoelastic, 2.0), (fx.TransientNetwork, 1e-3),
        (fx.TransientNetwork, 0.01), (fx.TransientNetwork, 0.3),
        pytest.param(fx.KBKZ, 0.01, marks=pytest.mark.thorough)]


@pytest.mark.parametrize("law, tau", LAWS, ids=lambda x: getattr(x, "__name__", x))
@pytest.mark.parametrize("target, accuracy, promised", [
    (4, "standard", 2e-3), pytest.param(8, "draft", 1e-2, marks=pytest.mark.thorough)])
def test_accuracy_is_kept_for_any_relaxation_time(law, tau, target, accuracy, promised):
    """Stress in every state of a cycle, over the largest, against an ODE solver's; also where it goes through 0.

    Networks took from 457 to 10,246 states while steps had the mean rate; K-BKZ came to no end.
    """
    rubber, branches = fx.NeoHookean(c10=0.5), [(1 / tau, tau)]
    material = law(branches, equilibrium=rubber) if law is fx.KBKZ else law(rubber, branches)
    times, stretches = CYCLE
    path = run(block(material), Stage("cycle", amplitudes={"pull": [(t, l - 1) for t, l in zip(times, stretches)]}),
               accuracy=accuracy, step=StepControl(target=target))
    found = -path["support_force"] / np.pi
    exact = material.stress("uniaxial", 1 + path["travel"], times=path["process_time"])
    assert np.abs(found - exact).max() < promised * np.abs(exact).max() and len(path) < 300


@pytest.mark.thorough
def test_a_file_without_the_motion_of_a_material_is_refused():
    """Each internal variable must be in the file."""
    path = run(block(fx.TransientNetwork(None, [(1.0, 0.1)])), Stage("pull", amplitudes={"pull": [(0, 0), (1, 0.5)]}),
               accuracy="draft")
    history, = path.problem.history.materials
    with path.problem.state_context(path.last):
        kept = history.save(history.get())
        assert kept["values"]["pace"].min() > 0
        assert np.array_equal(history.load(kept).values["pace"], history.get().values["pace"])
        del kept["values"]["pace"]
        with pytest.raises(fx.InputError, match="belongs to another mesh, or to another material"):
            history.load(kept)


DOWN, BETWEEN = {"control": "ball", "until": fx.travel(7), "speed": 20}, fx.travel(5.0)


@pytest.fixture(scope="module")
def pressed():
    """A run in small steps."""
    return run(sheet(0), Stage("in", intermediate=[BETWEEN], **DOWN), accuracy=1e-4)


@pytest.mark.thorough
@pytest.mark.parametrize("target, promised", [(4, 1e-2), (8, 1e-2), (8, 2e-3)])
def test_accuracy_is_kept_under_a_tool_by_any_step_control(target, promised, pressed):
    """Force and energy; the step control allowed three states with an error of 7 % before."""
    def of(path):
        last = path.last.measures
        return np.array([last["ball_force"], last["strain_energy"] + last["dissipated_energy"]])
    path = run(sheet(0), Stage("in", **DOWN), accuracy=promised, step=StepControl(target=target))
    assert of(path) == pytest.approx(of(pressed), rel=promised)


def test_only_rate_dependent_runs_have_a_time_integration_error():
    path = run(sheet(0), Stage("at once", control="ball", until=fx.travel(7)), accuracy=1e-6)
    assert len(path) < 30


STIFFENS = fx.table({20: 6.0, 90: 2.0, 150: 1.0, 180: 0.8})
COOLED = {"elastic": (fx.NeoHookean(c10=STIFFENS), 0.05),
          "relaxing": (fx.Viscoelastic(fx.NeoHookean(c10=STIFFENS), [(STIFFENS, 0.3)], shift=fx.WLF(8, 250, 150)), 0.1)}


@pytest.mark.parametrize("name", ["elastic", pytest.param("relaxing", marks=pytest.mark.thorough)])
def test_accuracy_is_kept_while_a_body_cools(name):
    """A sheet that is blown and held in cold air; nothing but materials controlled the steps before (2.4 % off)."""
    material, pressure = COOLED[name]
    mesh = fx.mesh.disc(radius=1, thickness=0.05, elements=(6, 1))
    scene = fx.Scene(mesh=mesh, materials=material, temperature=150.0,
                     heat=fx.Cooling(fx.ThermalProperties(conductivity=0.01, density=1.0, heat_capacity=1.0),
                                     [fx.Convection("top", h=0.05, air=20.0)], unit="C", tolerance=0.01),
                     supports=[fx.Symmetry("axis"), fx.Clamped("rim")], loads=[fx.Pressure("bottom", name="air")])
    stages = [Stage("blow", control="air", until=fx.pressure(pressure), duration=0.5), Stage("hold", duration=2.0)]

    def heights(accuracy):
        path = run(scene, *stages, accuracy=accuracy)
        return [path.target_state(fx.pressure(pressure)).measures["pole_height"], path.last.measures["pole_height"]]
    exact = heights(4e-4)
    for accuracy, promised in (("draft", 1e-2), ("standard", 2e-3)):
        assert heights(accuracy) == pytest.approx(exact, rel=promised)


def test_a_state_between_two_is_as_accurate_as_the_run(pressed):
    """It took 2e-3 whatever the run had, and did not know what was dissipated."""
    def measured(state):
        return [state.measures[c] for c in ("ball_force", "strain_energy", "dissipated_energy", "process_time")]
    for accuracy, step in ((1e-2, StepControl(target=8)), (1e-3, None)):
        path = run(sheet(0), Stage("in", **DOWN), accuracy=accuracy, step=step)
        assert measured(path.state_at(BETWEEN)) == pytest.approx(measured(pressed.target_state(BETWEEN)), rel=accuracy)


def test_states_between_those_of_a_flow_are_refused():
    path = run(block(), Stage("flow", control="pull", amplitudes={fx.travel: [(0, 0), (1, 1)]}), accuracy=1e-2)
    with pytest.raises(fx.InputError, match="in a stage that controls an output quantity"):
        path.state_at(fx.travel(0.987654))


def test_check_sees_a_modulus_that_pulls_a_cooling_body_back():
    """On what is left when all has relaxed; not on a branch that sets, nor on a rubber's."""
    table, rubber = fx.table({20: 6.0, 150: 1.0}), fx.entropic(0.5, 150.0, unit="C")
    sets = fx.Viscoelastic(fx.NeoHookean(c10=rubber), [(20.0, 1e-3)], shift=fx.Arrhenius(200e3, 150.0, unit="C"))

    def found(material, air=20.0):
        scene = fx.Scene(mesh=fx.mesh.disc(radius=1, thickness=0.05), materials=material, temperature=150.0,
                         heat=fx.Cooling(fx.ThermalProperties(conductivity=0.01, density=1.0, heat_capacity=1.0),
                                         [fx.Convection("top", h=0.05, air=air)], unit="C"),
                         supports=[fx.Symmetry("axis"), fx.Clamped("rim")], loads=[fx.Pressure("bottom")])
        return [f.text for f in fx.check(scene).findings if "pulls back" in f.text]
    for material in (fx.NeoHookean(c10=table), fx.Viscoelastic(fx.NeoHookean(c10=table), [(table, 0.3)])):
        assert len(found(material)) == 1 and "6 times as large at 20 degrees" in found(material)[0]
        assert not found(material, air=145.0)
    assert not found(sets) and not found(fx.NeoHookean(c10=rubber))


@pytest.mark.parametrize("followed", ["pull", fx.travel], ids=["table", "flow"])
def test_cutbacks_end_at_the_smallest_step(followed, monkeypatch):
    """A run whose error in time does not fall with its steps ends in words at the smallest one."""
    asked = []

    def too_large(error, *_):
        asked.append(error)
        assert len(asked) < 500, "it goes on for ever"
        return 10.0
    monkeypatch.setattr(TimeError, "ratio", too_large)
    driven = {"control": "pull"} if followed is fx.travel else {}
    stage = Stage("cycle", **driven, amplitudes={followed: [(0, 0), (1, 0.5)]})
    with pytest.raises(fx.ConvergenceError, match="became shorter than.*the error in time"):
        run(block(fx.Viscoelastic(fx.NeoHookean(c10=0.5), branches=[(1.0, 1.0)])), stage)


def test_a_second_cutback_is_one_in_time(monkeypatch):
    """Where the body moves at once as a step begins, a shorter piece of path may take as long: time itself is cut."""
    ways = []

    def too_large(error, states, x, control):
        ways.append(control - states[-1].control)
        return 8.0 if len(ways) < 4 else 0.5
    monkeypatch.setattr(TimeError, "ratio", too_large)
    run(block(SLOW), Stage("cycle", amplitudes={"pull": [(0, 0), (1, 0.5)]}))
    assert ways[2:4] == pytest.approx([0.4 * ways[1], 0.4 * ways[2]], rel=1e-9)             # 0.8 / 8^(1/3)
