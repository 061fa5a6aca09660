"""Sheets that sag: `fx.sag`, weight, and creep."""

import json

import numpy as np
import pytest
from conftest import drawn, run
from scipy.optimize import brentq

import formingx as fx

POISSON = 0.5


def hencky() -> float:
    """Deflection of a flat round membrane without pretension, whose edge is held, over a (q a/(E h))^(1/3).

    Hencky, Z. Math. Phys. 63 (1915) 311; the series as corrected by Chien (1948) and Alekseev (1953).
    """
    def b(b0):
        return np.array([b0, -1 / b0**2, -2 / (3 * b0**5), -13 / (18 * b0**8), -17 / (18 * b0**11),
                         -37 / (27 * b0**14), -1205 / (567 * b0**17)])
    b0 = brentq(lambda x: np.sum((1 + 2 * np.arange(7) - POISSON) * b(x)), 1.5, 3)
    return float(np.sum([1 / b0, 1 / (2 * b0**4), 5 / (9 * b0**7), 55 / (72 * b0**10), 7 / (6 * b0**13),
                         205 / (108 * b0**16), 17051 / (5292 * b0**19)]))


def sheet(material, *, elements=(20, 1), model=None, thickness=1e-3, **load):
    return fx.Scene(mesh=fx.mesh.disc(radius=1.0, thickness=thickness, elements=elements), materials=material,
                    supports=[fx.Symmetry("axis"), fx.SimplySupported("rim")], model=model,
                    loads=[fx.Gravity(1.0, **load)])


@pytest.mark.parametrize("small, close", [(1e-6, 5e-4), (1e-4, 3e-3)])
def test_sag_of_a_membrane_agrees_with_hencky(small, close):
    """w = 0.595 a (rho g a/E)^(1/3), whatever the thickness, where the strain is small; E = 6 c10."""
    path = fx.trace(sheet(fx.NeoHookean(c10=1 / 6), model=fx.Membrane()), progress=False,
                    until=fx.sag(hencky() * small ** (1 / 3)))
    assert path["load"][-1] == pytest.approx(small, rel=close)
    assert path["sag"][-1] == pytest.approx(-path["pole_height"][-1], rel=1e-12)


def test_a_thin_solid_sags_as_a_membrane_does():
    """Its bending stiffness goes as thickness^2; here it is 0.1 %."""
    loads = [fx.trace(sheet(fx.NeoHookean(c10=1 / 6), model=model, thickness=1e-3), until=fx.sag(0.05),
                      progress=False)["load"][-1] for model in (None, fx.Membrane())]
    assert loads[0] == pytest.approx(loads[1], rel=5e-3)


CREEPS = fx.TransientNetwork(fx.NeoHookean(c10=1e-6), [(1.0, 2.0)])


def creeping(until=None, duration=60.0, **more):
    stage = fx.Stage("sag", until=until, duration=duration, **more)
    scene = sheet(CREEPS, elements=(8, 1), model=fx.Membrane(), value=1e-4)
    return fx.Process(scene).run([stage, fx.Stage("wait", duration=0.5)], progress=False)


def test_a_stage_waits_for_a_sag():
    """It ends there, exactly; the same time as of a run that passes it; the next stage goes on from it."""
    path = creeping(fx.sag(0.05))
    met = path.target_state(fx.sag(0.05))
    assert met is path.state("sag") and met.measures["sag"] == pytest.approx(0.05, rel=1e-12)
    assert path.last.time == pytest.approx(met.time + 0.5) and path["sag"][-1] > 0.05
    passed = creeping(duration=1.2 * met.time, intermediate=[fx.sag(0.05)])
    assert passed.target_state(fx.sag(0.05)).time == pytest.approx(met.time, rel=2e-3)


def test_an_unreachable_sag_is_reported():
    with pytest.raises(fx.ConvergenceError, match="sag = 0.5 was not reached within its duration of 1: it is 0.0"):
        creeping(fx.sag(0.5), duration=1.0)
    with pytest.raises(fx.InputError, match="or duration=..., the longest time"):
        fx.Stage("sag", until=fx.sag(1.0))
    with pytest.raises(fx.InputError, match="sag"):
        fx.sag(-1.0)


@pytest.mark.thorough
def test_oven_quick(tmp_path):
    """Sag grows to its limit; the skins are hotter than the middle."""
    run("demos/oven.py", "--out", tmp_path, "--quick")
    found = json.loads((tmp_path / "summary.json").read_text())
    sags = list(found["sag_mm"]["2"].values())
    assert 0.5 < sags[0] < sags[1] < sags[2] < 30
    assert found["time_to_limit_s"]["2"] == pytest.approx(37.3, rel=0.02)
    assert found["temperature_C"]["2"]["top"] > found["temperature_C"]["2"]["middle"] > 150
    assert all(0.5 < wall["least"] <= wall["pole"] < 0.9 for wall in found["wall"]["2"].values())
    assert drawn(tmp_path / "oven.png")
