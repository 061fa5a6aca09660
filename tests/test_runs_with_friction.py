"""Runs with friction through limit points, kinks and snap-through."""

import sys

import numpy as np
import pytest
from conftest import ROOT

import formingx as fx
from formingx import tools

sys.path.insert(0, str(ROOT / "demos"))
import plugs  # noqa: E402

R, H = 10.0, 0.3
MATERIAL = fx.MooneyRivlin(c10=0.4, c01=0.04)


def scene(contacts, loads=(), mesh=None, materials=MATERIAL, supports=None):
    return fx.Scene(mesh=mesh or fx.mesh.disc(radius=R, thickness=H, elements=(60, 2)), materials=materials,
                    supports=[fx.Symmetry("axis"), *(supports or [fx.Clamped("rim")])], loads=loads, contacts=contacts)


def law_is_kept(path, contact=0):
    """Largest |T| over mu N of all states."""
    most = 0.0
    for state in path.states:
        with path.problem.state_context(state) as problem:
            found = problem.contacts[contact].tractions(state.x[: problem.forms.space.dofmap.index_map.size_local],
                                                        state.control)
        pressed = found.normal > 0
        limit = problem.contacts[contact].law.mu * found.normal[pressed]
        most = max(most, (np.abs(found.tangential[pressed]) / limit).max(initial=0.0))
    return most


@pytest.mark.slow
@pytest.mark.parametrize("fillet", [0.0, 0.1 * H])
def test_vacuum_over_a_male_mould_with_a_sharp_edge(fillet):
    mould = tools.Tool([(R, 0), (R, -4.05), (3, -4.05), (3, -0.05), (0, -0.05)], [0, 0.5, 0.5, fillet, 0])
    path = fx.trace(scene([fx.Contact("bottom", mould, 0.3)], [fx.Pressure("top")]), until=fx.pressure(0.4))
    profile = path.profile()
    top = np.interp(1.5, profile.reference_radius, profile.bottom[:, 1])
    assert (top, profile.bottom[:, 1].min()) == pytest.approx((-0.05, -4.05), abs=1e-4)
    assert path.jumps and all(state.jump["dissipated"] > 0 for state in path.jumps)
    assert law_is_kept(path) < 1 + 1e-6


@pytest.mark.slow
def test_a_cup_three_and_a_half_radii_deep():
    mould = tools.cup(radius=R, depth=35.0, mouth=H, fillet=2.0)
    path = fx.trace(scene([fx.Contact("top", mould, 0.3)], [fx.Pressure("bottom")]), until=fx.pressure(1.0))
    assert path["pole_height"][-1] == pytest.approx(35.0 - H / 2, rel=0.01)
    assert law_is_kept(path) < 1 + 1e-6


@pytest.mark.slow
def test_a_stiff_layer_between_soft_ones_in_a_cup():
    mesh = fx.mesh.disc(radius=R, thickness={"a": 0.1, "b": 0.1, "c": 0.1}, elements=(60, 1))
    stiff = fx.MooneyRivlin(c10=400.0, c01=40.0)
    mould = tools.cup(radius=R, depth=5.0, mouth=H, fillet=2.0)
    path = fx.trace(scene([fx.Contact("top", mould, 0.3)], [fx.Pressure("bottom")], mesh,
                          {"a": MATERIAL, "b": stiff, "c": MATERIAL}), until=fx.pressure(200.0))
    assert path["pressure"][-1] == pytest.approx(200.0, rel=1e-12)
    assert law_is_kept(path) < 1 + 1e-6


@pytest.mark.slow
def test_a_block_pressed_to_a_fifth_of_its_height():
    plate = tools.plane(1.0)
    path = fx.trace(scene([fx.Contact(face, plate, 0.2, direction=(0, -1)) for face in ("top", "rim")],
                          mesh=fx.mesh.disc(radius=1.0, thickness=1.0, elements=(10, 10)),
                          supports=[fx.Symmetry("bottom", normal="z")]), until=fx.travel(0.8))
    assert path["travel"][-1] == pytest.approx(0.8, rel=1e-12)
    assert law_is_kept(path) < 1 + 1e-6


@pytest.mark.thorough
def test_a_parison_is_blown_into_a_bottle_without_friction():
    """Past the edge under its neck, where contact leaves no next state; the volume has to grow with the pressure."""
    bottle = tools.bottle(radius=5.75, height=14.0, neck=2.2, shoulder=2.5, neck_height=1.5, base=-2.95, fillet=0.78,
                          shoulder_fillet=0.5)
    made = scene([fx.Contact("outer", bottle, "none")], [fx.Pressure("inner")],
                 fx.mesh.parison(inner_radius=2.0, thickness=0.184, length=18.0, elements=(40, 1)),
                 supports=[fx.Clamped("neck")])
    path = fx.trace(made, until=fx.pressure(1.28), step=fx.StepControl(target=8), progress=False)
    assert path.jumps and all(state.jump["dissipated"] >= 0 for state in path.jumps)
    body = path.profile().top
    assert body[:, 0].max() == pytest.approx(5.75, rel=1e-3) and body[:, 1].min() == pytest.approx(-2.95, rel=1e-3)


@pytest.mark.slow
def test_a_flat_rough_plug_is_withdrawn():
    made = plugs.scene(R, H, 5.0, 1.5, MATERIAL, "stick", (40, 1), name="plug")
    path = fx.Process(made).run([fx.Stage("push", control="plug", until=fx.travel(3.5)),
                                 fx.Stage("back", control="plug", until=fx.travel(0.0))])
    # within the ramp, where points that stick hold the sheet
    assert path["pole_height"][-1] == pytest.approx(0.0, abs=path.problem.contacts[0].law.theta)
    assert path["tool_force"][-1] == pytest.approx(0.0, abs=1e-8 * path["tool_force"].max())


@pytest.mark.slow
def test_an_undercut_cup_without_friction():
    """Elements as long as the fillets: with contact at the nodes other branches start there, at Gauss points none."""
    mould = tools.Tool([(0, 5.3), (8.5, 5.3), (8.5, 2.3), (7, 1.3), (7, H), (20, H)], [0, 0.8, 0.5, 0.5, 0.5, 0])

    def made(points):
        return scene([fx.Contact("top", mould, "none", points=points)], [fx.Pressure("bottom")])
    with pytest.raises(fx.ConvergenceError, match="became indefinite .* another path branches off there") as error:
        fx.trace(made("nodes"), until=fx.pressure(8.0), at_limit_point="stop")
    found = error.value.diagnosis
    assert found.turned and found.condition > 1e14 and any("points=4" in words for words in found.advice)
    with pytest.raises(fx.ConvergenceError, match="another path branches off there") as later:
        fx.trace(made("nodes"), until=fx.pressure(8.0))
    reached, at_branch = later.value.path["pressure"][-1], error.value.path["pressure"][-1]
    assert (reached > at_branch) == bool(later.value.path.jumps)     # round-off decides whether the body jumps there
    assert reached >= at_branch * (1 - 1e-9)
    path = fx.trace(made(4), until=fx.pressure(8.0))
    assert path["pressure"][-1] == pytest.approx(8.0, rel=1e-12) and path.profile().top[:, 1].max() > 5.29


def test_a_snap_through_of_a_block_has_no_wall_warning():
    """A block that rolled over: distances of opposite points mean nothing there, and were told as nan."""
    from types import SimpleNamespace

    from formingx.results.evaluate import snaps
    wall = iter((np.array([1.0, 1.0]), np.array([1.0, np.nan])))
    path = SimpleNamespace(states=[SimpleNamespace(kind=kind) for kind in ("start", "step", "jump")],
                           problem=SimpleNamespace(history=SimpleNamespace(path_dependent=True)),
                           profile=lambda state: SimpleNamespace(wall_ratio=next(wall), reference_radius=np.zeros(2)))
    assert snaps.findings(snaps.largest(path)) == []
