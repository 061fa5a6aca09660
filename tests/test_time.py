"""Time in runs: order, energy, restart, units, tangents, steps of any length, many branches, layers, promises."""

import numpy as np
import pytest
from conftest import run_json

import formingx as fx
from formingx import Stage
from formingx.solve.stepping import ACCURACY

RUBBER = fx.NeoHookean(c10=0.05)
P0 = fx.Viscoelastic(RUBBER, branches=[(0.5, 1.0)])
P1 = fx.Viscoelastic(RUBBER, branches=[(0.3, 0.5), (0.4, 5.0)])
AREA = np.pi
EXACT = 0.99                                                 # no step is refused for its error in time


def block(material=P0, **scene):
    """A cylinder of radius and height 1, pulled at its top."""
    return fx.Scene(mesh=fx.mesh.disc(radius=1.0, thickness=1.0, elements=(1, 1)), materials=material,
                    supports=[fx.Symmetry("axis"), fx.Symmetry("bottom", "z"),
                              fx.PrescribedDisplacement("top", name="pull")],
                    **scene)


def tube(elements=(2, 1)):
    mesh = fx.mesh.disc(radius=2.0, inner_radius=1.0, thickness=0.5, elements=elements)
    return fx.Scene(mesh=mesh, materials=P1, supports=[fx.Symmetry("bottom", "z"), fx.Symmetry("top", "z")],
                    loads=[fx.Pressure("inner", name="air")])


def sheet(model=None, unit=1.0, material=None, n=6):
    """A hinged sheet of radius 1; the unit of time is so many seconds."""
    branches = [(mu, tau / unit) for mu, tau in P1.branches]
    return fx.Scene(mesh=fx.mesh.disc(radius=1.0, thickness=0.02, elements=(n, 1)), model=model or fx.Membrane(),
                    materials=material or fx.Viscoelastic(RUBBER, branches=branches),
                    supports=[fx.Symmetry("axis"), fx.SimplySupported("rim")],
                    loads=[fx.Pressure("bottom", name="air")])


def widened(value):
    return fx.displacement(value, at=(1.0, 0.0), component="r")


def run(scene, *stages, accuracy: str | float = 1e-2, **options):
    return fx.Process(scene).run(stages, accuracy=accuracy, progress=False, max_steps=3000, **options)


def even(n):
    """n equal steps in time of a flow."""
    return fx.StepControl(length=1 / n, largest=1 / n)


def pull(path, stretch=2.0, state=None):
    """Nominal stress."""
    return -(state or path.last).measures["support_force"] / AREA


def blow(T=1.0, volume=1.0, held=0.0, **options):
    knots = [(0, 0), (T, volume)] + ([(T + held, volume)] if held else [])
    return Stage("blow", control="air", amplitudes={fx.enclosed_volume: knots}, **options)


def test_second_order_in_time():
    """A ramp of the inner radius of a tube, and a hold: pressures at the end, at equal steps, each half as long."""
    ends = []
    for n in (8, 16, 32):
        flow = Stage("flow", control="air", amplitudes={widened: [(0, 0), (1, 1), (2, 1)]}, step=even(2 * n))
        ends.append(run(tube(), flow, accuracy=EXACT).last.measures["pressure"])
    coarse, fine = np.diff(ends)
    assert np.log2(coarse / fine) == pytest.approx(2, abs=0.2)


def test_work_is_stored_or_dissipated():
    path = run(sheet(), blow(T=0.5, volume=1.0, held=1.0), accuracy=2e-3)
    pressure, volume = path["pressure"], path["enclosed_volume"]
    work = np.sum((pressure[1:] + pressure[:-1]) / 2 * np.diff(volume))
    stored, lost = path["strain_energy"][-1], path["dissipated_energy"]
    assert stored + lost[-1] == pytest.approx(work, rel=2e-3) and lost[-1] > 0.1 * work
    assert np.all(path["dissipated_power"] >= 0) and np.all(np.diff(lost) >= 0)


RANKS = """
import sys, json
sys.path.insert(0, "tests")
from test_time import *
path = run(sheet(), blow(T=0.5, held=0.5))
if path.problem.comm.rank == 0:
    print(json.dumps([len(path), *path["pressure"], *path["pole_stretch"], *path["dissipated_energy"]]))
"""


@pytest.mark.thorough
def test_ranks_agree():
    one, two = (run_json(RANKS, ranks) for ranks in (1, 2))
    assert two == pytest.approx(one, rel=1e-8, abs=1e-12)


@pytest.mark.parametrize("stages", [
    [Stage("pull", control="pull", until=fx.travel(1.0)), Stage("hold", duration=3.0)],
    [Stage("load", control="pull", until=fx.force(-0.5)),
     Stage("creep", control="pull", constant=fx.force(-0.5), duration=3.0)],
], ids=["hold", "creep"])
def test_restart_in_the_middle(stages, tmp_path):
    scene = block(P1)
    whole = run(scene, *stages, checkpoint=tmp_path)
    half = len(whole) // 2
    assert 0 < whole.states[half].time < 3.0
    again = run(scene, *stages, start=fx.load(tmp_path, scene, state=half))
    assert len(again) == len(whole)
    for column in ("process_time", "travel", "support_force", "dissipated_energy"):
        assert again[column] == pytest.approx(whole[column], rel=1e-9, abs=1e-14)


def test_a_load_that_falls_takes_the_time_of_its_speed():
    path = run(sheet(), fx.Stage("rise", control="air", until=fx.pressure(0.01), speed=0.005),
               fx.Stage("fall", control="air", until=fx.pressure(0.002), speed=0.004))
    ends = [next(s.time for s in reversed(path.states) if s.stage == stage) for stage in ("rise", "fall")]
    assert ends == pytest.approx([2.0, 4.0], rel=1e-9) and np.diff(path["process_time"]).min() > -1e-12


def test_equation_of_a_force_has_its_derivatives():
    """Of the force on a support that moves at a speed, by the unknowns and by the control, with which time passes."""
    path = run(block(P1), fx.Stage("load", control="pull", until=fx.travel(0.4), speed=0.1))
    old, new = path.states[-3:-1]
    with path.problem.state_context(old) as problem:
        equation, e, rng = fx.force(-0.5).bind(problem).equation(-0.5), 1e-5, np.random.default_rng(0)
        x, way, gradient, moved = (problem.x.duplicate() for _ in range(4))
        x.setArray(new.x[:problem.n_owned])
        way.setArray(rng.standard_normal(x.getLocalSize()))
        slope = equation(x, new.control, gradient)[1]
        along = gradient.dot(way)

        def value(h, control):
            moved.waxpy(h, way, x)
            return equation(moved, control, problem.x.duplicate())[0]
        assert along == pytest.approx((value(e, new.control) - value(-e, new.control)) / (2 * e), rel=1e-6)
        assert slope == pytest.approx((value(0.0, new.control + e) - value(0.0, new.control - e)) / (2 * e), rel=1e-6)
    assert abs(slope) > 0.1 and abs(along) > 0.1


def test_the_state_of_a_stage_and_a_time():
    body = fx.Scene(mesh=fx.mesh.disc(radius=1.0, thickness=0.1, elements=(4, 1)), materials=P0,
                     supports=[fx.Symmetry("axis"), fx.Clamped("rim")], loads=[fx.Pressure("bottom", name="air")])
    path = fx.Process(body).run([fx.Stage("blow", control="air", until=fx.pole_height(0.2), speed=1.0),
                                  fx.Stage("wait", duration=2.0)], progress=False, accuracy=1e-2)
    stages = list(dict.fromkeys(state.stage for state in path.states))
    for stage in stages:
        mine = [state for state in path.states if state.stage == stage]
        assert path.state(stage) is mine[-1] and path.state(stage, mine[0].time) is mine[0]
        if mine[-1].time > mine[0].time:
            time = mine[0].time + 0.37 * (mine[-1].time - mine[0].time)
            found = path.state(stage, time)
            assert found.time == pytest.approx(time, rel=1e-9) and found.stage == stage
        with pytest.raises(fx.InputError, match=f"time = 1e.09: stage '{stage}' goes from"):
            path.state(stage, 1e9)
    assert path.state() is path.last
    with pytest.raises(fx.InputError, match="stage 'held' is not known; known: "):
        path.state("held")


def test_unit_of_time():
    """In hours as in seconds."""
    paths = [run(sheet(unit=unit), blow(T=0.5 / unit, held=1.0 / unit)) for unit in (1.0, 3600.0)]
    for column, scale in (("pressure", 1), ("pole_stretch", 1), ("process_time", 3600), ("dissipated_energy", 1)):
        first, second = (path[column] for path in paths)
        assert second * scale == pytest.approx(first, rel=1e-8, abs=1e-13)


@pytest.mark.parametrize("model", [fx.Membrane(), fx.MixedPressure()], ids=["membrane", "solid"])
def test_tangent_and_control_derivative_in_time(model):
    """At a state that has relaxed, under a setting in which the time and the pressure both follow the control."""
    scene = sheet(model, n=3)
    path = run(scene, blow(T=0.5, volume=0.6), accuracy=5e-2)
    problem, last = path.problem, path.last
    with problem.state_context(last):
        setting = problem.setting
        rate = [1.0 if item in scene.loads else 0.0 for item in scene.items] + [2.0]
        base = [*setting.amplitudes(last.control)[:-1], last.time + 0.1]
        base = [b - r * last.control for b, r in zip(base, rate)]
        problem.enter(type(setting)(base, rate, []), last.x, last.control)
        x, d, out = (problem.x.duplicate() for _ in range(3))
        d.setArray(np.random.default_rng(3).standard_normal(d.getLocalSize()) * 0.01)
        d.array_w[problem.constrained] = 0

        def residual(step, ahead):
            x.array_w[:] = last.x + step * d.array_r
            problem.residual(x, last.control + ahead, out)
            return out.array_r.copy()

        x.array_w[:] = last.x
        exact = np.array(problem.tangent(x, last.control) * d)
        by_control = problem.x.duplicate()
        problem.control_derivative(x, last.control, by_control)
        for found, (step, ahead) in ((exact, (1, 0)), (by_control.array_r.copy(), (0, 1))):
            errors = []
            for h in (1e-2, 1e-3):
                difference = (residual(h * step, h * ahead) - residual(-h * step, -h * ahead)) / (2 * h)
                errors.append(np.abs(difference - found).max() / np.abs(found).max())
            assert errors[1] < 1e-4 and errors[1] < 0.02 * errors[0] + 1e-8, errors


@pytest.mark.parametrize("ratio", [1e-9, 1e-3, 1.0, 1e3, 1e9])
def test_steps_of_any_length(ratio):
    """One step of 1e-9 tau is elastic, one of 1e9 tau leaves the equilibrium."""
    stages = [Stage("pull", control="pull", until=fx.travel(1.0)),
              Stage("hold", control="pull", amplitudes={fx.travel: [(0, 1.0), (ratio, 1.0)]}, step=even(1))]
    path = run(block(), *stages, accuracy=EXACT)
    now, rest = P0.stress("uniaxial", 2.0), RUBBER.stress("uniaxial", 2.0)
    if ratio <= 1e-3:
        assert pull(path) == pytest.approx(P0.relaxation("uniaxial", 2.0, ratio), rel=1e-5)
    elif ratio >= 1e3:
        assert pull(path) == pytest.approx(rest, rel=5 / ratio)
    assert rest * (1 - 1e-8) < pull(path) < now


@pytest.mark.slow
def test_many_branches():
    tau = np.geomspace(1e-3, 1e3, 20)
    material = fx.Viscoelastic(RUBBER, branches=[(0.03 * (1 + k % 3), float(t)) for k, t in enumerate(tau)])
    path = run(block(material), Stage("pull", control="pull", until=fx.travel(0.5)),
               Stage("hold", duration=10.0, intermediate=[fx.process_time(0.1)]))
    for t, state in ((0.1, path.target_state(fx.process_time(0.1))), (10.0, path.last)):
        assert pull(path, state=state) == pytest.approx(material.relaxation("uniaxial", 1.5, t), rel=1e-2)


@pytest.mark.thorough
def test_layers_of_different_branches():
    """Pulled at the rim all layers have one stretch, and add their forces; one of them does not relax."""
    layers = {"a": (P0, 0.5), "b": (P1, 0.3), "c": (fx.NeoHookean(c10=0.2), 0.2)}
    mesh = fx.mesh.disc(radius=1.0, thickness={k: h for k, (_, h) in layers.items()}, elements=(1, 1))
    scene = fx.Scene(mesh=mesh, materials={k: m for k, (m, _) in layers.items()},
                     supports=[fx.Symmetry("axis"), fx.Symmetry("bottom", "z", guide=True),
                               fx.PrescribedDisplacement("rim", "r", name="pull")])
    path = run(scene, Stage("pull", control="pull", until=fx.travel(0.5)), Stage("hold", duration=2.0), accuracy="fine")
    sought = sum(h * (m.relaxation("equibiaxial", 1.5, 2.0) if m.internal else m.stress("equibiaxial", 1.5))
                 for m, h in layers.values())
    assert -path.last.measures["support_force"] / (2 * np.pi) == pytest.approx(sought, rel=ACCURACY["fine"])


@pytest.mark.parametrize("accuracy", ["draft", "standard", "fine"])
def test_accuracy_is_kept(accuracy):
    """Of stress in a hold at two stretches, of the thickness in creep against a run ten times as accurate."""
    times = [0.1, 0.5, 1.0, 2.0, 5.0]
    through = [fx.process_time(t) for t in times[:-1]]
    for stretch in (1.5, 4.0):
        path = run(block(), Stage("pull", control="pull", until=fx.travel(stretch - 1)),
                   Stage("hold", duration=5.0, intermediate=through), accuracy=accuracy)
        found = [pull(path, state=path.target_state(t)) for t in through] + [pull(path)]
        assert found == pytest.approx(P0.relaxation("uniaxial", stretch, times), rel=ACCURACY[accuracy])


def test_accuracy_of_thickness_and_of_the_snap():
    """Under a held pressure; a sheet creeps until it snaps."""
    def snap(accuracy):
        path = run(sheet(), Stage("put on", control="air", until=fx.pressure(0.01)),
                   Stage("creep", duration=1000.0, intermediate=[fx.pole_stretch(1.3)], at_limit_point="stop"),
                   accuracy=accuracy)
        assert path.limit_points and "limit point" in path.ended
        met = path.target_state(fx.pole_stretch(1.3))
        return np.array([path.last.time, path.last.measures["pole_stretch"], met.time])
    fine = snap(3e-5)
    assert snap("fine") == pytest.approx(fine, rel=1e-3)


def test_constant_rate_as_a_function_of_time():
    rate, end = 0.7, np.log(3.0) / 0.7
    path = run(block(P1), Stage("pull", control="pull", amplitudes={fx.travel: lambda t: np.expm1(rate * t)},
                                until=fx.process_time(end), intermediate=[fx.process_time(end / 2)]), accuracy="fine")
    for t, state in ((end / 2, path.target_state(fx.process_time(end / 2))), (end, path.last)):
        assert pull(path, state=state) == pytest.approx(P1.constant_rate("uniaxial", rate, [np.exp(rate * t)])[0],
                                                        rel=ACCURACY["fine"])


def test_recovery_after_creep():
    """A force that is held when time has gone by already; taken off, it leaves the stretch that the creep has left."""
    force = fx.force(-0.2 * AREA)
    path = run(block(P1), Stage("load", control="pull", until=force),
               Stage("creep", control="pull", constant=force, duration=5.0),
               Stage("unload", control="pull", until=fx.force(0.0)),
               Stage("recovery", control="pull", constant=fx.force(0.0), duration=5.0), accuracy=2e-3)
    begin = next(s for s in path.states if s.stage == "recovery")
    assert begin.time == 5.0 and np.all(np.diff(path["process_time"]) >= 0)
    assert np.abs(path["support_force"][path.states.index(begin):]).max() < 1e-8
    stretch = [1 + s.measures["travel"] for s in (path.target_state(force), begin, path.last)]
    assert stretch == pytest.approx([1.0906606, 1.1651652, 1.0951243], rel=2e-3)          # an ODE solver's


def test_a_stage_in_time_ends_at_its_target():
    path = run(block(), Stage("pull", control="pull", amplitudes={fx.travel: [(0, 0), (1, 1), (3, 1)]},
                              until=fx.process_time(2)))
    assert path.last.time == 2.0 and path.last.measures["travel"] == pytest.approx(1.0, abs=1e-12)


@pytest.mark.quick
@pytest.mark.parametrize("make, words", [
    (lambda: Stage("a", control="air", until=fx.pressure(1), speed=0), "speed = 0: must be greater than 0"),
    (lambda: Stage("a", duration=0), "duration = 0: must be greater than 0"),
    (lambda: Stage("a", speed=1.0), "of what"),
    (lambda: Stage("a", control="air", until=fx.pole_height(1), duration=2.0), "give a speed"),
    (lambda: Stage("a", control="air", constant=fx.pressure(1)), "duration"),
    (lambda: Stage("a", control="air", amplitudes={fx.enclosed_volume: [(0, 0)]}), "two points"),
    (lambda: Stage("a", control="air", amplitudes={fx.enclosed_volume: lambda t: t}), "until when"),
    (lambda: Stage("a", control="air", amplitudes={lambda v: v: [(0, 0), (1, 1)]}), "made by its measure"),
    (lambda: run(block(), Stage("a", duration=1.0), accuracy="exact"), "accuracy = 'exact': must be one of"),
    (lambda: run(block(), Stage("a", duration=1.0), accuracy=0), "between 0 and 1"),
    (lambda: run(block(), Stage("a", duration=1.0),
                 Stage("b", control="pull", until=fx.process_time(1), amplitudes={fx.travel: [(0, 0), (2, 1)]})),
     "time cannot go back"),
    (lambda: run(block(), Stage("a", control="pull", amplitudes={fx.travel: [(1, 0), (2, 1)]})), "nothing is given"),
])
def test_bad_input(make, words):
    with pytest.raises(fx.InputError, match=words):
        make()


def test_limit_points_of_pressure_in_a_flow():
    """A sheet blown by a volume in time: the pressure's maximum is a state, and the corner of the hold is none.

    Of an elastic one it is the limit point of a run that is driven by the pressure.
    """
    for scene in (sheet(), sheet(material=RUBBER)):
        path = run(scene, blow(T=1.0, volume=4.0, held=0.5), accuracy=2e-3)
        assert len(path.limit_points) == 1
        top = path.limit_points[0].measures["pressure"]
        assert top == path["pressure"].max()
        if scene.materials["sheet"].internal:
            finer = run(scene, blow(T=1.0, volume=4.0), accuracy=2e-4)
            assert top == pytest.approx(finer["pressure"].max(), rel=2e-3)
        else:
            alone = fx.trace(scene, until=fx.enclosed_volume(4.0), progress=False)
            assert top == pytest.approx(alone.limit_points[0].measures["pressure"], rel=1e-6)
            soon = run(scene, blow(T=1e-8, volume=4.0, held=5e-9), accuracy=2e-3)      # in another unit of time
            assert soon["pressure"] == pytest.approx(path["pressure"], rel=1e-9)
