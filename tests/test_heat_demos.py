"""The demos of heat as a user runs them: every key, and how far it is off."""

import json

import pytest
from conftest import drawn, run

pytestmark = pytest.mark.thorough

TIMES = {"heating": {"convection": (5, 10, 20, 40, 80, 160), "two_sides": (5, 10, 20, 40, 80, 160),
                     "radiation_400_400": (10, 20, 40, 60, 80, 100), "radiation_450_350": (10, 20, 40, 60, 80, 100),
                     "absorbed": (10, 20, 40, 60, 80, 100)},
         "chilling": dict.fromkeys(("aluminium", "foam", "steel"), (0.05, 0.2, 1, 3, 10))}
PLACES = {"convection": ("mid", "quarter", "face", "mean"), "two_sides": ("0", "0.25", "0.5", "0.75", "1"),
          "radiation_400_400": ("top", "mid", "bottom"), "radiation_450_350": ("top", "mid", "bottom"),
          "absorbed": ("face", "mid"),
          **dict.fromkeys(("aluminium", "foam", "steel"), ("face", "mid", "top", "tool_face"))}


@pytest.mark.parametrize("demo, options, allowed", [
    ("chilling", ("--quick",), 1e-4),
    pytest.param("heating", ("--quick",), 1e-4, marks=pytest.mark.slow),
    pytest.param("chilling", (), 2e-5, marks=pytest.mark.slow),
    pytest.param("heating", (), 2e-5, marks=pytest.mark.slow),
])
def test_heat_demo_summaries_are_within_their_errors(demo, options, allowed, tmp_path):
    run(f"demos/{demo}.py", "--out", tmp_path, *options)
    found = json.loads((tmp_path / "summary.json").read_text())
    for case, times in TIMES[demo].items():
        for place in PLACES[case]:
            values = found[case][f"{place}_C_at_s"]
            assert list(values) == [f"{t:g}" for t in times] and all(isinstance(v, float) for v in values.values())
        assert found["largest_error_over_span"][case] < allowed
        assert (tmp_path / f"{case}.csv").stat().st_size > 2000
    assert len(list(tmp_path.glob("through_*.png"))) == 1


def test_cold_plug_quick(tmp_path):
    """A plug that chills leaves a thicker base than one that does not, and that a thicker one than no plug."""
    run("demos/cold_plug.py", "--out", tmp_path, "--quick")
    found = json.loads((tmp_path / "summary.json").read_text())
    hot, cold = (found["plugs"][name] for name in ("150_C_0_W_per_m2K", "30_C_1000_W_per_m2K"))
    for n in (hot, cold, found["beside"]["straight vacuum"]):
        assert "stopped" not in n and 0 < n["least"] <= n["corner"]
    assert cold["base"] > 1.5 * hot["base"] > 3 * found["beside"]["straight vacuum"]["base"]
    assert 60 < cold["base_C_at_plug"] < 75 < 140 < cold["base_C_on_top"] and abs(hot["base_C_at_plug"] - 150) < 1e-9
    assert drawn(tmp_path / "cold_plug.png")


@pytest.mark.slow
def test_cold_plug(tmp_path):
    """Compare its walls with the table of benchmarks/NOTES.md, and their order with docs/cold_plug.md."""
    run("demos/cold_plug.py", "--out", tmp_path)
    found = json.loads((tmp_path / "summary.json").read_text())
    plugs, bases = found["plugs"], {name: n["base"] for name, n in found["factors"].items()}
    assert plugs["150_C_1000_W_per_m2K"]["base"] == pytest.approx(plugs["150_C_0_W_per_m2K"]["base"], rel=1e-6)
    exact = {"none of the three": 0.055, "friction": 0.057, "chill": 0.148, "chill + friction": 0.115,
             "relaxation": 0.037, "relaxation + friction": 0.157, "relaxation + chill": 0.248,
             "relaxation + chill + friction": 0.258}
    assert bases == pytest.approx(exact, abs=2e-3)
    assert found["beside"]["straight vacuum"]["base"] == pytest.approx(0.054, abs=1e-3)
    order = [plugs[f"{name}_W_per_m2K"]["base"] for name in ("150_C_0", "100_C_200", "100_C_1000", "30_C_1000")]
    assert order == sorted(order)
    effects = found["effects"]
    assert effects["chill"]["base"] > effects["relaxation"]["base"] > effects["friction"]["base"] > 0
    assert len((tmp_path / "factors.csv").read_text().splitlines()) == 9
