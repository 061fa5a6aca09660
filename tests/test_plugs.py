"""Sheets under plugs: the membrane solution, the rule for meshes, and the fast rows of the extremes."""

import sys
from dataclasses import replace

import numpy as np
import pytest
from conftest import ROOT, treloar

import formingx as fx
from formingx.errors import InputError
from formingx.exact.plug import membrane_sliding_over_plug, membrane_under_plug
from formingx.solve.snap_through import snaps, was_passed

sys.path.insert(0, str(ROOT / "benchmarks"))
import plug_extremes  # noqa: E402
from plug_extremes import Plug  # noqa: E402

SHEET = {"radius": 7.62, "plug_radius": 1.05, "thickness": 0.0254, "c10": 0.1213, "c01": 0.03327}


def energy(state, plug_radius, thickness, c10, c01, **_):
    """Strain energy of the Mooney membrane under a plug."""
    def density(l1, l2):
        l3 = 1 / (l1 * l2)
        return c10 * (l1**2 + l2**2 + l3**2 - 3) + c01 * (l1**-2 + l2**-2 + l3**-2 - 3)
    l2 = state.r / state.R
    outside = np.trapezoid(2 * np.pi * state.R * density(1 / (l2 * state.thickness_ratio), l2), state.R)
    face = np.pi * (plug_radius / state.face_stretch) ** 2 * density(state.face_stretch, state.face_stretch)
    return thickness * (outside + face)


@pytest.mark.parametrize("friction", ["stick", "none"])
def test_work_on_a_membrane_is_its_energy(friction):
    """dE/dtravel = force, with and without friction."""
    below, at, above = (membrane_under_plug(t, **SHEET, friction=friction) for t in (2.9, 3.0, 3.1))
    slope = (energy(above, **SHEET) - energy(below, **SHEET)) / 0.2
    assert slope == pytest.approx(at.force, rel=2e-3)
    assert (at.face_stretch == 1) == (friction == "stick")


def test_membrane_forces_scale_with_moduli_and_balance_at_the_edge():
    """The force is proportional to the moduli; for a sliding membrane it is 2 pi rp T sin(slope) at the edge."""
    twice = membrane_under_plug(3.0, **{**SHEET, "c10": 0.2426, "c01": 0.06654})
    assert twice.force == pytest.approx(2 * membrane_under_plug(3.0, **SHEET).force, rel=1e-8)
    slides = membrane_under_plug(4.0, **{**SHEET, "c01": 0.0}, friction="none")
    tension = 2 * SHEET["c10"] * SHEET["thickness"] * (1 - slides.face_stretch**-6)
    r, z = (np.diff(v[:2])[0] for v in (slides.r, slides.z))
    assert slides.force == pytest.approx(2 * np.pi * SHEET["plug_radius"] * tension * z / np.hypot(r, z), rel=5e-3)
    with pytest.raises(InputError, match="the membrane would touch the side of the plug"):
        membrane_under_plug(8.0, **SHEET, friction="none")


@pytest.mark.thorough
@pytest.mark.parametrize("plug", [case for cases in plug_extremes.CASES.values() for case in cases])
def test_one_rule_for_all_meshes(plug):
    nodes = plug_extremes.mesh_for(plug).nodes_of("top")[::2, 0]         # ends of edges
    radius, fillet, thickness = plug.lengths
    sizes, last = np.diff(nodes), np.searchsorted(nodes, radius * (1 - 1e-9))
    assert np.isclose(nodes, radius).any() and len(nodes) < 600
    assert sizes[last - 1] < 1.3 * max(min(thickness / 2, (fillet or thickness) / 3), thickness / 10)
    if plug.law != "held" and plug.law != "stick":           # what slides over the edge comes there stretched
        slides = sizes[np.searchsorted(nodes, 0.6 * radius * (1 + 1e-9)) + 1:last]
        assert slides.max() < 1.5 * min((fillet or thickness / 2) / 4, thickness / 2)


ROWS = [Plug(slenderness=5.0), Plug(radius=0.5), Plug(law="frictionless", fillet="round", back=True), Plug(back=True)]


@pytest.mark.parametrize("plug", ROWS, ids=str)
def test_extreme_plugs(plug):
    path, end, _ = plug_extremes.run(plug)
    assert end == "arrived"
    assert path["penetration"].max() < 0.01 * plug.lengths[2]
    assert 0 < plug_extremes.smallest_J(path, path.last) <= 1 + 1e-9
    if plug.back and plug.law == "frictionless":             # what is held remembers the edge it was drawn around
        assert np.abs(path.last.x).max() < 1e-6


def test_a_repeated_state_of_the_path_is_refused():
    """Beyond the pressure maximum a state of the rising branch is refused; one of the falling branch is not."""
    path = fx.trace(treloar(), until=fx.pole_stretch(4.0), progress=False)
    risen, fallen = path.state_at(fx.pressure(0.46)), path.state_at(fx.pressure(0.46), after=path.limit_points[0])
    curve = path.record.curve
    assert was_passed(curve, path.states[:-1], path.last, risen)
    k = next(i for i, s in enumerate(path.states) if s.measures["pole_stretch"] > fallen.measures["pole_stretch"])
    del path.states[k:]
    assert not was_passed(curve, path.states[:-1], path.last, fallen)
    path.last.kind = "jump"                                  # from here on the body is another
    assert not was_passed(curve, path.states[:-1], path.last, risen)


def test_work_ahead_is_that_of_the_pressure_on_the_volume_that_grows():
    """Before, at and after the pressure maximum; a path snaps where the volume would decrease."""
    path = fx.trace(treloar(support=fx.Clamped("rim")), until=fx.pole_stretch(4.0), progress=False)
    curve, forms, h = path.record.curve, path.problem.forms, 1e-5
    volume = fx.enclosed_volume(1.0).bind(path.problem)
    limit = path.limit_points[0]
    for state in (path.states[3], limit, path.last):
        ends = [curve.value(volume, state.x + by * state.direction, state.control + by * state.slope) for by in (h, -h)]
        growth = (ends[0] - ends[1]) / (2 * h)
        work = curve.work_rate(state) * forms.stress * forms.volume / forms.control_scale
        assert work == pytest.approx(growth, rel=1e-6) and growth > 0
    assert not any(snaps(curve, state, "continue_volume", 1.0) for state in (path.states[3], limit, path.last))
    back = replace(path.states[3], direction=-path.states[3].direction, slope=-path.states[3].slope)
    assert snaps(curve, back, "continue_volume", 1.0)                  # neither pressure nor volume grows
    limit.direction, limit.slope = -limit.direction, -limit.slope
    assert snaps(curve, limit, "continue_volume", 1.0) and not snaps(curve, limit, "continue", 1.0)


WILLIAMS = dict(radius=8.89, plug_radius=1.905, thickness=0.6985, c10=0.448)


def test_small_fillet_equals_sharp_edge():
    """The forces of two independent integrations approach each other as the fillet radius decreases."""
    away, thin = [], {**WILLIAMS, "thickness": 1e-6}
    for fillet in (0.02, 0.005):
        slides = membrane_sliding_over_plug(1.5, fillet=fillet, mu=0.0, **thin)
        sharp = membrane_under_plug(slides.travel, friction="none", **thin)
        away.append(abs(slides.force / sharp.force - 1))
    assert away[1] < 0.3 * away[0] < 1e-3


def test_tension_grows_by_friction_as_on_a_capstan():
    """At a large stretch the force is 4 pi rp c10 h0 without friction; friction on the edge adds exp(mu pi/2)."""
    limit = 4 * np.pi * (1.905 + 0.6985 / 20**2 / 2) * 0.448 * 0.6985        # at the middle surface
    smooth, rough = (membrane_sliding_over_plug(20.0, fillet=0.05, mu=mu, **WILLIAMS) for mu in (0.0, 0.1))
    assert smooth.force == pytest.approx(limit, rel=1e-5)
    assert rough.force > np.exp(0.1 * np.pi / 2) * limit
    assert (smooth.wrap, rough.wrap) == pytest.approx((np.pi / 2, np.pi / 2))
    with pytest.raises(fx.InputError, match="does not draw the membrane so far"):
        membrane_sliding_over_plug(1e6, fillet=0.05, mu=0.1, **WILLIAMS)


def test_a_thick_sheet_on_a_capstan():
    """Friction acts below the middle surface: on a fillet of radius f mu has the effect of mu f/(f + h/2)."""
    def tension(thickness, mu):
        sheet = {**WILLIAMS, "thickness": thickness}
        return membrane_sliding_over_plug(1.5, fillet=0.35, mu=mu, **sheet).force / thickness
    h = 0.6985 / 1.5**2
    thin, thick = (tension(t, 0.5) / tension(t, 0.0) for t in (1e-6, 0.6985))
    assert np.log(thick) / np.log(thin) == pytest.approx(1 / (1 + h / 2 / 0.35), rel=0.1)
