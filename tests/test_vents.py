"""A sheet that relaxes and sticks to a mould, to which air is let in the last stage."""

import logging

import pytest

import formingx as fx

VENT = fx.Stage("vent", control="vacuum", until=fx.pressure(0.0))
WITHOUT_MOULD = fx.Stage("vent", inactive=["mould", "vacuum"])
RELAXES = fx.Viscoelastic(fx.NeoHookean(c10=0.05), branches=[(0.7, 1.0)])


def formed(vent, material=RELAXES, **contact):
    """Return the scene of a sheet in a cup 20 deep, and its stages, the last of which is `vent`."""
    cup = fx.tools.pot(mouth=38.0, base=28.0, depth=20.0, sheet=1.2, fillet=8.0, lip=3.0, nose=20.0).mould
    scene = fx.Scene(mesh=fx.mesh.disc(radius=40.0, thickness=1.2, elements=(16, 1)), materials=material,
                     supports=[fx.Symmetry("axis"), fx.Clamped("rim")], loads=[fx.Pressure("bottom", name="vacuum")],
                     contacts=[fx.Contact("top", cup, "stick", name="mould", **contact)])
    return scene, [fx.Stage("form", control="vacuum", until=fx.pressure(1.5)), fx.Stage("hold", duration=5.0), vent]


@pytest.mark.thorough
def test_a_vented_sheet_recovers_as_without_its_mould(caplog):
    """It separates point by point, in 73 states instead of 9, from which the check before the run warns."""
    ends, counts = [], []
    for vent, words in ((VENT, True), (WITHOUT_MOULD, False)):
        caplog.clear()
        scene, stages = formed(vent)
        with caplog.at_level(logging.WARNING):
            path = fx.Process(scene).run(stages, progress=False)
        assert ("takes the pressure away from a sheet that relaxes and sticks to 'mould'" in caplog.text) == words
        ends.append(path.last.measures["pole_height"])
        counts.append(sum(state.stage == "vent" for state in path.states))
    assert ends[0] == pytest.approx(ends[1], rel=1e-8)
    assert counts[0] > 4 * counts[1]


@pytest.mark.parametrize("vent, given, found", [
    (VENT, {}, True), (fx.Stage("vent", inactive=["vacuum"]), {}, True),
    (fx.Stage("vent", amplitudes={"vacuum": [(0.0, 1.5), (1.0, 0.0)]}), {}, True),
    (fx.Stage("less", control="vacuum", until=fx.pressure(0.5)), {}, False),
    (VENT, {"separates": False}, False), (VENT, {"material": fx.NeoHookean(c10=0.4)}, False)])
def test_vents_of_relaxing_sheets_are_found(vent, given, found):
    scene, stages = formed(vent, **given)
    assert ("its points separate one by one" in str(fx.check(scene, stages=stages))) == found
