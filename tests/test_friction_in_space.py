"""Sheets in three dimensions that slide with friction: derivatives, a capstan, plugs and cups of solid bodies."""

import numpy as np
import pytest
from conftest import run_json
from test_demos import summary
from test_space import on_ball, trough

import formingx as fx
from formingx.extensions.space.lagged_friction import _basis
from formingx.physics.contact_law import ContactStatus

HELD = [fx.SimplySupported("rim"), fx.Symmetry("x0", "x"), fx.Symmetry("y0", "y")]
MATERIAL, THICKNESS, RADIUS = fx.NeoHookean(c10=1.0), 0.01, 0.5
BALL = fx.tools.sphere(radius=RADIUS, z=0.0)
CUP = fx.Tool([(3.0, 0.0), (1.0, 0.0), (0.9, -0.6), (0.0, -0.6)], [0.0, 0.05, 0.2, 0.0])
TOOLS = {
    "ball": fx.tools.revolved(BALL).moved(x=0.1), "cup": fx.tools.revolved(CUP), "roller": fx.tools.extruded(BALL),
    "roller along x": fx.tools.extruded(BALL, along="x"), "tray": fx.tools.box(
        half=(1.0, 1.5), depth=1.0, corner=0.3, fillet=0.2, lip=0.1),
    "plug": fx.tools.box(half=(0.6, 1.0), depth=1.0, corner=0.3, fillet=0.25, draft=5.0, plug=True)}


def pushed(mu, size=0.1, ball=BALL, **contact):
    """Return the scene of a quarter of a disc of radius 1 and a ball that is pushed into it."""
    sheet = fx.mesh.sheet(fx.mesh.circle(1.0, part="quarter"), size=size)
    return fx.Scene(mesh=sheet, thickness=THICKNESS, materials=MATERIAL, supports=HELD, contacts=[
        fx.Contact("top", fx.tools.revolved(ball), mu, direction=(0, 0, -1), name="plug", **contact)])


def pushed_solid(mu, ball=BALL):
    """Return the scene of `pushed` as an axisymmetric solid."""
    return fx.Scene(mesh=fx.mesh.disc(radius=1.0, thickness=THICKNESS, elements=(60, 1)), materials=MATERIAL,
                    supports=[fx.SimplySupported("rim"), fx.Symmetry("axis")], contacts=[
                        fx.Contact("top", ball.moved(z=THICKNESS), mu, direction=(0, -1), name="plug")])


def strip(mu, size, width):
    """Return the scene of half a strip under a roller."""
    sheet = fx.mesh.sheet([(0, 0), (1, 0), (1, width), (0, width)], size, names=["y0", "rim", "y1", "x0"])
    return fx.Scene(mesh=sheet, thickness=THICKNESS, materials=MATERIAL, supports=[*HELD, fx.Symmetry("y1", "y")],
                    contacts=[fx.Contact("top", fx.tools.extruded(BALL), mu, direction=(0, 0, -1), name="roller")])


def formed_in_cup(mu, size):
    """Return two scenes of a disc that slides in a cup under a pressure: a quarter sheet and an axisymmetric solid."""
    loads, name = [fx.Pressure("top")], {"name": "mould"}
    sheet = fx.mesh.sheet(fx.mesh.circle(1.0, part="quarter"), size=size)
    solid = fx.mesh.disc(radius=1.0, thickness=THICKNESS, elements=(60, 1))
    return [fx.Scene(mesh=sheet, thickness=THICKNESS, materials=MATERIAL, supports=HELD, loads=loads,
                     contacts=[fx.Contact("bottom", fx.tools.revolved(CUP), mu, **name)]),
            fx.Scene(mesh=solid, materials=MATERIAL, supports=[fx.SimplySupported("rim"), fx.Symmetry("axis")],
                     loads=loads, contacts=[fx.Contact("bottom", CUP, mu, **name)])]


@pytest.fixture(scope="module")
def rough_ball():
    """Return the path of a ball of mu = 0.3 that is pushed to a travel of 0.9."""
    return fx.trace(pushed(0.3), until=fx.travel(0.9), progress=False)


@pytest.mark.parametrize("tool", TOOLS.values(), ids=TOOLS)
def test_distances_have_their_derivatives(tool):
    """First and second derivatives of distances agree with differences, also on the axis and planes of symmetry."""
    x = np.random.default_rng(1).uniform(-1.3, 1.3, (4000, 3))
    x = np.vstack([x, [(0.1, 0.0, 0.01), (0.2, 0.0, 0.01), (0.0, 0.0, -0.61), (0.0, 0.5, -0.61)]])
    x = x[np.abs(tool.signed_distance(x)) < 0.05]
    found, e = tool.distances(x), 1e-6
    np.testing.assert_allclose(found.distance, tool.signed_distance(x), atol=1e-14)
    for k, way in enumerate(e * np.eye(3)):
        ahead, behind = tool.distances(x + way), tool.distances(x - way)
        np.testing.assert_allclose((ahead.distance - behind.distance) / (2 * e), found.normal[:, k], atol=1e-8)
        np.testing.assert_allclose((ahead.normal - behind.normal) / (2 * e), found.hessian[:, :, k], atol=1e-7)


def test_tractions_have_their_stiffness():
    """The stiffness of sticking and sliding points agrees with differences; sliding, |T| is mu N of the last state."""
    law = fx.Contact("top", fx.tools.revolved(BALL), 0.3).law(100.0, 1.0, np.zeros((1, 3)))
    rng = np.random.default_rng(0)
    way = rng.normal(size=(6, 3))
    x = 0.499 * way / np.linalg.norm(way, axis=1, keepdims=True) + [0, 0, RADIUS]
    far = np.array([1e-4] * 3 + [1e-2] * 3)[:, None]
    old = law.start(x)._replace(distance=np.full(6, 1e-3), position=x + far * rng.normal(size=(6, 3)),
                                slip=1e-4 * rng.normal(size=(6, 3)))
    old = old._replace(closure=old.position)
    found = law.tractions(x, old)
    assert found.status.tolist() == [ContactStatus.STICKS] * 3 + [ContactStatus.SLIDES] * 3
    np.testing.assert_allclose(found.tangential[3:], 0.3 * 100 * 1e-3, rtol=1e-12)
    assert (found.tangential[:3] < 0.9 * 0.03).all()
    for k, e in enumerate(1e-7 * np.eye(3)):
        quotient = (law.tractions(x + e, old).force - law.tractions(x - e, old).force) / 2e-7
        np.testing.assert_allclose(found.stiffness[:, :, k], quotient, atol=1e-6)
    closure = law.closure_at_pressure(old, np.full(6, 0.12))
    np.testing.assert_allclose(law.friction_pressure(old._replace(closure=closure)), 0.12)


def test_pressure_on_tools_has_its_derivatives():
    """Tangent and derivative by the control agree with differences where points slide on the fillet of a trough."""
    path = fx.trace(trough(size=0.1, friction="none"), until=fx.pressure(0.4), progress=False)
    state, size = path.last, 1e-7
    with path.problem.state_context(state) as problem:
        x, d, F, other = (problem.x.duplicate() for _ in range(4))
        d.array_w[:] = np.random.default_rng(0).normal(size=len(state.x))
        d.array_w[problem.constrained] = 0

        def change(by, control):
            found = []
            for side in (1, -1):
                x.array_w[:] = state.x + side * by * d.array_r
                problem.residual(x, state.control + side * control, F)
                found.append(F.array_r.copy())
            return (found[0] - found[1]) / 2
        along, by_control = change(size, 0.0) / size, change(0.0, 1e-6) / 1e-6
        x.array_w[:] = state.x
        problem.residual(x, state.control, F)
        problem.tangent(x, state.control).mult(d, other)
        np.testing.assert_allclose(other.array_r, along, atol=1e-7 * np.abs(along).max())
        problem.control_derivative(x, state.control, other)
        np.testing.assert_allclose(other.array_r, by_control, atol=1e-5 * np.abs(by_control).max())


@pytest.mark.parametrize("mu", [pytest.param(0.1, marks=pytest.mark.thorough), 0.3])
def test_capstan(mu):
    """The tension T of a sliding strip obeys d ln T / d angle = mu, without the chords at the ends of the arc."""
    path = fx.trace(strip(mu, 0.025, 0.1), until=fx.travel(0.9), progress=False)
    wall = path.wall()
    (x, _, z), stretch = wall.middle.T, 1 / wall.ratio
    angle, force = np.arctan2(x, RADIUS - 0.9 - z), stretch - stretch**-3                  # neo-Hookean, one width
    on = np.hypot(x, RADIUS - 0.9 - z) < 1.002 * RADIUS
    on &= (angle > 0.15) & (angle < angle[on].max() - 0.08)
    slope = np.polyfit(angle[on], np.log(force[on]), 1, w=np.sqrt(wall.area[on]))[0]
    assert slope == pytest.approx(mu, rel=5e-3)
    assert path.counts.iterations < 550


def test_a_ball_is_pushed_against_a_pressure():
    """Newton's method converges quadratically though the normals of the ball move with it."""
    scene = on_ball("none", pressure=0.046)
    path = fx.trace(scene, until=fx.travel(0.5), progress=False)
    assert path.counts.steps < 20 and path.counts.iterations < 4.5 * path.counts.steps


def test_force_of_a_rough_ball(rough_ball):
    """The force agrees with an axisymmetric solid to 1.5 %, and for 1 and 3 nodes per step to 1 %."""
    exact = fx.trace(pushed_solid(0.3), until=fx.travel(0.9), progress=False).last.measures["tool_force"]
    forces = []
    for path in (rough_ball, fx.trace(pushed(0.3, nodes_per_step=0.03), until=fx.travel(0.9), progress=False)):
        forces.append(path.last.measures["tool_force"])
        assert path.counts.iterations < 700 and path.last.measures["penetration"] < 1e-4 * THICKNESS
    assert forces[0] == pytest.approx(exact, rel=0.015) and forces[1] == pytest.approx(forces[0], rel=0.01)


@pytest.mark.slow
@pytest.mark.parametrize("mu, radius, travel", [(0.2, 0.5, 0.9), (0.45, 0.4, 0.8)])
def test_force_of_other_rough_balls(mu, radius, travel):
    """For other frictions and radii, the force agrees with an axisymmetric solid to 1.5 %."""
    ball = fx.tools.sphere(radius=radius, z=0.0)
    exact, found = (fx.trace(scene, until=fx.travel(travel), progress=False).last.measures["tool_force"]
                    for scene in (pushed_solid(mu, ball), pushed(mu, ball=ball)))
    assert found == pytest.approx(exact, rel=0.015)


@pytest.mark.slow
def test_more_friction_takes_more_force():
    """The force grows with friction, from the force of "none" to the force of "stick"."""
    forces = {mu: fx.trace(pushed(mu, 0.2), until=fx.travel(0.9), progress=False).last.measures["tool_force"]
              for mu in ("none", 1e-6, 0.2, 3.0, "stick")}
    none, hardly, some, most, stick = forces.values()
    assert hardly == pytest.approx(none, rel=1e-4) and none < 0.95 * some and some < 0.95 * most
    assert most == pytest.approx(stick, rel=0.03)


def test_work_of_the_plug_is_strain_energy_and_friction(rough_ball):
    """The work of the plug equals the strain energy plus friction, mu N times the sliding distance, to 1 %."""
    path = rough_ball
    travel, force, energy = (path[name] for name in ("travel", "tool_force", "strain_energy"))
    work, lost, before = np.trapezoid(force, travel), 0.0, None
    for state in path.states:
        with path.problem.state_context(state) as problem:
            (face,) = problem.contacts
            x = face.positions(state.x, state.control)
            limit = face.rule.area * 0.3 * face.law.pressure(face.history)
        if before is not None:
            way = x - before[0]
            normal = face.law.tool.distances(x).normal
            way -= np.einsum("ni,ni->n", way, normal)[:, None] * normal
            lost += (np.where(before[1] > 0, limit + before[1], 0.0) / 2) @ np.linalg.norm(way, axis=1)
        before = x, limit
    lost *= 4                                               # of the whole sheet, as the work and the energy
    assert 0.02 * work < lost < 0.2 * work
    assert work == pytest.approx(energy[-1] + lost, rel=0.01)


@pytest.mark.thorough
@pytest.mark.slow
def test_two_ranks_slide_alike():
    script = """
import json, sys
sys.path.insert(0, "tests")
import formingx as fx
from test_friction_in_space import pushed
path = fx.trace(pushed(0.3, 0.2), until=fx.travel(0.5), progress=False,
                intermediate=[fx.travel(d / 10) for d in range(1, 5)])
wall, met = path.wall(), [state.measures for state in path.states if state.target]
if path.problem.comm.rank == 0:
    print(json.dumps([wall.ratio.tolist(), *([m[name] for m in met] for name in ("tool_force", "contact_area"))]))
"""
    for one, two in zip(*(run_json(script, ranks) for ranks in (1, 2))):
        assert len(one) >= 5
        np.testing.assert_allclose(two, one, rtol=1e-7, atol=1e-10)


@pytest.mark.thorough
def test_a_frictional_run_continues_from_a_checkpoint(tmp_path):
    """A run with sliding points continues as if it had not been interrupted."""
    whole = fx.trace(pushed(0.3, 0.2), until=fx.travel(0.6), intermediate=[fx.travel(0.4)], progress=False)
    whole.save(tmp_path)
    scene, k = pushed(0.3, 0.2), int(np.flatnonzero(np.isclose(whole["travel"], 0.4, rtol=1e-12))[0])
    begun = fx.load(tmp_path, scene, state=k)
    assert begun.last.measures["travel"] == pytest.approx(0.4)
    path = fx.trace(scene, until=fx.travel(0.6), progress=False, start=begun)
    assert path.last.measures["tool_force"] == pytest.approx(whole.last.measures["tool_force"], rel=1e-8)


@pytest.mark.slow
def test_force_of_a_rough_ball_converges():
    exact = fx.trace(pushed_solid(0.3), until=fx.travel(0.9), progress=False).last.measures["tool_force"]
    path = fx.trace(pushed(0.3, 0.05), until=fx.travel(0.9), progress=False)
    assert path.last.measures["tool_force"] == pytest.approx(exact, rel=5e-3)
    assert path.counts.iterations < 900 and path.counts.failures < 5


@pytest.mark.slow
def test_walls_of_a_rough_cup():
    """Mean walls of rings of the cup agree with the axisymmetric solid to 1 %."""
    sheet, solid = (fx.trace(scene, until=fx.pressure(0.4), progress=False) for scene in formed_in_cup(0.3, 0.05))
    wall, profile = sheet.wall(), solid.profile()
    R = np.hypot(*wall.reference_points[wall.triangles].mean(1)[:, :2].T)
    exact = np.interp(R, profile.reference_radius, profile.thickness_ratio)
    for begin in np.arange(0.0, 1.0, 0.1):
        ring = (begin <= R) & (begin + 0.1 > R)
        mean, should = (np.average(v[ring], weights=wall.reference_area[ring]) for v in (wall.ratio, exact))
        assert mean == pytest.approx(should, rel=0.01)


def test_much_friction_in_a_groove_has_one_force():
    """Pressure and friction alternate unless corrections are halved; the force would depend on the steps."""
    groove = fx.tools.revolved(fx.Tool([(0, 0), (0.16, 0), (0.28, 0.1), (0.44, 0), (0.6, 0.2), (0.6, 0.6)],
                                       [0, 0.04, 0.04, 0.04, 0.04, 0]))
    sheet = fx.mesh.sheet(fx.mesh.circle(1.0, part="quarter"), size=0.24)
    scene = fx.Scene(mesh=sheet, thickness=0.02, materials=MATERIAL, supports=HELD, contacts=[
        fx.Contact("top", groove, 2.0, direction=(0, 0, -1), name="plug")])
    paths = [fx.trace(scene, until=fx.travel(0.28), intermediate=given, progress=False)
             for given in ([], [fx.travel(0.278)])]
    forces = [path["plug_force"] for path in paths]
    assert forces[0][-1] == pytest.approx(forces[1][-1], rel=1e-3)
    assert all(np.diff(force).min() > 0 for force in forces)


@pytest.mark.thorough
def test_no_point_jumps_over_a_lip_in_a_default_step():
    """A lip is half as wide as a triangle: walls agree with those of short steps to 3 %, triangle by triangle.

    With steps in which the pressure changes by a fifth, a point slid over it, and triangles were wrong by 90 %.
    """
    mould = fx.tools.box(half=(72, 42), depth=30, corner=18, fillet=8, lip=3, draft=8)
    sheet = fx.mesh.sheet(fx.mesh.rectangle(160.0, 100.0, corner=20.0, part="quarter"), size=6.0)
    scene = fx.Scene(mesh=sheet, thickness=1.5, materials=fx.NeoHookean(c10=0.05), supports=HELD,
                     model=fx.Membrane(wrinkles=0.01), loads=[fx.Pressure("top")],
                     contacts=[fx.Contact("bottom", mould, 0.3, name="mould")])
    path, short = (fx.trace(scene, until=fx.pressure(0.09), step=step, progress=False)
                   for step in (None, fx.StepControl(largest=0.05)))
    assert np.abs(path.wall().ratio / short.wall().ratio - 1).max() < 0.03
    assert path.counts.failures < 0.2 * path.counts.steps


@pytest.mark.thorough
def test_plug_tray_quick(tmp_path):
    """Results are of the whole tray: its weight equals the sheet's, and half and quarter models agree to 0.5 %."""
    found = summary("plug_tray", tmp_path, "--quick")
    quarter, ratio = found["quarter_16"], found["half_over_quarter"]
    sheet = 1e-3 * 1.05 * 1.5 * (160 * 100 - (4 - np.pi) * 20**2)
    assert quarter["weight_g"] == pytest.approx(sheet, rel=0.01)
    assert ratio["weight_g"] == pytest.approx(1.0, rel=1e-6) and max(abs(v - 1) for v in ratio.values()) < 5e-3
    assert quarter["touching"] > 0.95 and 0.5 < quarter["least_wall_mm"] < 0.9


@pytest.mark.parametrize("friction", ["none", 0.3])
def test_thin_sheets_deform_and_let_go_alike(friction):
    """At equal travel, walls and forces over the thickness are those of a thicker sheet, also as a ball lifts.

    Where the sheet should let go of the ball, it pulls at it by no more than 1e-5 of the largest force.
    """
    found, travels = [], [fx.travel(v) for v in (0.1, 0.2, 0.3, 0.4, 0.3, 0.2, 0.1)]
    for thickness in (1e-2, 4e-4, 3e-6):
        sheet = fx.mesh.sheet(fx.mesh.circle(1.0, part="quarter"), size=0.2)
        scene = fx.Scene(mesh=sheet, thickness=thickness, materials=MATERIAL, supports=HELD, contacts=[
            fx.Contact("top", fx.tools.revolved(BALL), friction, direction=(0, 0, -1), name="ball")])
        path = fx.Process(scene).run([
            fx.Stage("push", control="ball", until=fx.travel(0.4), intermediate=travels[:3]),
            fx.Stage("lift", control="ball", until=fx.travel(-0.02), intermediate=travels[4:])], progress=False)
        assert path["tool_force"].min() > -1e-5 * path["tool_force"].max()
        assert path.counts.failures < 0.1 * path.counts.steps     # the predicted change of pressure bounds a step
        met = np.flatnonzero(np.isclose(path["travel"][:, None], [0.1, 0.2, 0.3, 0.4], rtol=1e-12).any(1))
        assert len(met) >= len(travels)
        found.append((path["tool_force"][met] / thickness, [path.wall(path.states[k]).ratio for k in met]))
    for force, wall in found[1:]:
        np.testing.assert_allclose(force, found[0][0], rtol=0, atol=1e-5)
        np.testing.assert_allclose(wall, found[0][1], rtol=1e-6)


def test_axes_of_a_tangent_plane_are_orthonormal():
    """Also for normals along and against z, and in the plane z = 0."""
    normals = np.concatenate([np.eye(3), -np.eye(3), np.random.default_rng(1).standard_normal((20, 3))])
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    axes = np.stack([*_basis(normals), normals], axis=1)
    assert axes @ axes.transpose(0, 2, 1) == pytest.approx(np.tile(np.eye(3), (len(normals), 1, 1)), abs=1e-14)
