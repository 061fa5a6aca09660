"""The studies of the thesis' chapters 3 and 4 as a user runs them, against exact values and refined ones.

Refined: 80 x 4 elements (60 x 4 for the plate), agreeing with 40 x 2 in the digits given.
"""

import pytest
from conftest import drawn, run
from test_demos import summary

pytestmark = pytest.mark.thorough


@pytest.mark.parametrize("demo", ["thick_cylinder", "thick_plate", "material_constants", "two_layer"])
def test_help_names_every_option(demo):
    text = run(f"demos/{demo}.py", "--help")
    for option in ("--elements", "--out", "--quick"):
        assert option in text


def pictures(folder, *names):
    for name in names:
        assert drawn(folder / f"{name}.png")


def test_thick_cylinder(tmp_path):
    found = summary("thick_cylinder", tmp_path, "--quick")
    cylinder, sphere = found["cylinder"], found["sphere"]
    # exact: p = 140 psi (ln(la/lb) + (lb^-2 - la^-2)/2), inner and outer stretches la and lb, 1 psi = 6894.757 Pa
    exact = {"10": 0.5446077, "20": 0.7485681, "30": 0.8398757, "40": 0.8847938, "50": 0.9084883}
    assert cylinder["exact_pressure_MPa_at_inner_displacement_cm"] == pytest.approx(exact, rel=1e-6)
    for numbers in (cylinder, sphere):
        assert numbers["pressure_MPa_at_inner_displacement_cm"] == pytest.approx(
            numbers["exact_pressure_MPa_at_inner_displacement_cm"], rel=1e-4)
        assert numbers["largest_relative_error_of_pressure"] < 1e-4
        order = numbers["observed_order"]
        assert order["displacement"] > 2.8 and order["pressure"] > 2.8 and order["stress"] > 1.8, order
        found = [e["effectivity"] for e in numbers["relative_errors_at_elements_through_wall"].values()]
        # 3, 6, 12 elements through the wall: 1.17, 1.06, 1.01 (cylinder), 4.2, 1.95, 1.14 (sphere)
        assert all(b < 1 + (a - 1) / 2 for a, b in zip(found, found[1:])) and 0.9 < found[2] < 1.2, found
    assert sphere["limit_pressure_MPa"] == pytest.approx(sphere["exact_limit_pressure_MPa"], rel=1e-5)
    assert sphere["exact_limit_pressure_MPa"] == pytest.approx(1.0633799, rel=1e-7)
    assert sphere["inner_displacement_cm_at_limit"] == pytest.approx(19.977, rel=1e-3)
    # the thesis: six elements differ from the exact hydrostatic pressure, twelve compare well
    miss = cylinder["hydrostatic_pressure_error"]
    assert miss["6 triangles"] > 0.02 and miss["12 triangles"] < 0.01
    assert cylinder["outer_radius_in_that_gives_1.26_MPa"] == pytest.approx(29.543, abs=1e-3)
    pictures(tmp_path, "cylinder", "sphere", "hydrostatic_pressure")


def test_thick_plate(tmp_path):
    found = summary("thick_plate", tmp_path, "--quick")
    simple, clamped = found["simply_supported"], found["clamped"]
    refined = {"1": 1.35418, "5": 2.47262, "10": 3.34725, "20": 4.94604, "30": 7.0931, "40.1": 11.23513}
    assert simple["pole_height_in_at_psi"] == pytest.approx(refined, rel=2e-4)
    # a clamped corner is singular: coarse grids are stiff there by up to 5 %
    refined = {"1": 1.2793, "5": 2.4352, "10": 3.3245, "20": 4.923, "30": 7.0278, "40.1": 11.06}
    assert clamped["pole_height_in_at_psi"] == pytest.approx(refined, rel=0.05)
    assert simple["slope_over_linear_theory"] == pytest.approx(1.0, abs=5e-3)
    assert clamped["slope_over_linear_theory"] == pytest.approx(1.0, abs=6e-2)
    # the thesis: Timoshenko's formula agrees to a pole height of about 2 cm (refined: to 4 %), then is much stiffer
    ratio = clamped["timoshenko_pressure_over_ours_at_pole_height_cm"]
    assert ratio["2"] == pytest.approx(1.0, abs=0.04) and ratio["5"] > 1.1 and ratio["10"] > 1.7
    assert clamped["pole_height_in_timoshenko"]["40.1"] == pytest.approx(4.62566, rel=1e-5)
    pictures(tmp_path, "loading_curve", "grid")


def test_material_constants(tmp_path):
    found = summary("material_constants", tmp_path, "--quick")
    refined = {"case1": (0.73695, 0.36751, 0.20035, 0.022739, 0.059320, 0.078730),
               "case2": (0.72547, 0.29720, 0.10885, 0.021336, 0.043824, 0.042961),
               "case3": (0.74511, 0.40454, 0.23666, 0.023743, 0.068834, 0.099408),
               "case4": (0.73434, 0.35415, 0.18635, 0.022418, 0.056059, 0.071653),
               "case5": (0.73305, 0.35389, 0.18631, 0.011249, 0.028030, 0.035826),
               "case6": (0.73413, 0.35411, 0.18634, 0.020935, 0.052322, 0.066876)}
    for name, values in refined.items():
        case = found[name]
        allowed = 1e-2 if name == "case2" else 1.2e-3          # past its maximum the pole thins fast
        assert list(case["pole_thickness_ratio_at_height"].values()) == pytest.approx(values[:3], rel=allowed)
        assert list(case["pressure_over_K_at_height"].values()) == pytest.approx(values[3:], rel=2e-4)
    A, B = found["A"], found["B"]
    assert A["pole_height_in"]["26"] is None and B["limit_pressure_psi"] is None
    assert [A["pole_height_in"][p] for p in ("15", "20")] == pytest.approx([4.29768, 5.39675], rel=1e-4)
    assert [B["pole_height_in"][p] for p in ("15", "20", "26")] == pytest.approx([4.13011, 4.94603, 6.10484], rel=1e-4)
    assert A["limit_pressure_psi"] == pytest.approx(25.0649, rel=1e-4)
    assert A["membrane_limit_pressure_psi"] == pytest.approx(25.0556, rel=1e-5)
    assert A["pole_height_in_at_25_psi"]["rising"] < 9 < A["pole_height_in_at_25_psi"]["falling"]
    findings = found["findings"]
    # greatest sensitivity to the I2 constant; thinner sheet, more uneven at the same load; same stiffness at first
    by_c01, by_c10 = (findings[f"thickness_ratio_change_per_psi_of_{c}"] for c in ("c01", "c10"))
    assert by_c01 > 5 * abs(by_c10)
    uneven = findings["unevenness_at_10_psi"]
    assert uneven["case5"]["rim_over_pole_thickness"] > 1.25 > 1.15 > uneven["case4"]["rim_over_pole_thickness"]
    assert findings["A_over_B_initial_pole_height"] == pytest.approx(1, abs=2e-3)
    assert findings["A_over_B_pole_height_at_15_psi"] == pytest.approx(1.0406, abs=1e-3)
    pressure, thickness = (found["lai_holt_relaxing"][f"{name}_over_elastic_at_height"]
                           for name in ("pressure", "pole_thickness"))
    ratios = [pressure[h] for h in ("0.5", "1.0", "1.5")]      # strain put on lately has relaxed less than t^-0.05
    assert ratios == sorted(ratios, reverse=True) and all(r > (6 * k / 3) ** -0.05 for k, r in enumerate(ratios, 1))
    assert ratios[0] == pytest.approx(1.0452, abs=5e-3) and ratios[1] == pytest.approx(1.003, abs=5e-3)
    assert 1 < thickness["0.5"] < thickness["1.0"] < 1.02      # the pole strains fastest: it is stiffer
    pictures(tmp_path, "cases", "lai_holt", "plates")


REFINED = {"case1": (12.87699, 0.185316, 0.45103, 0.7199), "case2": (16.4317, 0.139279, 0.43749, 0.7273),
           "case3": (10.9982, 0.238490, 0.45864, 0.7223)}


def check_two_layer(found):
    for name, (height, pressure, pole, rim) in REFINED.items():
        case = found[name]
        assert case["pole_height_cm_at_0.142MPa"] == pytest.approx(height, rel=2e-4)
        assert case["pressure_MPa"] == pytest.approx(pressure, rel=3e-4)
        assert case["pole_thickness_ratio"] == pytest.approx(pole, rel=5e-4)
        assert case["rim_thickness_ratio"] == pytest.approx(rim, rel=1.5e-2)
    spread = {name: found[name]["at_0.142MPa"]["rim_over_pole_thickness"] for name in REFINED}
    assert spread["case3"] < 1.25 < spread["case1"] < 1.4 < spread["case2"]             # the stiffer one varies least
    for name in [name for name in found if name in REFINED or name == "stack"]:
        for interface in found[name]["interfaces_at_half_radius_MPa"]:
            below, above = interface["below"], interface["above"]
            assert below["normal"] == pytest.approx(above["normal"], abs=0.02 * found[name]["pressure_MPa"])
            if name != "case1":
                assert abs(below["hydrostatic_pressure"] - above["hydrostatic_pressure"]) > 0.5


def test_two_layer_and_a_stack_of_four(tmp_path):
    found = summary("two_layer", tmp_path, "--quick", "--stack", 1, 2, 3, 2)
    check_two_layer(found)
    assert len(found["stack"]["interfaces_at_half_radius_MPa"]) == 3
    pictures(tmp_path, "loading_curve", "interface", "profiles_and_thickness")


def test_two_layer_on_two_ranks(tmp_path):
    check_two_layer(summary("two_layer", tmp_path, "--quick", ranks=2))
