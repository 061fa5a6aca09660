"""A long parison that reaches the base of its mould buckles; in a deeper mould the bottle is blown."""

import pytest

import formingx as fx
from formingx.scene import target_checks


def bottle(room, elements=60):
    """A tube of inner radius 10, 130 long, its end `room` above the base of a mould of radius 30."""
    mesh = fx.mesh.parison(inner_radius=10.0, thickness=2.0, length=130.0, elements=(elements, 1))
    base = -12.0 - room
    mould = fx.tools.bottle(radius=30.0, height=100.0 - base, neck=13.0, shoulder=15.0, neck_height=20.0, base=base,
                            fillet=6.0, shoulder_fillet=6.0)
    return fx.Scene(mesh=mesh, materials=fx.Gent(mu=0.1, Jm=30.0), loads=[fx.Pressure("inner")],
                    supports=[fx.Symmetry("axis"), fx.Clamped("neck")], contacts=[fx.Contact("outer", mould, "stick")])


def test_a_tube_that_stands_on_its_mould_buckles():
    """At the maximum of the volume no state of a larger one follows; the run does not go back over what it passed."""
    ended = "the enclosed volume has a limit point here|the body folds"
    with pytest.raises(fx.ConvergenceError, match=ended) as caught:
        fx.trace(bottle(3.5, 80), until=fx.pressure(0.1), step=fx.StepControl(target=8), progress=False)   # with a jump
    path, found, said = caught.value.path, caught.value.diagnosis, str(caught.value)
    volume = path["enclosed_volume"]
    assert volume[-1] > 0.9999 * volume.max() and volume.argmax() >= len(volume) - 2
    assert path.jumps
    for before, state in zip(path.states, path.states[1:]):
        if state.kind == "jump":
            assert state.measures["enclosed_volume"] >= before.measures["enclosed_volume"]
    stretch, first, last = found.shortened
    assert 0.7 < stretch < 0.85 and 130 > first[1] > last[1] + 20 > 80       # between the bulge and the neck
    assert found.causes[0].startswith("the wall buckles: between (R, Z) = (11, ")
    assert not any("limit point" in cause for cause in found.causes)
    assert said.count("pole height") == 2


@pytest.mark.thorough
@pytest.mark.parametrize("target", [8, 12])
def test_a_step_over_two_limit_points_is_shortened(target):
    """Where the pressure reverses, the branches of the path are .003 of arc length apart, and a step is .05 long.

    The full step ends on the far branch, along which the volume falls; the sign of the determinant shows it.
    """
    with pytest.raises(fx.ConvergenceError) as caught:
        fx.trace(bottle(3.5), until=fx.pressure(0.1), step=fx.StepControl(target=target), progress=False)
    path = caught.value.path
    assert path.counts.limits["a limit point or another path may lie within the step"] == 1
    assert path["enclosed_volume"][-1] > 0.9999 * path["enclosed_volume"].max()     # .9988 on the far branch


def test_a_tube_with_room_below_it_is_blown():
    path = fx.trace(bottle(27.5), until=fx.pressure(0.1), progress=False)
    assert path.last.kind == "target" and path["contact_length"][-1] > 100
    room, _ = target_checks._mould_volume(path.scene, path.scene.contacts[0])
    assert path["enclosed_volume"][-1] == pytest.approx(room, rel=0.01)
    assert target_checks.unreachable(path.scene, fx.enclosed_volume(room)) is None
    with pytest.raises(fx.InputError, match="enclosed volume = .* has room for 3.615e"):
        fx.trace(path.scene, until=fx.enclosed_volume(1.01 * room), progress=False)
