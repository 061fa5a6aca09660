"""Tests as machines write them become a card; the files in `tests/reference` were computed for formingx."""

from pathlib import Path

import numpy as np
import pytest

import formingx as fx

FOLDER = Path(__file__).parent / "reference"
TENSILE, CROSSHEAD, RATES = (FOLDER / name for name in ("tensile_cp1252.csv", "crosshead_utf16.txt",
                                                       "rates_and_temperatures.csv"))


def test_title_decimal_commas_and_strain_in_percent():
    found = fx.fit(fx.MooneyRivlin, TENSILE, test="uniaxial")
    assert found.material.parameters == pytest.approx({"c10": 0.2, "c01": 0.05}, rel=1e-4)
    assert "stretch = 1 + strain/100" in str(found) and found.conversions[0].startswith(str(TENSILE))


def test_force_and_displacement_of_a_specimen_in_utf16():
    size = {"length": 25.0, "width": 4.0, "thickness": 2.0}
    found = fx.fit(fx.NeoHookean, CROSSHEAD, test="uniaxial", specimen=size)
    assert found.constants["c10"] == pytest.approx(0.3, rel=1e-5)
    assert "force/8" in str(found) and "displacement/25" in str(found)
    with pytest.raises(fx.InputError, match="fit: specimen 'breadth' is not known"):
        fx.fit(fx.NeoHookean, CROSSHEAD, test="uniaxial", specimen={"breadth": 1.0})


def test_several_files_at_several_temperatures_give_constants_by_temperature(tmp_path):
    """c10 falls from 0.4 to 0.1; between the temperatures it is a smooth curve."""
    files, l = [], np.linspace(1.1, 2.0, 8)
    for T, c10 in ((120.0, 0.4), (130.0, 0.2), (140.0, 0.1)):
        files.append(tmp_path / f"{T:g}.csv")
        files[-1].write_text("strain;stress\n" + "\n".join(
            f"{x - 1};{2 * c10 * (x - x**-2)}" for x in l))
    found = fx.fit(fx.NeoHookean, files, test="uniaxial", temperature=[120.0, 130.0, 140.0])
    curve = found.material.parameters["c10"]
    assert curve(np.array([120.0, 130.0, 140.0])) == pytest.approx([0.4, 0.2, 0.1], rel=1e-8)
    assert found.constants["c10 at 130"] == pytest.approx(0.2) and found.errors["c10 at 130"] < 1e-6
    with pytest.raises(fx.InputError, match="2 for 3 tests"):
        fx.fit(fx.NeoHookean, files, test="uniaxial", temperature=[120.0, 130.0])
    with pytest.raises(fx.InputError, match="exponent cannot depend on the temperature"):
        fx.fit(fx.Ogden, files, terms=1, test="uniaxial", temperature=[120.0, 130.0, 140.0])


def test_a_column_of_temperature_is_not_pooled(tmp_path):
    """Tests at 120 and 140 C in one file are not one card, but a curve."""
    l = np.linspace(1.1, 2.0, 8)
    (tmp_path / "both.csv").write_text("test,stretch,stress,temperature [C]\n" + "\n".join(
        f"uniaxial,{x},{2 * c10 * (x - x**-2)},{T}" for T, c10 in ((120, 0.4), (140, 0.1)) for x in l))
    found = fx.fit(fx.NeoHookean, tmp_path / "both.csv")
    assert max(found.deviations.values()) < 1e-6 and set(found.constants) == {"c10 at 120", "c10 at 140"}


@pytest.mark.parametrize("shift, count", [("WLF", 2), pytest.param("table", 2, marks=pytest.mark.thorough)])
def test_rates_and_temperatures_give_the_shift_and_the_constants(shift, count):
    """Six tensile tests: relaxation times at 130 C and their shift, with the errors of both."""
    found = fx.fit(fx.Viscoelastic, RATES, terms=2, reference=130.0, shift=shift)
    true = fx.WLF(6.0, 90.0, 130.0)
    at = np.array([120.0, 130.0, 145.0])
    assert found.shift(at) == pytest.approx(true(at), rel=0.02)
    card = found.material.at_temperature(145.0)
    exact = fx.Viscoelastic(fx.NeoHookean(c10=0.05), [(0.4, 0.5), (0.2, 8.0)], shift=true).at_temperature(145.0)
    l = np.array([1.3, 1.8, 2.2])
    assert card.constant_rate("uniaxial", 0.3, l) == pytest.approx(exact.constant_rate("uniaxial", 0.3, l), rel=0.01)
    assert max(found.deviations.values()) < 0.01 and "nominal stress = true stress / stretch" in str(found)
    assert len(found.errors) == 5 + count and all(np.isfinite(list(found.errors.values())))
    assert sum(found.shares["tau_1"].values()) == pytest.approx(1.0)
    assert len(found.plot().lines) >= 6


CARD = fx.Viscoelastic(fx.NeoHookean(c10=0.05), [(0.4, 0.5), (0.2, 8.0)])


def moduli(hertz, shift=1.0, factor=1.0):
    x = 2 * np.pi * hertz[:, None] * shift * np.array([0.5, 8.0])
    return factor * (0.1 + x**2 / (1 + x**2) @ [0.4, 0.2]), factor * (x / (1 + x**2) @ [0.4, 0.2])


def test_oscillations_of_a_machine_beside_a_tensile_file(tmp_path):
    """G' and G'' over the frequency in Hz at three temperatures, with tan delta, beside a tensile test in time."""
    hertz, law = np.geomspace(1e-3, 10, 9), fx.WLF(6.0, 90.0, 130.0)
    lines = ["frequency sweep", "Frequenz [Hz];G\u2032 [MPa];G\u2032\u2032 [MPa];tan delta;Temperatur [°C]"]
    for T in (120.0, 130.0, 145.0):
        lines += [f"{f:.9g};{G1:.9g};{G2:.9g};{G2 / G1:.4g};{T:g}".replace(".", ",")
                  for f, G1, G2 in zip(hertz, *moduli(hertz, law(T)))]
    (tmp_path / "sweep.txt").write_text("\n".join(lines), encoding="utf-16")
    l = np.linspace(1.1, 2.0, 6)
    (tmp_path / "tensile.csv").write_text("test,stretch,stress [MPa],time,temperature\n" + "\n".join(
        f"uniaxial,{x},{P},{np.log(x)},130" for x, P in zip(l, CARD.constant_rate("uniaxial", 1.0, l))).replace(
            "uniaxial,1.1", "uniaxial,1,,0,130\nuniaxial,1.1", 1))
    found = fx.fit(fx.Viscoelastic, [tmp_path / "sweep.txt", tmp_path / "tensile.csv"], terms=2, reference=130.0)
    assert found.shift(120.0) == pytest.approx(law(120.0), rel=1e-2)
    assert found.constants["mu_1"] == pytest.approx(0.4, rel=1e-2) and "2 pi frequency" in str(found)
    assert len(found.rms) == 4 and "tan delta is not used" in str(found)


@pytest.mark.parametrize("head, arguments, message", [
    ("frequency,storage modulus,loss modulus", {}, "shear or tension"),
    ("frequency,G',G''", {"test": "uniaxial"}, "say the mode of the test"),
    ("frequency,G',E''", {}, "must be one pair"),
    ("time,G',G''", {}, "column 'time'"),
    ("frequency [s],G',G''", {}, "'frequency' is in 's': must be in one of Hz")])
def test_unclear_files_of_oscillations(tmp_path, head, arguments, message):
    (tmp_path / "sweep.csv").write_text(head + "\n1,2,3\n2,3,3\n")
    with pytest.raises(fx.InputError, match=message):
        fx.fit(fx.Viscoelastic, tmp_path / "sweep.csv", **arguments)


def test_files_in_several_units_of_stress(tmp_path):
    (tmp_path / "sweep.csv").write_text("frequency,G' [Pa],G'' [Pa]\n1,2,3\n2,3,3\n")
    (tmp_path / "tensile.csv").write_text("test,stretch,stress [MPa],time\nuniaxial,1,,0\nuniaxial,1.1,1,1\n")
    with pytest.raises(fx.InputError, match="several units: Pa in .*sweep.csv, MPa in .*tensile.csv: convert"):
        fx.fit(fx.Viscoelastic, [tmp_path / "sweep.csv", tmp_path / "tensile.csv"])
