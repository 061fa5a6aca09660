"""Snap-through: jumps to the next state where there is no equilibrium nearby."""

import sys
from dataclasses import replace

import numpy as np
import pytest
from conftest import ROOT
from scipy import integrate, optimize

import formingx as fx
from formingx import tools
from formingx.contact.face import FaceContact
from formingx.results.evaluate import snaps
from formingx.results.show import plots
from formingx.solve.newton import fixed
from formingx.solve.path_following import PathFollowing, Run
from formingx.solve.snap_through import SnapThrough

sys.path.insert(0, str(ROOT / "demos"))
import plugs  # noqa: E402
import relaxing_pot  # noqa: E402
from williams_plug import C10, PLUG, RADIUS, THICKNESS  # noqa: E402


class Balloon:
    """A hollow sphere, outer over inner radius 1.1, Mooney: pressure and energy at an inner stretch, closed form."""

    c10, c01, inner, outer = 1.0, 0.1, 1.0, 1.1

    def scene(self):
        mesh = fx.mesh.sphere(inner_radius=self.inner, thickness=self.outer - self.inner, elements=(4, 2))
        return fx.Scene(mesh=mesh, materials=fx.MooneyRivlin(c10=self.c10, c01=self.c01), loads=[fx.Pressure("inner")],
                        supports=[fx.Symmetry("axis"), fx.Symmetry("equator", normal="z")])

    def energy_density(self, l):
        return self.c10 * (2 * l**2 + l**-4 - 3) + self.c01 * (l**4 + 2 * l**-2 - 3)

    def stretch_at(self, R, l):
        """Of the sphere of reference radius R where the inner one is stretched l."""
        return (1 + (l**3 - 1) * self.inner**3 / R**3) ** (1 / 3)

    def pressure(self, l):
        def slope(s):
            return (4 * self.c10 * (s - s**-5) + 4 * self.c01 * (s**3 - s**-3)) / (s**3 - 1)
        return integrate.quad(slope, self.stretch_at(self.outer, l), l)[0]

    def energy(self, l):
        """Of the half sphere."""
        return 2 * np.pi * integrate.quad(lambda R: self.energy_density(self.stretch_at(R, l)) * R**2, self.inner,
                                          self.outer)[0]


@pytest.fixture(scope="module")
def balloon():
    """(closed form, path): over the maximum of its pressure, at which it snaps."""
    ball = Balloon()
    limit = optimize.minimize_scalar(lambda l: -ball.pressure(l), bounds=(1.1, 2.5), method="bounded").x
    return ball, limit, fx.trace(ball.scene(), until=fx.pressure(1.1 * ball.pressure(limit)),
                                 at_limit_point="snap_through")


def test_a_balloon_snaps_to_the_state_of_the_same_pressure(balloon):
    ball, limit, path = balloon
    (before,), (after,) = path.limit_points, path.jumps
    assert path.states.index(after) == path.states.index(before) + 1
    assert before.measures["pressure"] == pytest.approx(ball.pressure(limit), rel=1e-4)
    assert after.measures["pressure"] == pytest.approx(before.measures["pressure"], rel=1e-4)
    beyond = optimize.brentq(lambda l: ball.pressure(l) - ball.pressure(limit), limit + 1, 20)
    volume = after.measures["enclosed_volume"]
    assert beyond > 4 and volume == pytest.approx(4 * np.pi / 3 * (beyond**3 - 1), rel=1e-3)
    assert path["pressure"][-1] > 1.09 * ball.pressure(limit)


def test_a_target_that_a_balloon_snaps_past_is_named(balloon):
    """No state of the path has it, and the run does not go on without end."""
    scene = balloon[0].scene()
    with pytest.raises(fx.ConvergenceError, match=r"the body snaps past the target, from 1\.\d+ to \d+\.") as caught:
        fx.trace(scene, until=fx.pole_stretch(2.5), at_limit_point="snap_through")
    assert caught.value.path.last.kind == "jump"


def test_energy_lost_by_a_snapping_balloon_is_work_minus_stored_energy(balloon):
    ball, limit, path = balloon
    (before,), (after,) = path.limit_points, path.jumps
    lost = after.jump["dissipated"]
    work = before.measures["pressure"] * (after.measures["enclosed_volume"] - before.measures["enclosed_volume"])
    assert lost > 0
    assert lost == pytest.approx(work - (after.measures["strain_energy"] - before.measures["strain_energy"]), rel=2e-3)


def plug(mu=1.0, thickness=0.5):
    """A flat plug with a fillet on a clamped sheet: points that leave its edge find no state nearby."""
    mesh = fx.mesh.disc(radius=10.0, thickness=thickness, elements=(60, 2), concentrate={1.5: 0.2, 2.5: 0.2})
    tool = tools.male(radius=2.5, height=60.0, base=-60.0, fillet=0.5).mirrored().moved(z=thickness)
    return fx.Scene(mesh=mesh, materials=fx.MooneyRivlin(c10=0.4, c01=0.04),
                    supports=[fx.Symmetry("axis"), fx.Clamped("rim")],
                    contacts=[fx.Contact("top", tool, mu, direction=(0, -1), points=4)])


def pushed(to=6.5, **step):
    """To 6.5 past two jumps; at 6.9 a point is at the brink of leaving the edge."""
    return fx.trace(plug(), until=fx.travel(to), intermediate=[fx.travel(t) for t in range(1, 7)],
                    step=fx.StepControl(target=6, **step), progress=False)


def weighed(run):
    """(path, work of the tractions at the contact points), with what is solved for on the way of jumps.

    Trapezoidal rule; every jump must find its end at once.
    """
    rows, advance = [], FaceContact.advance

    def recorded(contact, fields, control):
        rows.append((contact.positions(fields, control),
                     contact.rule.area[:, None] * contact.tractions(fields, control).force))
        advance(contact, fields, control)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(FaceContact, "advance", recorded)
        path = run()
    return path, sum(0.5 * float(np.sum((f + g) * (b - a))) for (a, f), (b, g) in zip(rows, rows[1:]))


def lost_in_jumps(path):
    return sum(state.jump["dissipated"] for state in path.jumps)


def work_and_energy(path):
    """(work of the tool, energy gained)."""
    return np.trapezoid(path["tool_force"], path["travel"]), path["strain_energy"][-1] - path["strain_energy"][0]


@pytest.fixture(scope="module")
def rough():
    """A path with a jump."""
    path = pushed()
    assert len(path.jumps) >= 1
    return path


def test_a_rough_plug_continues_where_points_leave_its_edge(rough):
    assert rough["travel"][-1] == pytest.approx(6.5, rel=1e-12)
    assert np.all(np.diff(rough["travel"]) > 0)
    assert all(state.jump["dissipated"] > 0 and state.jump["moved"] > 0 for state in rough.jumps)


def test_large_wall_changes_in_a_frictional_snap_through_are_reported(rough):
    snap, k = snaps.largest(rough), next(k for k, state in enumerate(rough.states) if state.kind == "jump")
    ratios = [rough.profile(rough.states[n]).wall_ratio for n in (k - 1, k)]
    assert (snap.jumps, snap.state) == (len(rough.jumps), k)
    assert snap.change == pytest.approx(np.abs(ratios[1] / ratios[0] - 1).max(), rel=1e-12)
    assert 0.005 < snap.change < 0.05 and snaps.findings(snap) == []
    finding, = snaps.findings(snap._replace(ratio_after=1.1 * snap.ratio_before))
    assert finding.severity == "warning" and f"state {k}" in finding.text and "StepControl" in finding.text


def test_the_next_snap_through_changes_the_control_ten_times_as_much(rough):
    """Until a step succeeds."""
    first = SnapThrough().control_change
    for k, state in enumerate(rough.states):
        if state.kind == "jump":
            before, during, after = (rough.states[n].stepping["jumps"][0] for n in (k - 1, k, k + 1))
            assert during == pytest.approx(10 * first, rel=1e-12) and before == after == first


def share_of_friction(path):
    """Largest traction by the elastic slip that is remembered, over mu N, of all points that touch and states."""
    contact, n, most = path.problem.contacts[0], path.problem.forms.space.dofmap.index_map.size_local, 0.0
    for state in path.states:
        with path.problem.state_context(state):
            touches = contact.touching(state.x[:n], state.control)
            most = max(most, np.abs(contact.history.slip[touches]).max(initial=0.0) / contact.law.elastic_slip)
    return most


def test_friction_keeps_its_law_through_jumps(rough):
    """No point has more than mu N, and some slide."""
    assert share_of_friction(rough) == pytest.approx(1.0, rel=1e-6)


def test_work_equals_stored_energy_friction_and_snap_through_losses():
    path, slips = weighed(lambda: pushed(7.0))
    (work, energy), lost = work_and_energy(path), lost_in_jumps(path)
    assert slips > 0 and lost > 4e-3 * work
    assert work == pytest.approx(energy + slips + lost, rel=1e-3)


@pytest.mark.parametrize("schedule", [
    {"first_viscosity": 3.0, "viscosity_growth": 2.0},
    pytest.param({"viscosity_growth": 2.0, "viscosity_growth_in_motion": 2.0}, marks=pytest.mark.slow)], ids=str)
def test_where_jumps_end_does_not_depend_on_how_eta_changes(rough, schedule, monkeypatch):
    monkeypatch.setattr(Run, "settings", PathFollowing(snap_through=SnapThrough(**schedule)))
    other = pushed()
    assert other.jumps and other["tool_force"][-1] == pytest.approx(rough["tool_force"][-1], rel=1e-3)


@pytest.mark.slow
def test_snap_through_states_do_not_depend_on_the_step(monkeypatch):
    """At 7.2, past the third jump; at 6.9, at its brink, which of two states a run ends in is left to round-off."""
    before = pushed(7.2, largest=0.02)["tool_force"][-1]
    schedule = SnapThrough(first_viscosity=3.0, viscosity_growth=2.0)
    monkeypatch.setattr(Run, "settings", PathFollowing(snap_through=schedule))
    assert pushed(7.2, largest=0.02)["tool_force"][-1] == pytest.approx(before, rel=1e-3)


def williams(**step):
    """Williams' plug with mu = 0.3 past its first snaps; elements in proportion to the radius."""
    made = plugs.scene(RADIUS, THICKNESS, PLUG, 0.35, fx.NeoHookean(c10=C10), 0.3, (37, 2), near={0.0: 0.0357},
                       points=4, penalty=2e4, ramp=1e-3)
    return fx.trace(made, until=fx.travel(9.0), intermediate=[fx.travel(t) for t in range(1, 9)],
                    step=fx.StepControl(target=6, **step), progress=False)


@pytest.mark.slow
def test_forces_on_a_plug_do_not_depend_on_the_steps_and_its_work_is_accounted_for():
    found = weighed(williams), weighed(lambda: williams(length=0.01, largest=0.01))
    forces = [[path.target_state(fx.travel(t)).measures["tool_force"] for t in range(1, 10)] for path, _ in found]
    assert forces[0] == pytest.approx(forces[1], rel=3e-3)
    for path, slips in found:
        work, energy = work_and_energy(path)
        assert len(path.jumps) > 3 and min(state.jump["dissipated"] for state in path.jumps) >= 0
        assert work == pytest.approx(energy + slips + lost_in_jumps(path), rel=1e-3)
        assert share_of_friction(path) < 1 + 1e-6


@pytest.mark.thorough
def test_a_sheet_without_friction_snaps_off_an_edge_too():
    """Elements longer than the edge: no step is short enough where a node leaves it, and the plug moves on."""
    made = plugs.scene(10.0, 0.1, 2.5, 0.05, fx.MooneyRivlin(c10=0.4, c01=0.04), "frictionless", (40, 1),
                       near={1.5: 0.1, 2.5: 0.1})
    path = fx.trace(made, until=fx.travel(5.0), intermediate=[fx.travel(2.5)], step=fx.StepControl(target=6),
                    progress=False)
    assert path["travel"][-1] == pytest.approx(5.0, rel=1e-12)
    assert path.jumps and all(state.jump["dissipated"] >= 0 for state in path.jumps)
    assert path.jumps[0].measures["travel"] == pytest.approx(3.08, abs=0.05)


@pytest.mark.thorough
def test_a_nearly_singular_sheet_is_in_equilibrium_after_two_snaps():
    """On a rough plug, at 8.80 and 8.82 as with steps of 0.01. With looser viscous solutions it snaps 16 times."""
    made = plugs.scene(RADIUS, THICKNESS, PLUG, 0.35, fx.NeoHookean(c10=C10), "stick", (60, 2))
    path = fx.trace(made, until=fx.travel(9.5), progress=False)
    assert [state.measures["travel"] for state in path.jumps] == pytest.approx([8.80, 8.82], abs=0.005)
    assert min(state.jump["dissipated"] for state in path.jumps) > 5e-4


def test_snap_through_without_equilibrium_ends_in_bounded_time():
    mesh = fx.mesh.disc(radius=10.0, thickness=0.3, elements=(12, 1))
    scene = fx.Scene(mesh=mesh, materials=fx.NeoHookean(c10=0.4), loads=[fx.Pressure("bottom")],
                     supports=[fx.Symmetry("axis"), fx.SimplySupported("rim")])
    with pytest.raises(fx.ConvergenceError, match="comes to rest nowhere") as error:
        fx.trace(scene, until=fx.pressure(1.0), at_limit_point="snap_through")
    assert error.value.path.last.kind == "limit point"
    stopped = fx.trace(scene, until=fx.pressure(1.0), at_limit_point="stop")
    assert "the pressure has a limit point" in stopped.ended and stopped.last.kind == "limit point"


@pytest.mark.slow
def test_a_snap_through_ends_once_the_body_is_in_equilibrium():
    """A plug and a pressure in step, where a point leaves the plug: each jump ends once the body rests."""
    plug = fx.Contact("top", tools.sphere(radius=0.5, z=0.1), "none", direction=(0, -1), name="plug")
    scene = fx.Scene(mesh=fx.mesh.disc(radius=1.0, thickness=0.1, elements=(4, 1)), materials=fx.NeoHookean(c10=1.0),
                     loads=[fx.Pressure("bottom", name="air")], contacts=[plug],
                     supports=[fx.Symmetry("axis"), fx.Clamped("rim")])
    rows = [(0.0, 0.0), (0.1, 0.02), (0.93557094, 0.95713907)]
    with pytest.raises(fx.ConvergenceError, match="contact does not settle") as error:
        fx.Process(scene).run([fx.Stage("on", amplitudes={"air": rows, "plug": rows})], progress=False)
    assert error.value.path.counts.iterations < 9000        # 11600 with 400 solutions of a body that stands still


def test_a_released_pot_springs_back_without_inversion():
    """What the mould bore, as a load that fades by and by, would press the pot through its own base on the way."""
    path, _ = relaxing_pot.form("relaxing", 0.6, 0, (20, 1), 2e-2)
    deep = max(state.measures["pole_height"] for state in path.states if state.stage == "in the mould")
    out = [state for state in path.states if state.stage == "out of the mould"]
    jump, = (state for state in out if state.kind == "jump")
    assert jump is out[-1] and jump.control == 1.0 and 0 < jump.jump["dissipated"] < 100.0
    assert min(state.measures["pole_height"] for state in out) > 0.85 * deep


def test_at_limit_point_is_one_of_three():
    with pytest.raises(fx.InputError, match="at_limit_point = 'leap' is not known"):
        fx.trace(plug(), until=fx.travel(1.0), at_limit_point="leap")
    with pytest.raises(fx.InputError, match="at_limit_point"):
        fx.Stage("push", control="plug", until=fx.travel(1.0), at_limit_point="leap")


def test_pictures_and_reports_mark_jumps(balloon, tmp_path):
    path = balloon[-1]
    axes = plots.curve(path, "enclosed_volume", "pressure")
    marks = [line for line in axes.lines if line.get_marker() == "D"]
    assert [list(line.get_xdata()) for line in marks] == [[s.measures["pressure"] for s in path.jumps]]
    fx.report([path], tmp_path / "report.html")
    assert f"{len(path.jumps)} jump" in (tmp_path / "report.html").read_text()


def test_a_jump_that_is_solved_again_keeps_its_lost_work():
    """As where points separate after it; the target, the kind and the sense of the tangent stay, too."""
    path = fx.trace(Balloon().scene(), until=fx.pole_stretch(1.5), progress=False)
    curve, (*_, old, last) = path.record.segments[-1].curve, path.states
    jumped = replace(last, kind="jump", jump={"dissipated": 0.5}, direction=-last.direction, slope=-last.slope)
    found = curve.solve_again(jumped, fixed(jumped.control), old)
    assert (found.kind, found.jump, found.target) == ("jump", jumped.jump, last.target)
    assert found.slope == pytest.approx(jumped.slope, rel=1e-4) and found.direction @ jumped.direction > 0
    assert found.control == last.control and np.allclose(found.x, last.x, atol=1e-12)
