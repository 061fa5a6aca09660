"""A thin sheet that sticks to a ball, separates and sticks again: wall, cost, and a warning of its step dependence."""

import importlib
import logging
from dataclasses import replace

import numpy as np
import pytest

import formingx as fx
from formingx.results.evaluate import resticking

event_sequence = importlib.import_module("formingx.extensions.contact_events.event_sequence")
snap_through = importlib.import_module("formingx.solve.snap_through")


def pushed(travel=8.0, step=None, **options):
    """A disc of 31 x 0.21 under a ball of radius 11."""
    ball = fx.Contact("top", fx.tools.sphere(radius=11.0, z=0.21), "stick", direction=(0, -1), **options)
    scene = fx.Scene(mesh=fx.mesh.disc(radius=31.0, thickness=0.21, elements=(30, 1)), materials=fx.NeoHookean(c10=0.4),
                     supports=[fx.Symmetry("axis"), fx.Clamped("rim")], contacts=[ball])
    return fx.trace(scene, until=fx.travel(travel), step=step, progress=False)


@pytest.fixture(scope="module")
def fine():
    return pushed(nodes_per_step=1, step=fx.StepControl(length=0.001, largest=0.001))


@pytest.mark.parametrize("target, close", [(4, 1e-3), (8, 3e-3)])
def test_walls_do_not_depend_on_the_steps(fine, target, close, caplog):
    """Default and longer steps keep what the page on moulds promises, without jumps and in few iterations.

    Before, jumps changed the wall by 1.2 %, and one of them took 5000 iterations.
    """
    path = pushed(step=fx.StepControl(target=target))
    assert path.profile().thickness == pytest.approx(fine.profile().thickness, rel=close)
    assert not path.jumps and path.counts.iterations < 400
    found = [finding for finding in path.findings() if "stuck again elsewhere, most near R = 2.0667" in finding.text]
    assert [finding.severity for finding in found] == ["note"] and "stuck again" not in caplog.text


def over_lip(**options):
    """A plane-strain sheet of 25 x 0.8 on the lip of a mould; at small pressures it separates from the lip."""
    trough = fx.tools.Tool([(0.0, 15.8), (14.0, 15.8), (20.0, 0.8), (70.0, 0.8)], [0.0, 3.0, 2.0, 0.0])
    scene = fx.Scene(mesh=fx.mesh.disc(radius=25.0, thickness=0.8, accuracy="standard"), kinematics=fx.PlaneStrain(),
                     materials=fx.NeoHookean(c10=0.3), supports=[fx.Symmetry("axis"), fx.Clamped("rim")],
                     loads=[fx.Pressure("bottom")], contacts=[fx.Contact("top", trough, "stick", **options)])
    return fx.trace(scene, until=fx.pressure(0.1), progress=False)


@pytest.mark.thorough
def test_a_step_ends_before_the_closures_after_a_separation(caplog):
    """A point at the lip separates between two closures of a step; before, the wall there was wrong by 3 %.

    The finding on points that stick again counts none of those that only rest on the lip before the first step.
    """
    path, one_by_one = over_lip(), over_lip(nodes_per_step=1)
    assert path.profile().thickness == pytest.approx(one_by_one.profile().thickness, rel=2e-3)
    assert path.counts.steps < 0.6 * one_by_one.counts.steps
    assert "2 points that stuck to 'top' lifted off" in caplog.text


def test_shift_of_points_that_stick_again(fine):
    """None where points stick once; else a bound of the change of the wall by other steps."""
    item = resticking.furthest(fine)
    assert 5e-3 < item.shift < 1e-2 and item.tool == "top" and resticking.findings(item)
    assert resticking.findings(item._replace(shift=2e-3)) == []
    assert "may depend on the steps (that point moved by 20 %" in resticking.findings(item._replace(shift=0.2))[0].text
    once = pushed(travel=1.0)
    assert resticking.furthest(once) is None and once.last.measures["contact_length"] > 0


def test_a_point_that_lifts_off_gives_up_its_shear_first():
    """T <= 1000 N: next to the foot of the ramp a point that separates is not held along the tool."""
    tool, theta, slip = fx.tools.plane(0.0), 1e-5, 1e-3
    forces = []
    for separates in (True, False):
        contact = fx.Contact("top", tool, "stick", separates=separates, ramp=theta, penalty=1.0)
        law = contact.law(1.0, 1.0, np.array([[1.0, -1.0]]))
        old = law.start(np.array([[1.0, 0.0]]))
        x = np.array([[1.0 + slip, -theta * (1 - 1e-4)]])
        found = law.tractions(x, old)
        assert found.normal[0] > 0
        forces.append(abs(found.tangential[0]) / found.normal[0])
    assert forces[0] == pytest.approx(1000.0) and forces[1] > 1e4


def test_few_iterations_for_the_events_of_a_step(monkeypatch, caplog):
    """With its work used up a step takes one gap closure, and the log says so."""
    monkeypatch.setattr(event_sequence, "_SETTINGS", replace(event_sequence._SETTINGS, max_work=2))
    with caplog.at_level(logging.INFO, "formingx"):
        path = pushed(travel=3.0)
    assert "contact events of this step took too many iterations: it takes one gap closure" in caplog.text
    assert path.last.measures["travel"] == pytest.approx(3.0)


def test_a_jump_ends_after_the_iterations_of_its_step(caplog):
    """The iterations of a step bound its jumps, and the log says so."""
    path = pushed(travel=1.0)
    settings, curve = snap_through.SnapThrough(max_iterations=20), path.record.curve
    curve.iterations += 21
    with caplog.at_level(logging.INFO, "formingx"), pytest.raises(snap_through.Failure, match="more than 20 Newton"):
        snap_through.snap_through(curve, path.last, 1e-4, False, settings)
    assert "no jump within 21 Newton iterations of this step: shorter steps are tried" in caplog.text
    assert curve.spent() == 21


def blown_off(friction, material=None, travel=12.0, pressure=0.03, step=None, **mesh):
    """A sheet of 40 x 1.2 on a round plug, from which air peels it."""
    tools = fx.tools.pot(mouth=38.0, base=28.0, depth=40.0, sheet=1.2, fillet=8.0, lip=3.0, nose=20.0)
    scene = fx.Scene(mesh=fx.mesh.disc(radius=40.0, thickness=1.2, **mesh or {"elements": (20, 1)}),
                     materials=material or fx.NeoHookean(c10=0.4),
                     supports=[fx.Symmetry("axis"), fx.Clamped("rim")], loads=[fx.Pressure("bottom", name="air")],
                     contacts=[fx.Contact("top", tools.mould, "stick", separates=False),
                               fx.Contact("bottom", tools.plug, friction, direction=(0, 1), name="plug")])
    return fx.Process(scene).run([fx.Stage("plug", control="plug", until=fx.travel(travel)),
                                  fx.Stage("air", control="air", until=fx.pressure(pressure))],
                                 progress=False, step=step)


@pytest.mark.thorough
def test_a_sheet_peeled_off_a_sticking_plug_is_reported():
    """Friction of 1 gives the same sheet in a third of the states: real plugs do not hold what hardly presses on them.
    """
    stuck, slides = blown_off("stick"), blown_off(1.0)
    found = [finding for finding in stuck.findings() if "is peeled off 'plug'" in finding.text]
    assert len(found) == 1 and found[0].severity == "warning"
    assert not [finding for finding in slides.findings() if "peeled" in finding.text]
    assert slides.profile().thickness == pytest.approx(stuck.profile().thickness, rel=5e-3)
    assert slides.counts.steps < 0.5 * stuck.counts.steps


def in_cup(nodes_per_step=None):
    """A thin sheet of 48.541 x 0.36568 in a deep cup."""
    mould = fx.tools.cup(radius=45.0, depth=33.023, mouth=0.36568, draft=4.0832, fillet=4.0684, lip=3.9343)
    scene = fx.Scene(mesh=fx.mesh.disc(radius=48.541, thickness=0.36568), materials=fx.NeoHookean(c10=0.4),
                     supports=[fx.Symmetry("axis"), fx.Clamped("rim")], loads=[fx.Pressure("bottom")],
                     contacts=[fx.Contact("top", mould, nodes_per_step=nodes_per_step)])
    return fx.trace(scene, until=fx.pressure(0.14156), progress=False)


@pytest.mark.thorough
def test_the_arc_length_of_a_predicted_closure_converges():
    """Where only the positions of points converge, the wall at the pole is wrong by 0.45 %."""
    assert in_cup().profile().thickness == pytest.approx(in_cup(1).profile().thickness, rel=2e-3)


def test_a_failed_run_names_the_sticking_plug_as_cause():
    """Steps become short where the sheet comes off the plug point by point; with friction of 1 it arrives."""
    with pytest.raises(fx.ConvergenceError, match="the sheet is peeled off 'plug'") as failed:
        blown_off("stick", step=fx.StepControl(smallest=3e-3))
    assert "friction=1 in place of 'stick'" in failed.value.diagnosis.advice
    assert blown_off(1.0, step=fx.StepControl(smallest=3e-3)).counts.steps < 50


def in_bowl(nodes_per_step=None):
    """A sheet of 48.6 x 0.56 in a bowl, in plane strain: it bends over a lip, and separates from it."""
    h = 0.561
    bowl = fx.tools.Tool([(0.0, 18.06 + h), (15.75, 18.06 + h), (36.0, 8.127 + h), (45.0, h), (135.0, h)],
                         [0.0, 11.25, 9.0, 4.005, 0.0])
    scene = fx.Scene(mesh=fx.mesh.disc(radius=48.605, thickness=h),
                     materials=fx.Ogden(mu=[0.5, 0.05], alpha=[1.6, 4.0]), kinematics=fx.PlaneStrain(),
                     supports=[fx.Symmetry("axis"), fx.Clamped("rim")], loads=[fx.Pressure("bottom")],
                     contacts=[fx.Contact("top", bowl, nodes_per_step=nodes_per_step)])
    return fx.trace(scene, until=fx.pressure(0.1754), progress=False)


@pytest.mark.thorough
def test_predicted_closures_beside_a_clamp_are_in_equilibrium():
    """A point on a lip hardly moves along it: its position agrees long before the body is in equilibrium.

    Before, it stuck at a wrong place, a point near it did not separate, and the wall there was wrong by 1.3 %.
    """
    path, one_by_one = in_bowl(), in_bowl(1)
    assert path.profile().thickness == pytest.approx(one_by_one.profile().thickness, rel=1e-3)
    assert path.counts.steps < 0.5 * one_by_one.counts.steps


def test_a_point_that_cannot_separate_is_bonded_before_it_is_pulled():
    """Under a plug that holds the sheet, a step ends at the closure of a point that is in tension at its end.

    Before, that point stayed open between its neighbours, and the largest stress was wrong by 7 %.
    """
    def held(nodes_per_step=None):
        tool = fx.tools.male(radius=1.905, height=60.0, base=-60.0, fillet=0.35).mirrored().moved(z=0.6985)
        plug = fx.Contact("top", tool, "stick", separates=False, direction=(0, -1), nodes_per_step=nodes_per_step)
        mesh = fx.mesh.disc(radius=8.89, thickness=0.6985, elements=(60, 3), concentrate={1.1 * 1.905: 0.2})
        scene = fx.Scene(mesh=mesh, materials=fx.NeoHookean(c10=0.448), contacts=[plug],
                         supports=[fx.Symmetry("axis"), fx.Clamped("rim")])
        path = fx.trace(scene, until=fx.travel(6.0), intermediate=[fx.travel(4.8)], step=fx.StepControl(target=6),
                        progress=False)
        return path["tool_force"][-1], path.last.measures["contact_length"], len(path)
    (force, length, states), (one_by_one, touching, more) = held(), held(1)
    assert force == pytest.approx(one_by_one, rel=1e-4) and length == pytest.approx(touching, rel=1e-9)
    assert states < 0.7 * more
