"""Derivatives of runs by the numbers of their script, and searches that use them."""

import numpy as np
import pytest

import formingx as fx

CAN = {"supports": [fx.Symmetry("axis"), fx.SimplySupported("rim")], "loads": [fx.Pressure("bottom")]}


def disc(c=0.0, h=0.05, height=0.6):
    """An inflated sheet: a constant that varies, a thickness, and the height of its pole."""
    mesh = fx.mesh.disc(radius=1.0, thickness=h, elements=(8, 1))
    return fx.Scene(mesh=mesh, materials=fx.NeoHookean(c10=lambda R, Z: 0.5 * (1 + c * R**2)), **CAN), \
        fx.pole_height(height)


def programmed(h):
    """The same with a wall along the radius."""
    mesh = fx.mesh.disc(radius=1.0, thickness=lambda R: np.exp(h(R)) / 50, elements=(10, 1))
    return fx.Scene(mesh=mesh, materials=fx.NeoHookean(c10=0.5), **CAN), fx.pole_stretch(1.2)


def pole_wall(path):
    return path.profile().thickness[0]


def highest_pressure(path):
    return path["pressure"].max()


def test_derivatives_are_those_of_whole_runs():
    """Of the material, of the shape and of the target, of the pressure and of the wall."""
    design = fx.Design(disc, {"c": (0.0, -1, 1), "h": (0.05, 0.01, 0.1), "height": (0.6, 0.1, 1.0)})
    run, at = design.run(), {"c": 0.0, "h": 0.05, "height": 0.6}
    for measure, of in (("pressure", lambda run: run.path["pressure"][-1:]), ("wall", lambda run: run.wall)):
        by = run.derivative(measure)[1]
        for k, (name, dp) in enumerate({"c": 1e-3, "h": 1e-5, "height": 1e-4}.items()):
            above, below = (of(design.run({name: at[name] + s * dp})) for s in (1, -1))
            assert by[:, k] == pytest.approx((above - below) / (2 * dp), rel=2e-5, abs=1e-7)
    assert run.derivative(pole_wall)[1][0] == pytest.approx(run.derivative("wall")[1][0], rel=1e-12)
    volume, by = run.derivative("volume")
    assert volume == pytest.approx(np.pi * 0.05, rel=1e-9) and by[0] == pytest.approx([0, np.pi, 0], abs=1e-8)


def test_taylor():
    """What the derivative leaves out is of second order, over three decades."""
    design = fx.Design(disc, {"c": (0.0, -1, 1)})
    run = design.run()
    wall, by = run.derivative("wall")
    steps = np.array([1e-1, 1e-2, 1e-3])
    left = [np.linalg.norm(design.run({"c": t}).wall - wall - t * by[:, 0]) for t in steps]
    assert np.diff(np.log(left)) / np.diff(np.log(steps)) == pytest.approx(2.0, abs=0.05)


def test_an_even_wall():
    """Its thickness at the pole is the wall over that stretch squared."""
    answer = fx.Design(programmed, {"h": fx.along(6, start=0.0, low=-2, high=2, smooth=True)}).fit(even=True, good=1e-3)
    assert answer.paths <= 4 and answer.cv[0] > 0.03 and answer.cv[1] < 1e-3
    assert np.exp(answer.values["h"](0.0)) / 50 == pytest.approx(1.2**2 * answer.best.wall.mean(), rel=2e-3)
    assert answer.best.volume == pytest.approx(answer.before.volume, rel=1e-5)
    assert "unevenness" in str(answer) and abs(answer.foretold / answer.best.wall - 1).max() < 0.02


def test_bad_input_is_told_in_words():
    def finer(n):
        return fx.Scene(mesh=fx.mesh.disc(radius=1.0, thickness=0.05, elements=(int(round(8 + 1e6 * n)), 1)),
                        materials=fx.NeoHookean(c10=0.5), **CAN), fx.pole_height(0.3)
    with pytest.raises(fx.InputError, match="changes the elements of the mesh"):
        fx.Design(finer, {"n": 0.0}).run().derivative("wall")
    design = fx.Design(disc, {"c": 0.0})
    with pytest.raises(fx.InputError, match="nothing to fit"):
        design.fit()
    with pytest.raises(fx.InputError, match="no parameter has an effect"):
        fx.Design(lambda b: disc(), {"b": 1.0}).fit(wall=0.04, volume=None)
    with pytest.raises(fx.InputError, match="parameter 'd' is not known"):
        design.run({"d": 1})
    with pytest.raises(fx.InputError, match="must return \\(scene, target\\)"):
        fx.Design(lambda c: disc()[0], {"c": 0.0}).run()
    with pytest.raises(fx.InputError, match="looks at earlier states"):
        fx.Design(disc, {"height": 1.4}).run().derivative(highest_pressure)
    for wrong, words in (((1, 2, 3), "must be from 2 to 3"), ((1, 2), "must be a number"),
                         ((1, 3, 0), "below the second")):
        with pytest.raises(fx.InputError, match=words):
            fx.Design(disc, {"c": wrong})
