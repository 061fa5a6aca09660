"""Treloar's sheet through its pressure maximum."""

from dataclasses import replace

import numpy as np
import pytest
from conftest import treloar

import formingx as fx
from formingx.exact.inflation import membrane_limit_point
from formingx.forms.probes import Probe
from formingx.solve.arc_length import Curve
from formingx.solve.newton import fixed

STRETCHES = (1.2, 1.5, 2.0, 3.0, 4.0, 6.0)


@pytest.fixture(scope="module")
def path():
    """The default mesh of the demo, simply supported, with the stretches of its table."""
    return fx.trace(treloar((40, 2)), until=fx.pole_stretch(8.5), intermediate=[fx.pole_stretch(s) for s in STRETCHES])


@pytest.mark.quick
def test_limit_point(path):
    """The converged limit pressure, 0.493271 kg/cm2; membrane theory is 0.04 % below, as bending is left out."""
    limit, = path.limit_points
    assert limit.measures["pressure"] == pytest.approx(0.493271, abs=1.5e-6)
    assert limit.measures["pole_stretch"] == pytest.approx(2.1950, abs=1e-3)
    assert abs(limit.slope) < 1e-5
    _, membrane = membrane_limit_point(radius=1.25, thickness=0.082, c10=2.0)
    assert 1e-4 < limit.measures["pressure"] / membrane.pressure - 1 < 1e-3


def test_limit_pressure_is_the_largest_on_the_path(path):
    limit, = path.limit_points
    assert path["pressure"].max() == limit.measures["pressure"]
    for pressure, after in ((0.49327, None), (0.49327, limit)):
        found = path.state_at(fx.pressure(pressure), after=after)
        assert (found.measures["pole_stretch"] > limit.measures["pole_stretch"]) == (after is limit)


def test_a_limit_point_behind_the_state_is_not_taken_for_the_next(monkeypatch):
    """One behind a jump, at a kink of contact, was taken for the next, again and again; the step is made shorter."""
    locate, found = Curve.limit_point, []

    def behind_at_first(self, a, b):
        found.append(locate(self, a, b))
        return replace(found[0], control=a.control - 1e-6 * a.slope) if len(found) == 1 else found[-1]
    monkeypatch.setattr(Curve, "limit_point", behind_at_first)
    path = fx.trace(treloar((10, 1)), until=fx.pole_stretch(3.0), progress=False)
    limit, = path.limit_points
    assert limit is found[-1] and len(found) == 2 and path.counts.failures == 1
    assert limit.control == pytest.approx(found[0].control, rel=1e-9)


@pytest.mark.quick
def test_targets_are_hit_exactly(path):
    for stretch in (*STRETCHES, 8.5):
        assert path.target_state(fx.pole_stretch(stretch)).measures["pole_stretch"] == pytest.approx(stretch, rel=1e-9)
    assert path.last.measures["pole_stretch"] == pytest.approx(8.5, rel=1e-9)
    assert np.all(np.diff(path["pole_stretch"]) > 0)


def test_pole_stretch_is_that_of_the_mid_fibre(path):
    """It and the in-plane stretch of the mid-thickness fibre differ by 1.4e-3 on this mesh (3e-4 on a fine one)."""
    near = 1e-3 * 1.25
    probe = Probe(path.problem, [(near, 0.041)])
    for state in path.states:
        path.problem.x.array_w[:] = state.x
        fibre = 1 + probe.displacement(path.problem.x)[0, 0] / near
        assert fibre == pytest.approx(state.measures["pole_stretch"], rel=1.4e-3)


@pytest.mark.quick
def test_mass_is_kept(path):
    assert np.abs(path["mass_error"]).max() < 1e-9
    profile = path.profile()
    assert profile.thickness_ratio[0] == pytest.approx(8.5**-2, rel=1e-9)
    shells = 2 * np.pi * profile.middle[:, 0] * profile.thickness
    assert np.trapezoid(shells, profile.arc_length) == pytest.approx(np.pi * 1.25**2 * 0.082, rel=2e-3)


@pytest.mark.parametrize("eps", [0.0, 1e-3, 1e-9])
@pytest.mark.parametrize("support", [fx.SimplySupported("rim"), fx.Clamped("rim")], ids=lambda s: type(s).__name__)
def test_cost_does_not_depend_on_the_penalty(eps, support):
    path = fx.trace(treloar((40, 2), support, model=fx.MixedPressure(eps=eps)), until=fx.pole_stretch(8.5))
    assert path.counts.steps <= 25 and path.counts.iterations <= 150, path.counts


@pytest.mark.quick
@pytest.mark.parametrize("stretch", [1.2, 2.0, 8.5])
def test_newton_is_quadratic(path, stretch):
    """From half as far away the error after one iteration, which is the second correction, is a quarter."""
    curve, state = Curve(path.problem, fx.Tolerances()), path.target_state(fx.pole_stretch(stretch))
    away, found = path.states[path.states.index(state) - 1].x - state.x, []
    for share in (2e-3, 1e-3):
        again = curve.solve(state.x + share * away, state.control, fixed(state.control), "step", state)
        found.append(again.history[1].correction)
    assert np.log2(found[0] / found[1]) == pytest.approx(2, abs=0.1)
    curve.destroy()


@pytest.mark.quick
@pytest.mark.parametrize("length, stress", [(100.0, 1 / 98066.5), (0.1, 98066.5e-9 ** -1)],
                         ids=["m and Pa", "mm and GPa"])
def test_results_do_not_depend_on_units(path, length, stress):
    """`length` cm and `stress` kg/cm2 are the units."""
    scene = treloar((40, 2), length=length, stress=stress)
    other = fx.trace(scene, until=fx.pole_stretch(8.5), intermediate=[fx.pole_stretch(s) for s in STRETCHES])
    assert (other.counts.steps, other.counts.failures, other.counts.iterations) == (
        path.counts.steps, path.counts.failures, path.counts.iterations)
    assert other["pressure"] * stress == pytest.approx(path["pressure"], rel=1e-9)
    assert other["pole_height"] * length == pytest.approx(path["pole_height"], rel=1e-9)
    assert other.profile().thickness_ratio == pytest.approx(path.profile().thickness_ratio, rel=1e-9)


def test_mesh_convergence():
    """Limit pressures approach that of 160x8 elements (benchmarks/treloar_mesh.py), each at least 3 times closer."""
    errors = [abs(fx.trace(treloar(n), until=fx.pole_stretch(2.3)).limit_points[0].measures["pressure"] - 0.4932712041)
              for n in ((10, 1), (20, 2), (40, 4))]
    assert errors[2] < 3e-7 and errors[2] < errors[1] / 3 < errors[0] / 9, errors


def test_work_of_the_pressure_is_the_energy_gained():
    """Clamped: pressure integrated over the enclosed volume (fine steps, Simpson) is the strain energy."""
    path = fx.trace(treloar((10, 1), fx.Clamped("rim")), until=fx.pole_stretch(3.0),
                    step=fx.StepControl(length=0.02, largest=0.02))
    pressure, volume = path.curve("pressure", "enclosed_volume", points=2)
    start = 2 * next(i for i, v in enumerate(path["enclosed_volume"]) if v > 0.3)
    p, v = pressure[start:], volume[start:]
    work = 0.0
    for i in range(0, len(v) - 2, 2):            # parabola through three unevenly spaced points
        a, b = v[i + 1] - v[i], v[i + 2] - v[i + 1]
        work += (a + b) / 6 * ((2 - b / a) * p[i] + (a + b) ** 2 / (a * b) * p[i + 1] + (2 - a / b) * p[i + 2])
    gained = path.last.measures["strain_energy"] - path.states[start // 2].measures["strain_energy"]
    assert work == pytest.approx(gained, rel=1e-5)


@pytest.mark.quick
def test_fixed_control_meets_the_same_states(path):
    """SNES at fixed pressure and the continuation agree."""
    fixed = fx.solve(path.problem.scene, to=0.4, increments=10).last.measures
    traced = path.state_at(fx.pressure(0.4)).measures
    assert fixed["pole_height"] == pytest.approx(traced["pole_height"], rel=1e-8)


def test_fixed_control_stops_at_the_limit_point():
    with pytest.raises(fx.ConvergenceError, match="trace") as caught:
        fx.solve(treloar(), to=0.6, increments=6)
    last = caught.value.path.last.measures
    assert 0.48 < last["pressure"] < 0.4934


def test_target_never_reached_names_the_maximum():
    with pytest.raises(fx.ConvergenceError, match="pressure = 0.6 was not reached.*limit point.*0.493") as caught:
        fx.trace(treloar(), until=fx.pressure(0.6), max_steps=25)
    assert len(caught.value.path) == 26
    assert caught.value.path.limit_points


@pytest.mark.quick
def test_layers_of_one_material_are_one_body():
    """Two layers with the same material object give the numbers of one layer."""
    rubber = fx.NeoHookean(c10=2.0)
    supports, loads = [fx.Symmetry("axis"), fx.SimplySupported("rim")], [fx.Pressure("bottom")]
    heights = []
    for thickness, elements in ((0.082, (8, 2)), ({"a": 0.041, "b": 0.041}, (8, 1))):
        mesh = fx.mesh.disc(radius=1.25, thickness=thickness, elements=elements)
        scene = fx.Scene(mesh=mesh, materials=rubber, supports=supports, loads=loads)
        path = fx.trace(scene, until=fx.pressure(0.3))
        assert path.problem.forms.space.num_sub_spaces == 2
        heights.append(path.last.measures["pole_height"])
    assert heights[0] == pytest.approx(heights[1], rel=1e-4)        # the diagonals differ


@pytest.mark.quick
def test_pressure_jumps_between_layers():
    """Continuous pressures: layers of different material have fields of their own; three layers need only two."""
    mesh = fx.mesh.disc(radius=1.0, thickness={"a": 0.1, "b": 0.1, "c": 0.1}, elements=(6, 1))
    soft, hard = fx.NeoHookean(c10=1.0), fx.NeoHookean(c10=20.0)
    scene = fx.Scene(mesh=mesh, materials={"a": soft, "b": hard, "c": soft}, loads=[fx.Pressure("bottom")],
                     model=fx.MixedPressure(space="P1"),
                     supports=[fx.Symmetry("axis"), fx.SimplySupported("rim")])
    path = fx.trace(scene, until=fx.pole_height(0.5))
    forms, point = path.problem.forms, (0.0, 0.1)                       # where a and b meet on the axis
    assert forms.space.num_sub_spaces == 3
    normal_stretch = path.stress().at_points([point], "a").deformation_gradient[0, 1, 1]
    with path.problem.state_context(path.last):
        p = [value_at(forms.w.sub(1 + forms.pressure_of[name]).collapse(), point) for name in "ab"]
    # 2 c10 (l^2 - 1) + p, the stress across the interface, is the same on both sides
    assert forms.stress * (p[0] - p[1]) == pytest.approx(2 * (20.0 - 1.0) * (normal_stretch**2 - 1), rel=3e-2)


def value_at(function, point):
    """A nodal value of a Lagrange function."""
    nodes = function.function_space.tabulate_dof_coordinates()[:, :2]
    away = np.hypot(*(nodes - point).T)
    assert away.min() < 1e-12
    return function.x.array[np.argmin(away)]


@pytest.mark.slow
def test_a_corner_that_creases_turns_the_path_back():
    """Clamped on 60 x 3 elements: the default arrives; Taylor-Hood creases at the corner, stops and says so."""
    coarse, fine = (fx.trace(treloar(elements, fx.Clamped("rim")), until=fx.pole_stretch(8.5), progress=False)
                    for elements in ((40, 2), (60, 3)))
    (a,), (b,) = coarse.limit_points, fine.limit_points
    assert a.measures["pressure"] == pytest.approx(b.measures["pressure"], rel=1e-3)
    with pytest.raises(fx.ConvergenceError, match="turned back") as error:
        fx.trace(treloar((60, 3), fx.Clamped("rim"), model=fx.MixedPressure(space="P1")), until=fx.pole_stretch(8.5),
                 max_steps=100, progress=False)
    stretch = error.value.path["pole_stretch"]
    assert stretch[-1] < stretch.max() < 8.5 and error.value.path["pressure"].min() >= 0
