"""States that no body can have end a run, with a message and the path up to the last admissible state."""

import re

import pytest

import formingx as fx
from formingx import tools
from formingx.results.evaluate.admissibility import AdmissibilityCheck


def block(height=1.0, friction="none", elements=(6, 6), **contact):
    """Half of a block between frictionless plates in plane strain."""
    return fx.Scene(mesh=fx.mesh.disc(radius=1.0, thickness=height, elements=elements), kinematics=fx.PlaneStrain(),
                    materials=fx.NeoHookean(c10=0.5),
                    supports=[fx.Symmetry("axis"), fx.Symmetry("bottom", normal="z")],
                    contacts=[fx.Contact("top", tools.plane(height), friction, direction=(0, -1), **contact)])


def foot():
    """A block glued to its base, pressed flat: its foot flows out and folds."""
    return fx.Scene(mesh=fx.mesh.disc(radius=1.0, thickness=1.0, elements=(6, 6)), materials=fx.NeoHookean(c10=1.0),
                    supports=[fx.Symmetry("axis"), fx.Clamped("bottom"), fx.PrescribedDisplacement("top")])


def funnel():
    """A sheet blown through a ring, with nothing above."""
    ring = tools.Tool([(28.0, 31.2), (28.0, 1.2), (80.0, 1.2)], [0.0, 3.0, 0.0])
    return fx.Scene(mesh=fx.mesh.disc(radius=40.0, thickness=1.2, elements=(24, 1)), materials=fx.NeoHookean(c10=0.4),
                    supports=[fx.Symmetry("axis"), fx.Clamped("rim")], loads=[fx.Pressure("bottom")],
                    contacts=[fx.Contact("top", ring, "stick")])


def inside_out(path, state):
    """Part of the elements with a point where J <= 0."""
    with path.problem.state_context(state) as problem:
        bad, cells, _ = problem.admissible.inverted_elements()
    return bad / cells


def test_a_run_ends_before_its_first_inadmissible_state(caplog):
    with pytest.raises(fx.ConvergenceError,
                       match="elements are inside out, the worst at .* allow_inadmissible=True") as error:
        fx.trace(foot(), until=fx.travel(-0.85), progress=False)
    good = error.value.path
    assert len(good) > 2 and max(inside_out(good, state) for state in good.states) <= 0.06
    assert "The last good state is" in str(error.value)
    path = fx.trace(foot(), until=fx.travel(-0.85), progress=False, allow_inadmissible=True)
    reasons = [state.inadmissible_reason for state in path.states]
    assert next(k for k, reason in enumerate(reasons) if reason) == len(good)
    assert "beyond travel" in caplog.text


def test_a_sheet_that_folds_ends_the_run():
    with pytest.raises(fx.ConvergenceError, match="the body folds: its boundary goes through itself near"):
        fx.trace(funnel(), until=fx.pressure(0.09), progress=False)


def test_open_and_report_name_the_inadmissible_state(tmp_path):
    from formingx.results.files import checkpoint_data
    from formingx.results.show import report_data
    fx.trace(foot(), until=fx.travel(-0.85), progress=False, allow_inadmissible=True, checkpoint=tmp_path / "run")
    for found in (report_data.of_checkpoint(*checkpoint_data.contents(tmp_path / "run")),
                  report_data.of_path(fx.load(tmp_path / "run", foot()))):
        assert any("the results must not be used:" in text and "inside out" in text for text in found.warnings())


@pytest.mark.parametrize("height, gap", [(1.0, 0.05), (2.0, 0.07)])
def test_a_penetrated_state_does_not_meet_its_target(height, gap):
    with pytest.raises(fx.ConvergenceError, match="did not follow the tool .* give Contact a penalty of") as error:
        fx.trace(block(height), until=fx.travel(height - gap), progress=False)
    penalty = float(re.search("a penalty of ([^;]+);", str(error.value))[1])
    left = gap / height
    path = fx.trace(block(height, penalty=10 * penalty), until=fx.travel(height - gap), progress=False)
    assert path["tool_force"][-1] == pytest.approx(2 * (left**-3 - left), rel=0.1)


@pytest.mark.parametrize("gap, penalty", [(0.5, 2e5), (0.35, 2e5), (0.26, 2e5), (0.2, 2e5), (0.14, 2e5), (0.8, 1e3)])
def test_a_run_reports_the_force_error_of_penetration(gap, penalty, caplog):
    path = fx.trace(block(penalty=penalty), until=fx.travel(1 - gap), progress=False)
    off = abs(path["tool_force"][-1] / (2 * (gap**-3 - gap)) - 1)
    said = re.search(r"changes the force on the tool of 'top' by about (\S+) %", caplog.text)
    assert (said is not None) == (off > 2e-3)
    assert said is None or float(said[1]) == pytest.approx(100 * off, rel=0.2)


@pytest.mark.parametrize("gap, penalty", [(0.1, 2e5), (0.6, 100)])
def test_a_force_with_more_than_5_percent_penetration_error_is_refused(gap, penalty):
    with pytest.raises(fx.ConvergenceError, match="penetration changes the force by about .* %: give") as error:
        fx.trace(block(penalty=penalty), until=fx.travel(1 - gap), progress=False)
    harder = float(re.search("a penalty of ([^;]+);", str(error.value))[1])
    path = fx.trace(block(penalty=harder), until=fx.travel(1 - gap), progress=False)
    assert path["tool_force"][-1] == pytest.approx(2 * (gap**-3 - gap), rel=5e-3)


def test_a_pole_with_negative_thickness_is_inadmissible():
    """A ball on elements that are far too long for it."""
    scene = fx.Scene(mesh=fx.mesh.disc(radius=40.0, thickness=1.2, elements=(20, 1)), materials=fx.NeoHookean(c10=0.4),
                     supports=[fx.Symmetry("axis"), fx.Clamped("rim")],
                     contacts=[fx.Contact("top", tools.sphere(radius=1.1, z=1.2), 0.3, direction=(0, -1))])
    try:
        path = fx.trace(scene, until=fx.travel(40.0), progress=False)
    except fx.ConvergenceError as error:
        path = error.path
    assert path["pole_stretch"].max() < 100


def test_an_admissible_state_has_no_warning():
    path = fx.trace(block(), until=fx.travel(0.3), progress=False)
    check = AdmissibilityCheck(path.problem)
    assert [next(check.reasons(state), "") for state in path.states] == [""] * len(path)


def test_contact_points_sink_by_less_than_a_seventh_of_the_wall():
    """A sheet blown against a plate of too low a penalty: the last good state is below the limit, the next above."""
    sheet = fx.Scene(mesh=fx.mesh.disc(radius=10.0, thickness=1.0, elements=(10, 1)), materials=fx.NeoHookean(c10=0.5),
                     loads=[fx.Pressure("bottom")], supports=[fx.Symmetry("axis"), fx.Clamped("rim")],
                     contacts=[fx.Contact("top", tools.plane(3.0), "stick", penalty=20.0)])
    with pytest.raises(fx.ConvergenceError, match="did not follow the tool of 'top'") as error:
        fx.trace(sheet, until=fx.pressure(10.0), progress=False)
    share = float(re.search(r"deep in it, (\S+) % of the remaining wall", str(error.value))[1]) / 100
    path = error.value.path
    assert path["penetration"][-1] / path.profile().thickness.min() < 0.15 < share < 0.25
