"""A sheet that relaxed on a plug is slack when the plug has gone: a stage with a duration draws it into the mould."""

import pytest

import formingx as fx
from formingx.extensions.space.checks import slack_part, slack_sheet
from formingx.mesh.triangles import place
from formingx.solve.diagnose import FailedRun

RELAXING = fx.Viscoelastic(fx.NeoHookean(c10=0.04), [(0.15, 0.5)])
HELD = [fx.SimplySupported("rim"), fx.Symmetry("x0", "x"), fx.Symmetry("y0", "y")]


def tray(duration):
    mould = fx.tools.box(half=(72, 42), depth=30, corner=18, fillet=8, lip=3, draft=8)
    plug = fx.tools.box(half=(50, 24), depth=30, corner=14, fillet=8, draft=5, mouth=30, plug=True)
    scene = fx.Scene(
        mesh=fx.mesh.sheet(fx.mesh.rectangle(160.0, 100.0, corner=20.0, part="quarter"), size=12.0), thickness=1.5,
        materials=RELAXING, model=fx.Membrane(wrinkles=0.01), supports=HELD, loads=[
            fx.Pressure("top", name="vacuum")],
        contacts=[fx.Contact("bottom", mould, 0.3, name="mould"),
                  fx.Contact("top", plug, 0.3, direction=(0, 0, -1), name="plug")])
    return fx.Process(scene).run([
        fx.Stage("plug", control="plug", until=fx.travel(24.0), speed=60.0), fx.Stage("wait", duration=0.3),
        fx.Stage("lift", control="plug", until=fx.travel(0.0), speed=60.0),
        fx.Stage("vacuum", control="vacuum", until=fx.pressure(0.09), duration=duration)], progress=False)


@pytest.mark.thorough
def test_slack_sheet_is_formed_in_a_stage_with_a_duration():
    """With a vacuum in no time the sheet may find no equilibrium: its pressure turns at 3e-7 on this mesh."""
    path = tray(0.5)
    assert path["vacuum_pressure"][-1] == pytest.approx(0.09)
    assert path.filling("mould").touching[-1] > 0.8


@pytest.mark.parametrize("material, duration, control, told", [
    (RELAXING, None, 3e-7, True), (RELAXING, None, 0.03, False), (RELAXING, 1.0, 3e-7, False),
    (fx.NeoHookean(c10=0.1), None, 3e-7, False)])
def test_a_failed_run_of_a_slack_sheet_advises_a_duration(material, duration, control, told):
    scene = fx.Scene(mesh=fx.mesh.sheet(fx.mesh.circle(1.0, part="quarter"), size=0.5), thickness=0.01,
                     materials=material, supports=HELD, loads=[fx.Pressure("top", name="vacuum")])
    path = fx.Process(scene).run([fx.Stage("hold", control="vacuum", until=fx.pressure(1e-4), duration=1.0),
                                  fx.Stage("vacuum", control="vacuum", until=fx.pressure(1e-3), duration=duration)],
                                 progress=False)
    failed = FailedRun({"control": control, "what": "vacuum pressure"}, path.problem, path.last, target=0.09)
    found = list(slack_sheet(failed))
    assert len(found) == told and all("Stage(..., duration=...)" in finding.advice for finding in found)


@pytest.mark.parametrize("wrinkles, z, told", [(0.01, -50.0, True), *(pytest.param(
    *case, marks=pytest.mark.thorough) for case in ((0.01, -20.0, False), (None, -50.0, False)))])
def test_a_failed_run_names_a_slack_part_of_a_tube(wrinkles, z, told):
    """The tail of an open tube below the part under pressure carries no load."""
    mesh = fx.mesh.tube(radius=16.0, length=60.0, elements=(12, 3), part="quarter")
    scene = fx.Scene(mesh=mesh, thickness=2.5, materials=fx.NeoHookean(c10=0.05), model=fx.Membrane(wrinkles=wrinkles),
                     supports=[fx.Clamped("neck"), *HELD[1:]], loads=[fx.Pressure("inner", above=-30.0)])
    path = fx.trace(scene, until=fx.enclosed_volume(100.0), progress=False)
    failed = FailedRun({"worst": place(mesh, (0.0, 16.0, z))}, path.problem, path.last)
    found = list(slack_part(failed))
    assert len(found) == told and all(f"slack at (x, y, z) = (0, 16, {z:g})" in finding.text for finding in found)
