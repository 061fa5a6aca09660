"""A tool does not pass through the body: steps become shorter, or a message says so."""

import numpy as np
import pytest

import formingx as fx
from formingx import tools
from formingx.contact.step_limit import TrialStep


def ball(radius, *, elements=12, friction="none", gap=0.0, **more):
    return fx.Scene(mesh=fx.mesh.disc(radius=40.0, thickness=1.2, elements=(elements, 1)),
                    materials=fx.NeoHookean(c10=0.4), supports=[fx.Symmetry("axis"), fx.Clamped("rim")],
                    contacts=[fx.Contact("top", tools.sphere(radius=radius, z=1.2 + gap), friction, direction=(0, -1),
                                         **more)])


@pytest.mark.parametrize("radius, friction, more", [(1.0, "none", {}), (1.0, 0.2, {}), (2.0, "stick", {}),
                                                    (1.5, "none", {"points": 4})])
def test_a_ball_does_not_pass_in_the_first_step(radius, friction, more):
    """As with steps that are short from the start."""
    scene = ball(radius, friction=friction, **more)
    path = fx.trace(scene, until=fx.travel(8.0), progress=False)
    short = fx.trace(scene, until=fx.travel(8.0), step=fx.StepControl(length=0.005), progress=False)
    assert path["tool_force"][-1] == pytest.approx(short["tool_force"][-1], rel=0.02) and path["pole_height"][-1] < -7


def test_a_ball_far_above_does_not_pass_through_the_sheet():
    """It ends in words or touches, always from above."""
    scene = ball(3.0, elements=16, gap=25.0)
    try:
        path = fx.trace(scene, until=fx.travel(50.0), progress=False)
    except fx.ConvergenceError as error:
        path = error.path
    touches = path["travel"] > 25.0 + 1e-9
    assert touches.any() and np.all(path["tool_force"][touches] > 0)
    assert path["pole_height"][touches] == pytest.approx(25.0 - path["travel"][touches], abs=1.0)      # under the ball


@pytest.mark.parametrize("radius, elements, narrow", [(0.02, 12, True), (0.4, 12, True), (0.2, 40, True),
                                                      (0.4, 40, False), (1.0, 12, False)])
def test_a_tool_between_two_points_is_refused(radius, elements, narrow):
    if not narrow:
        ball(radius, elements=elements)
        return
    with pytest.raises(fx.InputError, match="it would pass between them; use elements of") as refused:
        ball(radius, elements=elements)
    fits = float(str(refused.value).split("use elements of ")[1].split()[0])
    ball(radius, elements=int(np.ceil(40.0 / fits)))


def test_paths_of_sliding_points_may_cut_a_convex_tool():
    scene = ball(2.0, elements=24)
    path = fx.trace(scene, until=fx.travel(0.5), progress=False)
    with path.problem.state_context(path.last) as problem:
        contact, x = problem.contacts[0], path.last.x
        node = np.argmin(np.hypot(*(contact.points - (0.0, 1.2)).T))
        for by, passes in ((0.0, False), (0.1, False), (10.0, True)):      # seen from the tool, across it
            other = x.copy()
            other[contact.rule.dofs[node, 1]] += by / problem.forms.length
            trials = [TrialStep(at, path.last.control, x, 0.0, 1.0) for at in (x, other)]
            assert problem.contact.limit.passes_through(*trials) == passes


def ridge(elements, at, points="nodes", width=30.0, fillet=0.0):
    """A ridge of 90 degrees over a sheet in plane strain, its tip at r = `at`."""
    tool = tools.Tool([(at - width / 2, 1.2 + width / 2), (at, 1.2), (at + width / 2, 1.2 + width / 2)],
                      fillets=fillet).moved(z=0.5)
    return fx.Scene(mesh=fx.mesh.disc(radius=40.0, thickness=1.2, elements=(elements, 1)), kinematics=fx.PlaneStrain(),
                    materials=fx.NeoHookean(c10=0.4), supports=[fx.Symmetry("axis"), fx.Clamped("rim")],
                    contacts=[fx.Contact("top", tool, direction=(0, -1), points=points)])


@pytest.mark.parametrize("points", ["nodes", 4])
def test_a_sharp_open_tool_between_two_points_is_refused(points):
    """Its tip is in the face by half of the way between two points when it meets one; a fillet is by less."""
    with pytest.raises(fx.InputError, match="before it meets one: use elements of") as refused:
        ridge(12, 20.8, points)
    fits = float(str(refused.value).split("use elements of ")[1].split()[0])
    ridge(int(np.ceil(40.0 / fits)), 20.8, points)
    ridge(12, 20.8, points, fillet=6.0)


def test_a_sharp_tool_above_a_node_makes_contact():
    path = fx.trace(ridge(12, 20.0), until=fx.travel(2.0), progress=False)
    assert path["tool_force"][-1] > 0


def test_a_plane_on_the_wrong_side_is_no_question_of_units():
    """A plane has no size; in a drawing it is a line of length 1, far shorter than the sheet."""
    with pytest.raises(fx.InputError, match=r"starts inside the tool.*use tool.reversed\(\)$"):
        fx.Scene(mesh=fx.mesh.disc(radius=40.0, thickness=1.2, elements=(8, 1)), materials=fx.NeoHookean(c10=0.4),
                 supports=[fx.Symmetry("axis"), fx.Clamped("rim")],
                 contacts=[fx.Contact("bottom", tools.plane(-5.0).mirrored())])
