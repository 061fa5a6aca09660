"""A finished state is never lost: round-off between stages, checks that fail, functions of the script that fail."""

import numpy as np
import pytest
from conftest import treloar
from mpi4py import MPI

import formingx as fx
from formingx import findings
from formingx.extensions.design import report as design_report
from formingx.extensions.remeshing.earlier_meshes import _OutlineProjection
from formingx.extensions.space import show
from formingx.mesh.locate import locate
from formingx.problem.problem import Problem
from formingx.results import files
from formingx.results.show import interactive, report, report_data, views


def relaxing_disc(c10, both, duration):
    """A table brings the pressures on both faces to `both`; then one of them grows by 0.04 c10."""
    below, above = fx.Pressure("bottom", name="below"), fx.Pressure("top", name="above")
    scene = fx.Scene(mesh=fx.mesh.disc(radius=10.0, thickness=1.0, elements=(3, 1)), loads=[below, above],
                     materials=fx.Viscoelastic(fx.NeoHookean(c10=c10), [(1.0, 0.7), (0.5, 0.05)]),
                     supports=[fx.Symmetry("axis"), fx.Clamped("rim")])
    together = [(0.0, 0.0), (0.3, both)]
    return fx.Process(scene).run([
        fx.Stage("together", amplitudes={below: together, above: together}),
        fx.Stage("blow", control=below, until=fx.pressure(both + 0.04 * c10), duration=duration)], progress=False)


@pytest.mark.thorough
def test_round_off_between_stages_in_time_dissipates_nothing():
    """Equal pressures on both faces do not deform the disc: the dissipated energy does not depend on them."""
    energies, steps = [], []
    for both in (0.07, 0.1, 0.3):
        path = relaxing_disc(0.065, both, 1.0)
        steps += [b.time - a.time for a, b in zip(path.states, path.states[1:]) if a.setting != b.setting]
        energies.append(path["dissipated_energy"][-1])
    assert 0 < max(map(abs, steps)) < 1e-12, "the case needs round-off between the stages"
    assert energies == pytest.approx(energies[:1] * 3, rel=1e-6) and energies[0] > 0


def test_points_beyond_corners_of_a_mesh_are_moved_onto_it():
    """On a new mesh of a remeshed run, points of the first mesh may lie beyond its outline, also beyond a corner."""
    scene = fx.Scene(mesh=fx.mesh.disc(radius=1.0, thickness=1.0, elements=(3, 2)), materials=fx.NeoHookean(c10=1.0),
                     supports=[fx.Symmetry("axis"), fx.Clamped("bottom")], loads=[fx.Pressure("top")])
    problem = Problem(scene)
    corners = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
    angles = np.linspace(0, 2 * np.pi, 24, endpoint=False) + 0.1
    beyond = corners[:, None] + 0.03 * np.column_stack([np.cos(angles), np.sin(angles)])
    given = beyond.reshape(-1, 2)
    moved = _OutlineProjection(problem)(given)
    locate(problem.forms.domain, moved, 1.0)                # raises an error for a point outside
    onto = np.clip(given, 0, 1)
    outside = np.any(given != onto, axis=1)
    assert moved[outside] == pytest.approx(onto[outside], abs=1e-12)


def test_a_check_of_the_result_that_fails_is_a_finding(monkeypatch, caplog):
    def careless(path):
        raise ZeroDivisionError("float division by zero")
    monkeypatch.setitem(findings._registered, "end", [*findings._registered["end"], careless])
    path = fx.trace(treloar(), until=fx.pole_height(0.2), progress=False)
    found, = (finding for finding in path.findings() if finding.about == "careless")
    assert found.severity == "warning" and "ZeroDivisionError: float division by zero" in found.text
    assert path.last.target is not None and "careless" in caplog.text


def test_an_error_of_the_script_carries_the_path():
    """A column that fails after three states."""
    calls = []

    def column(problem):
        calls.append(1)
        return 1 / (len(calls) < 4)
    with pytest.raises(ZeroDivisionError) as caught:
        fx.trace(treloar(), until=fx.pole_height(0.5), record={"mine": column}, progress=False)
    path = caught.value.path
    assert len(path) == 3 and path["pole_height"][-1] > 0 and "error.path" in caught.value.__notes__[0]


@pytest.fixture(scope="module")
def inflated():
    return fx.trace(treloar(), until=fx.pole_height(0.2), progress=False)


@pytest.mark.parametrize("module, name, told", [
    (interactive, "_sheet", "the drawing of the section"), (interactive, "_walls", "the charts of the wall"),
    (interactive, "_loading", "the curves of forces and pressures"),
    (report, "_convergence", "the picture of convergence"),
    (report, "_part", "the table of key numbers"), (report, "_states", "the table of states"),
    (report_data, "tool_forces", "the curves of tool forces"), (report_data, "_fields_of", "colours of stress")])
def test_a_part_of_a_report_that_fails_is_named_in_it(inflated, tmp_path, monkeypatch, module, name, told):
    def careless(*_):
        raise ZeroDivisionError("float division by zero")
    monkeypatch.setattr(module, name, careless)
    text = inflated.report(tmp_path / "run.html").read_text()
    assert told in text and "could not be made and is left out: ZeroDivisionError: float division by zero" in text
    assert "<h2>Inputs</h2>" in text and "<h2>Made with</h2>" in text


def test_numbers_that_are_not_finite_lose_no_report(inflated, tmp_path, monkeypatch):
    plain = interactive._walls
    monkeypatch.setattr(interactive, "_walls", lambda *given: [
        {**chart, "traces": [{**trace, "x": [float("nan")]} for trace in chart["traces"]]} for chart in plain(*given)])
    text = inflated.report(tmp_path / "run.html").read_text()
    assert "the charts of the wall could not be made" in text and "<h2>Made with</h2>" in text


def test_a_picture_of_a_design_that_fails_is_named_in_its_report(tmp_path):
    def careless():
        raise ZeroDivisionError("float division by zero")
    pictures = {"the picture of the walls": careless, "the picture of the part": lambda: "<p>a part</p>"}
    file = design_report._write(tmp_path / "design.html", "Design", [], [], [], pictures, "", [], MPI.COMM_SELF)
    text = file.read_text()
    assert "the picture of the walls could not be made" in text and "<p>a part</p>" in text


def test_any_error_of_rank_0_reaches_all_ranks():
    """If rank 0 left without sending its error, the other ranks would wait for ever."""
    class Ranks:
        rank, size, sent = 0, 2, []

        def bcast(self, content, root):
            self.sent.append(content)
            return content
    ranks = Ranks()
    with pytest.raises(ZeroDivisionError):
        files.on_root(ranks, lambda: 1 / 0)
    (result, error), = ranks.sent
    assert result is None and isinstance(error, ZeroDivisionError)


def test_the_report_explains_jumps(inflated):
    record = report_data.of_path(inflated)
    assert report.jumps(record) == ""
    record.kinds[-1] = "jump"
    text = report.jumps(record)
    assert "The jump: what happened" in text and "of its range" in text
    assert text.count("<tr>") == 2


@pytest.fixture(scope="module")
def tray():
    sheet = fx.mesh.sheet(fx.mesh.rectangle(3.0, 2.0, part="quarter"), size=0.3)
    scene = fx.Scene(mesh=sheet, thickness=0.02, materials=fx.NeoHookean(c10=1.0), loads=[fx.Pressure("bottom")],
                     supports=[fx.SimplySupported("rim"), fx.Symmetry("x0", "x"), fx.Symmetry("y0", "y")])
    return fx.trace(scene, until=fx.displacement(0.3, at=(0, 0)), progress=False)


def test_the_report_in_space_cuts_through_the_thinnest_place(tray, tmp_path, monkeypatch):
    """Pictures that fail are named; the cut along the longer side meets the thinnest triangle."""
    def careless(*_):
        raise ZeroDivisionError("float division by zero")
    monkeypatch.setattr(show, "view", careless)
    text = tray.report(tmp_path / "tray.html", units=fx.Units("mm", "MPa")).read_text()
    assert text.count("could not be made and is left out: ZeroDivisionError") == 2 and "<h2>Made with</h2>" in text
    shape, along = show._cut(tray.wall(), fx.Units("mm", "MPa"))
    wall = tray.wall()
    (x,), (z,) = shape["traces"][1]["x"], shape["traces"][1]["y"]
    thinnest = wall.middle[np.argmin(wall.wall)]
    assert (x, z) == (thinnest[0], thinnest[2]) and f"y = {thinnest[1]:.4g} mm" in shape["title"]
    assert min(np.hypot(*(np.column_stack([shape["traces"][0]["x"], shape["traces"][0]["y"]]) - (x, z)).T)) < 0.3
    assert np.ptp(shape["traces"][0]["x"]) == pytest.approx(1.5, rel=1e-2) and shape["equal"]
    assert min(along["traces"][0]["y"]) == pytest.approx(wall.wall.min(), rel=0.05)
    drawn = show._mesh(tray, report_data.of_path(tray), fx.Units())
    assert [row[3] for row in drawn["thinnest"]][-1] == pytest.approx(wall.wall.min(), rel=1e-4)
    assert len(drawn["thinnest"]) == len(drawn["points"])


@pytest.mark.parametrize("plane, ends", [("axis", (-1.0, 1.0)), ("rim", (0.0, 2.0))])
def test_a_half_in_plane_strain_is_drawn_with_one_image(plane, ends, tmp_path, monkeypatch):
    other = {"axis": "rim", "rim": "axis"}[plane]
    scene = fx.Scene(mesh=fx.mesh.disc(radius=1.0, thickness=0.1, elements=(6, 1)), kinematics=fx.PlaneStrain(),
                     materials=fx.NeoHookean(c10=1.0), supports=[fx.Symmetry(plane, "r"), fx.Clamped(other)],
                     loads=[fx.Pressure("bottom")])
    path, drawn = fx.solve(scene, to=1e-4, increments=1), []
    monkeypatch.setattr(views, "_draw", lambda profile, *_: drawn.append(profile))
    path.view3d(tmp_path / "half.png")
    assert (drawn[0].bottom[:, 0].min(), drawn[0].bottom[:, 0].max()) == pytest.approx(ends, abs=1e-3)
