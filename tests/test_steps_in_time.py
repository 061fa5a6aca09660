"""Steps in time: tables with corners, going on in the middle, and what `accuracy` promises, by any step control."""

import numpy as np
import pytest
from test_time import block

import formingx as fx
from formingx import Stage, StepControl

QUICK = [(0, 0), (1, 0), (1.0001, 0.6), (2, 0.6), (2.0001, 0.2), (4, 0.2)]
SLOW = fx.Viscoelastic(fx.NeoHookean(c10=0.5), branches=[(5.0, 0.2), (0.1, 10.0)])


def sheet(mu=0.3, n=14, material=None):
    """A sheet on which a ball comes down."""
    material = material or fx.Viscoelastic(fx.NeoHookean(c10=0.05), branches=[(0.3, 0.5), (0.4, 5.0)])
    return fx.Scene(mesh=fx.mesh.disc(radius=40, thickness=1.2, elements=(n, 1)), materials=material,
                    supports=[fx.Symmetry("axis"), fx.SimplySupported("rim")],
                    contacts=[fx.Contact("top", fx.tools.sphere(radius=15, z=1.2), mu, moves=(0, -1), name="ball")])


def run(scene, *stages, **options):
    return fx.Process(scene).run(stages, progress=False, **{"max_steps": 3000, **options})


@pytest.mark.parametrize("ramp", [1e-3, 1e-4, 3e-7])
def test_a_hold_after_a_quick_ramp_does_not_move(ramp):
    """Round-off of a short ramp was taken for what drives the hold: steps of 1e-13, without an end."""
    table = [(0, 0), (1, 0), (1 + ramp, 0.6), (2, 0.6), (2 + ramp, 0.2), (4, 0.2)]
    path = run(block(SLOW), Stage("move", follow={"pull": table}), accuracy="draft", max_steps=200)
    held = [s for s in path.states if 1 + 2 * ramp < s.time < 2 or 2 + 2 * ramp < s.time]
    assert {s.measures["travel"] for s in held} == {0.6, 0.2} and len(path) < 250
    assert all(s.setting["rate"][2] == 0 for s in held)


@pytest.mark.parametrize("corner", [1.0, 1.0001, 2.0, 4.0])
def test_a_target_at_a_corner_of_a_table(corner):
    for stage in (Stage("move", follow={"pull": QUICK}, through=[fx.process_time(corner)]),
                  Stage("flow", drive="pull", follow={fx.travel: QUICK}, through=[fx.process_time(corner)])):
        path = run(block(SLOW), stage, accuracy="draft", max_steps=200)
        met = path.met(fx.process_time(corner))
        assert met.time == pytest.approx(corner, rel=1e-12) and path.last.time == pytest.approx(4.0, rel=1e-12)
        assert met.measures["travel"] == pytest.approx(np.interp(corner, *np.transpose(QUICK)), abs=1e-9)


def test_what_the_step_control_knows_is_part_of_a_state(tmp_path):
    """From any state, under a step control of one's own, the very same path goes on."""
    scene = sheet()
    stages = [Stage("in", drive="ball", until=fx.travel(12), speed=20),
              Stage("out", drive="ball", until=fx.travel(4), speed=20)]
    options = {"accuracy": "draft", "step": StepControl(target=8)}
    whole = run(scene, *stages, checkpoint=tmp_path, **options)
    for k in range(1, len(whole) - 1, 4):
        again = run(scene, *stages, start=fx.load(tmp_path, scene, state=k), **options)
        assert len(again) == len(whole)
        for column in whole.columns:
            np.testing.assert_array_equal(again[column], whole[column])
