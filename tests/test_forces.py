"""Forces as targets: on rising and falling branches, at the end of a run and on the way."""

import numpy as np
import pytest
from scipy.optimize import brentq

import formingx as fx


def pushed(radius=15.0, friction="none", loads=()):
    """A clamped sheet under a ball."""
    return fx.Scene(mesh=fx.mesh.disc(radius=40.0, thickness=1.2, elements=(30, 1)), materials=fx.NeoHookean(c10=0.4),
                    supports=[fx.Symmetry("axis"), fx.Clamped("rim")], loads=loads,
                    contacts=[fx.Contact("top", fx.tools.sphere(radius=radius, z=1.2), friction, direction=(0, -1))])


def pulled():
    """Scene of a disc that is pulled at its rim, with a uniform stretch."""
    return fx.Scene(mesh=fx.mesh.disc(radius=10.0, thickness=1.0, elements=(8, 1)), materials=fx.NeoHookean(c10=0.5),
                    supports=[fx.Symmetry("axis"), fx.PrescribedDisplacement("rim", "r"),
                              fx.Symmetry("bottom", normal="z", guide=True)])


def travel(path):
    return path.last.measures["travel"]


@pytest.mark.parametrize("radius, force", [(15.0, 5.0), (24.0, 0.7)])
def test_target_force_of_a_ball(radius, force):
    scene = pushed(radius)
    path = fx.trace(scene, until=fx.force(force), intermediate=[fx.force(force / 3)], progress=False)
    assert path["tool_force"][-1] == pytest.approx(force, rel=1e-7) and travel(path) > 0 and len(path) < 15
    assert path.target_state(fx.force(force / 3)).measures["tool_force"] == pytest.approx(force / 3, rel=1e-7)
    other = fx.trace(scene, until=fx.travel(travel(path)), progress=False)
    assert other["tool_force"][-1] == pytest.approx(force, rel=1e-6)


@pytest.mark.parametrize("friction", ["none", 0.3])
def test_run_back_to_a_smaller_force(friction):
    scene = pushed(friction=friction)
    path = fx.trace(scene, until=fx.force(30.0), progress=False)
    for force in (25.0, 4.0):
        back = fx.trace(scene, until=fx.force(force), start=path, progress=False)
        assert back["tool_force"][-1] == pytest.approx(force, rel=1e-7)
        assert np.all(np.diff(back["travel"][len(path) - 1:]) < 0)
        if friction == "none":                              # nothing is lost: as on the way up
            assert travel(back) == pytest.approx(travel(fx.trace(scene, until=fx.force(force), progress=False)),
                                                 rel=1e-6)
    again = fx.trace(scene, until=fx.travel(0.8 * travel(path)), start=path, progress=False)
    assert travel(again) == pytest.approx(0.8 * travel(path), rel=1e-12)


@pytest.mark.parametrize("force", [-50.0, -7.0, 12.0])
def test_a_disc_pulled_at_its_rim(force):
    """The force is 2 pi R h 2 c10 (l - l^-5), towards the axis if the disc is stretched."""
    path = fx.trace(pulled(), until=fx.force(force), progress=False)
    stretch = brentq(lambda s: 2 * np.pi * 10.0 * (s - s**-5) + force, 0.5, 3.0)
    assert path["pole_stretch"][-1] == pytest.approx(stretch, rel=1e-6)


def test_a_ball_without_friction_never_pulls():
    with pytest.raises(fx.InputError, match="can only push"):
        fx.trace(pushed(), until=fx.force(-1.0))


@pytest.mark.thorough
def test_a_rough_ball_pulls_only_where_it_is_withdrawn_or_another_load_acts():
    """A run that continues another, and a run with a pressure, try it."""
    with pytest.raises(fx.InputError, match="which pushes it back"):
        fx.trace(pushed(friction=0.1), until=fx.force(-1.0))
    with pytest.raises(fx.ConvergenceError, match="beyond any process"):
        fx.trace(pushed(friction=0.1, loads=[fx.Pressure("bottom", 0.0)]), until=fx.force(-1.0), progress=False)
    path = fx.trace(scene := pushed(friction=0.1), until=fx.force(5.0), progress=False)
    with pytest.raises(fx.ConvergenceError):
        fx.trace(scene, until=fx.force(-1.0), start=path, progress=False)


def test_a_positive_force_that_compresses_is_noted():
    """The force of the body on a support is positive where the support presses; the run says so, and what pulls."""
    def run(force):
        mesh = fx.mesh.disc(radius=1.0, thickness=1.0, elements=(1, 1))
        scene = fx.Scene(mesh=mesh, materials=fx.NeoHookean(c10=0.5), supports=[
            fx.Symmetry("axis"), fx.Symmetry("bottom", "z"), fx.PrescribedDisplacement("top", name="pull")])
        return fx.trace(scene, until=fx.force(force), progress=False)
    pressed, pulled = run(0.7), run(-0.7)
    assert pressed["travel"][-1] < 0 < pulled["travel"][-1]
    note, = (found for found in pressed.findings() if found.about == "pull")
    assert note.severity == "note" and "presses" in note.text and "force(-0.7)" in note.advice
    assert not [found for found in pulled.findings() if found.about == "pull"]
