"""Demos of design and optimisation, as a user runs them."""

import pytest
from conftest import drawn
from test_demos import summary

pytestmark = pytest.mark.thorough


def test_gradients_quick(tmp_path):
    found = summary("gradients", tmp_path, "--quick")
    assert found["C_R2"]["membrane"]["w_0.8"]["dp"] == pytest.approx(0.84934, abs=2e-4)
    assert found["h0_R2"]["solid"]["w_0.8"]["dpole"] == pytest.approx(-0.1279, abs=1e-3)
    for R, d in found["cup"].items():
        assert d == pytest.approx(found["cup_by_differences"][R], abs=0.01)
    assert drawn(tmp_path / "cup.png")


@pytest.mark.slow
def test_gradients(tmp_path):
    """Derivatives of membrane and solid agree, and agree with differences of runs."""
    found = summary("gradients", tmp_path)
    for kind in ("C_R2", "C_R4", "h0_R2"):
        for w in ("w_0.8", "w_1"):
            thin, thick = (found[kind][model][w] for model in ("membrane", "solid"))
            assert thick["dp"] == pytest.approx(thin["dp"], abs=1e-4)
            assert thick["dpole"] == pytest.approx(thin["dpole"], abs=1e-4)
            assert thick["dhalf"] == pytest.approx(thin["dhalf"], abs=1e-4)
    for sheet in found["pot"].values():
        for both in sheet.values():
            for R, d in both["exact"].items():
                assert d == pytest.approx(both["by_differences"][R], abs=3e-3)


def test_even_disc_quick(tmp_path):
    """For an even wall at a stretch l of the pole, the initial thickness there is l^2 times the wall."""
    found = summary("even_disc", tmp_path, "--quick")
    for model in ("membrane", "solid"):
        one = found["thickness"][model]["1.25"]
        assert one["spread"] < 2.5e-3 and one["paths"] <= 5  # 14 elements; with 80 it is below 1e-3, see below
        assert one["h0_over_h"]["0"] == pytest.approx(1.25**2, rel=1e-3)
        assert one["h0_over_h"]["0.5"] == pytest.approx(1.4872, rel=1e-3)
        assert found["constant"][model]["0.7"]["C_over_C0"]["0.5"] == pytest.approx(0.8526, rel=3e-3)
    assert drawn(tmp_path / "even_disc.png")


@pytest.mark.slow
def test_even_disc(tmp_path):
    found = summary("even_disc", tmp_path)
    for part, profile in (("thickness", "h0_over_h"), ("constant", "C_over_C0")):
        for case, thin in found[part]["membrane"].items():
            thick = found[part]["solid"][case]
            assert thin["spread"] < 1e-3 and thick["spread"] < 1e-3
            assert thin["paths"] <= 6 and thick["paths"] <= 6
            for R, value in thin[profile].items():
                assert thick[profile][R] == pytest.approx(value, rel=2e-3)


def test_even_trough_quick(tmp_path):
    found = summary("even_trough", tmp_path, "--quick")
    assert found["h0"]["cv_after"] < 0.5 * found["h0"]["cv_before"]
    assert list(found["C_over_C_rim"]) == ["half_wall", "mouth"]
    assert drawn(tmp_path / "even_trough.png")


def test_even_bottle_quick(tmp_path):
    found = summary("even_bottle", tmp_path, "--quick")
    assert found["cv_after"] < 0.5 * found["cv_before"] and found["paths"] <= 2
    assert drawn(tmp_path / "even_bottle.png")


@pytest.mark.slow
def test_even_bottle(tmp_path):
    found = summary("even_bottle", tmp_path)
    assert found["cv_before"] == pytest.approx(0.389, abs=5e-3)
    assert found["cv_after"] < 0.04 and found["paths"] <= 6
    assert found["volume_after"] <= found["volume_before"] and found["least_wall_after"] > 0.095


@pytest.mark.slow
def test_even_pot(tmp_path):
    found = summary("even_pot", tmp_path)
    assert found["cv_after"] < found["cv_before"] and drawn(tmp_path / "even_pot.png")
