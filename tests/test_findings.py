"""Findings of checks before and after a run: scenes that differ from the intended ones, results to be doubted."""

import re
import shutil

import pytest
from conftest import treloar

import formingx as fx
from formingx.checks.check import before_run
from formingx.checks.mould_side import moulds
from formingx.findings import SEVERITIES, Finding, percent, register, worst_first
from formingx.results.evaluate import volume
from formingx.results.files import checkpoint_data, status

ABOVE = fx.tools.plane(5.0)


def sheet(*, load="bottom", c10=0.4, contacts=None, loads=(), **scene):
    contacts = [fx.Contact("top", ABOVE, "none", name="mould")] if contacts is None else contacts
    return fx.Scene(mesh=fx.mesh.disc(radius=10.0, thickness=0.5, elements=(12, 1)), materials=fx.NeoHookean(c10=c10),
                    supports=[fx.Symmetry("axis"), fx.SimplySupported("rim")], loads=[fx.Pressure(load), *loads],
                    contacts=contacts, **scene)


def ball(friction="none"):
    return fx.Contact("top", fx.tools.sphere(radius=4.0).moved(z=4.5), friction, direction=(0, -1), name="plug")


def warnings_about(path, about):
    return [found.text for found in path.findings() if found.about == about and found.severity == "warning"]


def test_findings_are_sorted_by_severity():
    """Serious ones come first; those of one severity keep their order; a moment that is not known is refused."""
    found = [Finding(*one, "") for one in (("note", "a"), ("serious", "b"), ("warning", "c"), ("note", "d"))]
    assert [f.about for f in worst_first(found)] == ["b", "c", "a", "d"]
    assert SEVERITIES == ("serious", "warning", "note")
    with pytest.raises(fx.InputError, match="moment 'never' is not known"):
        register("never")


def test_checks_of_extensions_are_registered():
    from formingx import findings
    rooms = {check.__module__.split(".")[2] for checks in findings._registered.values() for check in checks
             if ".extensions." in check.__module__}
    assert rooms >= {"heat", "kbkz", "space"}


@pytest.mark.parametrize("make, words", [
    (lambda: sheet(c10=4e5), r"materials\['sheet'\]: its shear modulus is 8e\+05"),
    (lambda: sheet(contacts=[ball(30.0)]), "its coefficient of friction is 30"),
    (lambda: sheet(contacts=[ball(fx.table({20.0: 0.3, 100.0: 6.0}))], temperature=50.0), "of friction is 6"),
    (lambda: sheet(loads=[fx.Gravity(1050.0, 9810.0)]), "tears the body apart"),
    (lambda: sheet(loads=[fx.Gravity(1e-13, 9.81)]), "moves nothing"),
    (lambda: sheet(loads=[fx.CentrifugalLoad(1050.0, 100.0)]), "tears the body apart"),
])
def test_implausible_moduli_and_pressures_are_reported(make, words):
    """Said before every run; not of scenes in mm and MPa, m and Pa, in and psi."""
    found, = before_run(make())
    assert found.severity == "warning" and re.search(words, str(found)), str(found)


@pytest.mark.parametrize("length, stress", [(1.0, 1.0), (1e-3, 1e6), (1 / 25.4, 145.0)])
def test_plausible_quantities_in_other_units_pass(length, stress):
    scene = fx.Scene(mesh=fx.mesh.disc(radius=10.0 * length, thickness=0.5 * length, elements=(12, 1)),
                     materials=fx.NeoHookean(c10=0.4 * stress), loads=[fx.Pressure("bottom")],
                     supports=[fx.Symmetry("axis"), fx.SimplySupported("rim")])
    assert before_run(scene) == []
    assert before_run(sheet(contacts=[ball(1000.0)])) == []                      # sticks
    assert before_run(sheet(loads=[fx.Gravity(1.05e-9, 9810.0)])) == []


@pytest.mark.parametrize("load, pressure, away", [
    ("bottom", 0.01, False), ("bottom", -0.01, True), ("top", 0.01, True), ("top", -0.01, False)])
def test_a_pressure_that_points_away_from_its_mould(load, pressure, away, caplog):
    """Before the run, of the pressure; after it, of a body that has moved away (here it ends before its mould)."""
    mould = fx.Contact("top", ABOVE, "none", name="mould")
    plug = fx.Contact("bottom", fx.tools.sphere(radius=4.0).moved(z=-9.0), "none", direction=(0, 1), name="plug")
    scene = sheet(load=load, contacts=[mould, plug])
    stages = [fx.Stage("blow", control=scene.loads[0], until=fx.pressure(pressure), inactive=[plug])]
    path = fx.Process(scene).run(stages, progress=False)
    found = warnings_about(path, f"pressure = {pressure:g}")
    assert ["away from the mould" in text for text in found] == [True] * away
    moved, = warnings_about(path, "mould")
    assert ("moved away from this mould" in moved) == away and ("never touched" in moved) == (not away)
    for found in path.findings():
        assert (caplog.text.count(found.text) == 1) == (found.severity != "note")


def test_status_of_a_stage_with_a_named_pressure(tmp_path):
    """The column of the target is that of the load that is driven; a stage without a step has just begun."""
    air = fx.Pressure("bottom", name="air")
    plug = fx.Contact("top", fx.tools.sphere(radius=4.0, z=0.5), "none", direction=(0, -1), name="plug")
    scene = fx.Scene(mesh=fx.mesh.disc(radius=10.0, thickness=0.5, elements=(12, 1)), loads=[air], contacts=[plug],
                     materials=fx.NeoHookean(c10=0.4), supports=[fx.Symmetry("axis"), fx.SimplySupported("rim")])
    stages = [fx.Stage("push", control=plug, until=fx.travel(0.5)),
              fx.Stage("blow", control=air, until=fx.pressure(0.01))]
    path = fx.Process(scene).run(stages, progress=False, checkpoint=tmp_path / "run")
    (tmp_path / "run" / "end.json").unlink()                                       # as while it goes on
    said = {}
    for k in reversed(range(len(path))):
        said[k] = str(status.of_folder(tmp_path / "run"))
        if k:
            shutil.rmtree(tmp_path / "run" / f"{k:04d}")
    blown = [k for k, state in enumerate(path.states) if state.stage == "blow"]
    assert "air pressure 0.01 of 0.01" in said[len(path) - 1] and "the target is met" in said[len(path) - 1]
    assert "the stage has just begun" in "".join(said[k] for k in blown[:3])
    assert not any("no nearer" in text for text in said.values()) and "to the end of the stage" in said[blown[-2]]


def test_status_while_the_pressure_falls(tmp_path):
    """Past the maximum of the pressure, towards a larger one, which a sheet of this material never comes to."""
    with pytest.raises(fx.ConvergenceError):
        fx.trace(sheet(contacts=[]), until=fx.pressure(0.2), max_steps=14, progress=False, checkpoint=tmp_path / "run")
    (tmp_path / "run" / "end.json").unlink()
    found = status.of_folder(tmp_path / "run")
    states = checkpoint_data.contents(tmp_path / "run")[1]
    falling = states[-1]["measures"]["pressure"] < max(state["measures"]["pressure"] for state in states)
    assert falling and found.moved[0] in ("enclosed_volume", "pole_height", "strain_energy")
    assert found.remaining_time is None and "the body moves, " in str(found)


def test_volumes_that_a_clamped_corner_costs_are_no_warning(caplog):
    """Treloar's clamped sheet loses volumes at its corner alone, as the mean away from it shows."""
    path = fx.trace(treloar(support=fx.Clamped("rim")), until=fx.pole_stretch(2.0), progress=False)
    (note,) = path.findings()
    assert note.severity == "note" and note.about == "volume" and "corner of a clamped face" in note.text
    assert caplog.text == "" and path["volume_error"][-1] > 0.02
    rim = path.problem.scene.mesh.nodes_of("rim")
    everywhere = path.problem.volume_error_away(path.last, rim, 0.0)
    assert everywhere == pytest.approx(path["volume_error"][-1], rel=1e-9)
    assert path.problem.volume_error_away(path.last, rim, 0.164) < 0.005
    for away in (None, 0.03):
        other, = volume.findings(0.03, "the last state", away)
        assert other.severity == "warning" and "use a finer mesh" in other.text


def test_a_ring_is_not_taken_for_a_mould():
    """A sheet that is blown through a ring leaves it as it should."""
    ring = fx.Contact("top", fx.tools.Tool([(8.0, 3.0), (8.0, 0.5), (12.0, 0.5)], [0.0, 0.0, 0.0]), "none")
    assert moulds(sheet(contacts=[ring])) == [] and len(moulds(sheet())) == 1


def test_tool_without_contact():
    """A plug that is driven the wrong way; one that arrives is not spoken of, nor is a mould that is reached."""
    scene = sheet(contacts=[ball()])
    away = fx.Process(scene).run([fx.Stage("plug", control="plug", until=fx.travel(-3.0))], progress=False)
    assert "met nothing on its travel of -3: the gap was" in warnings_about(away, "plug")[0]
    assert "its first travel is -3" in warnings_about(away, repr(scene.contacts[0]))[0]
    lies = fx.Contact("top", fx.tools.cylinder(radius=4.0, z=0.5, fillet=1.0), 0.3, direction=(0, 1), name="plug")
    stages = [fx.Stage("plug", control="plug", until=fx.travel(2.0))]
    away = fx.Process(sheet(contacts=[lies])).run(stages, progress=False)
    assert "the gap was 0 at first and 2 at the end" in warnings_about(away, "plug")[0]
    stages.append(fx.Stage("back", control="plug", until=fx.travel(0.0)))
    away = fx.Process(sheet(contacts=[lies])).run(stages, progress=False)
    assert "met nothing on its travel of 2: " in warnings_about(away, "plug")[0]
    stages = [fx.Stage("plug", control="plug", until=fx.travel(1.0))]
    near = fx.Contact("top", fx.tools.sphere(radius=4.0, z=0.5), "none", direction=(0, -1), name="plug")
    assert warnings_about(fx.Process(sheet(contacts=[near])).run(stages, progress=False), "plug") == []
    reached = fx.trace(sheet(contacts=[fx.Contact("top", fx.tools.plane(2.0), "none", name="mould")]),
                       until=fx.enclosed_volume(500.0), progress=False)
    assert reached["contact_length"][-1] > 0 and warnings_about(reached, "mould") == []


def test_findings_of_a_scene_belong_to_its_path():
    path = fx.trace(sheet(c10=4e5), until=fx.pole_height(0.1), progress=False)
    assert path.findings()[0].about == "materials['sheet']" and "mould" in [f.about for f in path.findings()]
    assert [f.about for f in path.findings()] == ["materials['sheet']", "mould"]


def test_stages_whose_tools_overlap_are_refused_by_check():
    """The process refuses them, too."""
    scene = sheet(contacts=[ball(), fx.Contact("bottom", fx.tools.plane(-3.0).reversed(), "none")])
    for travel, found in ((2.0, 0), (8.0, 1)):
        stages = [fx.Stage("plug", control="plug", until=fx.travel(travel))]
        serious = [f for f in fx.check(scene, stages=stages).findings if f.severity == "serious"]
        assert len(serious) == found and all("Stage 'plug': tools overlap" in f.text for f in serious)
    with pytest.raises(fx.InputError, match="tools overlap"):
        fx.Process(scene).run(stages, progress=False)
    scene = fx.Scene(mesh=scene.mesh, materials=fx.NeoHookean(c10=0.4), contacts=scene.contacts,
                     supports=[fx.Symmetry("axis"), fx.SimplySupported("rim")])
    assert "travel = 8: tools overlap" in str(fx.check(scene, targets=[fx.travel(8.0)]))
    with pytest.raises(fx.InputError, match="travel = 8: tools overlap"):
        fx.trace(scene, until=fx.travel(8.0), progress=False)


def test_shares_are_written_without_powers_of_ten():
    assert [percent(x) for x in (0.0123, 0.5, 1.234, 0.1)] == ["1.2 %", "50 %", "120 %", "10 %"]
