"""Fits: constants recovered from made-up tests, Treloar's rubber against independent fits, bad input."""

import json

import numpy as np
import pytest
from conftest import drawn, run

import formingx as fx
from formingx.materials.homogeneous import MODES


def measured(material, reach=4.0, modes=tuple(MODES), noise=0.0):
    """Return tests of a material, with its exact stresses times a relative noise."""
    rng = np.random.default_rng(5)
    l = {mode: np.linspace(0.7, min(reach, 0.93 * material.largest_stretch(mode)), 25) for mode in modes}
    return {m: (x, material.stress(m, x) * (1 + noise * rng.standard_normal(25))) for m, x in l.items()}


@pytest.mark.parametrize("material", [
    fx.NeoHookean(c10=0.3),
    fx.MooneyRivlin(c10=0.3, c01=0.05),
    fx.Yeoh(c10=0.3, c20=-2e-3, c30=5e-5),
    fx.Gent(mu=0.3, Jm=30.0),
    fx.ArrudaBoyce(mu=0.3, N=9.0),
    fx.Ogden(mu=0.4, alpha=1.6),
    fx.Ogden(mu=(0.4, -0.02), alpha=(1.6, -3.0)),
], ids=lambda m: f"{type(m).__name__}{len(m.parameters)}")
@pytest.mark.parametrize("unit", [1.0, 1e6], ids=["MPa", "Pa"])
def test_constants_are_recovered(material, unit):
    data = {mode: (l, unit * P) for mode, (l, P) in measured(material).items()}
    terms = {"terms": len(material.parameters) // 2} if isinstance(material, fx.Ogden) else {}
    found = fx.fit(type(material), data, **terms)
    largest = unit * max(np.abs(P).max() for _, P in measured(material).values())
    assert found.rms_total < 1e-7 * largest and set(found.rms) == set(MODES)

    def ordered(m, unit=1.0):
        values = m.parameters
        if isinstance(m, fx.Ogden):
            n = len(values) // 2
            return np.array(sorted((values[f"alpha{k}"], values[f"mu{k}"] / unit) for k in range(1, n + 1))).ravel()
        return np.array([v if k in ("Jm", "N") else v / unit for k, v in values.items()])
    assert ordered(found.material, unit) == pytest.approx(ordered(material), rel=1e-4)


def test_constants_of_a_user_defined_energy_are_recovered():
    def energy(I1, I2, a, b):
        return a * (I1 - 3) + b * (I2 - 3)
    found = fx.fit(fx.Hyperelastic(energy, a=1.0, b=1.0), measured(fx.MooneyRivlin(c10=0.3, c01=0.05)))
    assert isinstance(found.material, fx.Hyperelastic)
    assert found.material.parameters == pytest.approx({"a": 0.3, "b": 0.05}, rel=1e-6)


def test_residuals_are_those_of_the_data():
    data = measured(fx.Gent(mu=0.3, Jm=50.0), modes=("uniaxial", "equibiaxial"), noise=0.02)
    found = fx.fit(fx.MooneyRivlin, data, relative=False)
    misfit = {mode: found.material.stress(mode, l) - P for mode, (l, P) in data.items()}
    assert found.rms == pytest.approx({mode: np.sqrt(np.mean(x**2)) for mode, x in misfit.items()})
    assert found.rms_total == pytest.approx(np.sqrt(np.mean(np.concatenate(list(misfit.values())) ** 2)))
    assert "MooneyRivlin(" in str(found) and "equibiaxial" in str(found)
    # the least of its neighbourhood
    for change in (0.999, 1.001):
        c10, c01 = found.material.parameters.values()
        other = fx.MooneyRivlin(c10=c10 * change, c01=c01)
        assert np.mean(np.concatenate([other.stress(m, l) - P for m, (l, P) in data.items()]) ** 2) \
            > found.rms_total**2


@pytest.mark.parametrize("model", [fx.MooneyRivlin, fx.Yeoh, fx.Gent, fx.ArrudaBoyce])
def test_result_is_admissible_where_the_best_is_not(model):
    """Constants fitted to tests that soften are admissible."""
    soft = fx.Hyperelastic(lambda I1, I2, a, b: a * (I1 - 3) - b * (I1 - 3) ** 2, a=1.0, b=0.01)
    found = fx.fit(model, measured(soft, reach=3.0))
    assert found.material.check_stability((0.7, 3.0)).stable
    best = fx.fit(fx.NeoHookean, measured(soft, reach=3.0)).rms_total
    assert found.rms_total == pytest.approx(best, rel=1e-3) or model is fx.Yeoh and found.rms_total < best / 2


def test_treloar():
    """Absolute fits to all tests of Treloar agree with fits that were made independently."""
    data = fx.treloar1944()
    assert [len(l) for l, _ in data.values()] == [24, 13, 16]
    assert fx.fit(fx.NeoHookean, data, relative=False).rms_total == pytest.approx(0.63, abs=5e-3)
    gent = fx.fit(fx.Gent, data, relative=False)
    assert gent.rms_total == pytest.approx(0.138, abs=5e-4)
    assert gent.material.parameters == pytest.approx({"mu": 0.2745, "Jm": 84.3}, rel=2e-4)
    yeoh = fx.fit(fx.Yeoh, data, relative=False)
    assert yeoh.rms_total == pytest.approx(0.138, abs=5e-4)
    assert yeoh.material.parameters == pytest.approx({"c10": 0.1847, "c20": -1.465e-3, "c30": 4.02e-5}, rel=1e-3)
    for l, P in data.values():
        l[:], P[:] = 0, 0
    assert fx.treloar1944()["uniaxial"][1][-1] == 6.3176        # a caller cannot spoil it


@pytest.mark.thorough
def test_ogden_on_treloar():
    """Three terms fit better than the constants of Ogden (1972); a fit that starts from these finds no better ones."""
    data = fx.treloar1944()
    classic = fx.Ogden(mu=(0.63, 0.0012, -0.01), alpha=(1.3, 5.0, -2.0))
    misfit = np.concatenate([classic.stress(mode, l) - P for mode, (l, P) in data.items()])
    found = fx.fit(fx.Ogden, data, relative=False)
    assert found.rms_total < 0.065 < np.sqrt(np.mean(misfit**2))
    assert fx.fit(classic, data, relative=False).rms_total > 0.999 * found.rms_total
    assert found.material.check_stability((0.5, 7.6)).stable


@pytest.mark.parametrize("relative", [False, True])
def test_standard_errors_are_the_scatter_of_the_fits(relative):
    """In 60 fits to the same tests with other noise a constant scatters by its standard error, and 95 % of the
    intervals contain the true constant. The covariance is that of linear least squares."""
    true, l = fx.MooneyRivlin(c10=0.3, c01=0.05), np.linspace(1.1 if relative else 0.7, 3.0, 30)     # stress not 0
    noise = 0.01 * np.random.default_rng(1).standard_normal((60, 2, len(l)))

    def noisy(mode, x):
        P = true.stress(mode, l)
        return l, P * (1 + x) if relative else P + x
    fits = [fx.fit(true, {m: noisy(m, x) for m, x in zip(("uniaxial", "equibiaxial"), each)}, relative=relative)
            for each in noise]
    for name, value in true.parameters.items():
        found = np.array([f.material.parameters[name] for f in fits])
        assert np.mean([f.errors[name] for f in fits]) == pytest.approx(found.std(), rel=0.25)      # 60 are few
        inside = [low < value < high for low, high in (f.intervals()[name] for f in fits)]
        assert 0.88 <= np.mean(inside) <= 1
    # the stresses are linear in the constants: the covariance by hand
    data = {m: noisy(m, x) for m, x in zip(("uniaxial", "equibiaxial"), noise[0])}
    stress = np.concatenate([P for _, P in data.values()])
    sizes = np.abs(stress) if relative else np.full(60, np.abs(stress).max())
    J = np.stack([np.concatenate([fx.MooneyRivlin(c10=a, c01=b).stress(m, l) for m in data])
                  for a, b in ((1.0, 1e-12), (1e-12, 1.0))], axis=1) / sizes[:, None]
    left = J @ list(fits[0].constants.values()) - stress / sizes
    assert fits[0].covariance == pytest.approx(left @ left / 58 * np.linalg.inv(J.T @ J), rel=1e-5)
    assert fits[0].undetermined == () and fits[0].points == 60
    low, high = fits[0].intervals()["c10"]
    assert (high - low) / 2 == pytest.approx(2.001717 * fits[0].errors["c10"])      # t of 58 degrees of freedom, 95 %
    with pytest.raises(fx.InputError, match="intervals: confidence = 1: must be between 0 and 1"):
        fits[0].intervals(1)


@pytest.mark.thorough
def test_undetermined_constants_are_named():
    """Undetermined are a limit beyond the tests, an unnecessary second term, and a constant of I2 at small strain."""
    neo_hookean = measured(fx.NeoHookean(c10=0.3), reach=2.0)
    gent = fx.fit(fx.Gent, neo_hookean)
    assert gent.undetermined == ("Jm",) and "do not determine Jm" in str(gent)
    assert {"mu1", "mu2"} & set(fx.fit(fx.Ogden, neo_hookean, terms=2).undetermined)
    small = np.linspace(0.98, 1.02, 9)
    rubber = fx.MooneyRivlin(c10=0.3, c01=0.05)
    assert "c01" in fx.fit(fx.MooneyRivlin, {"uniaxial": (small, rubber.stress("uniaxial", small))}).undetermined
    assert fx.fit(fx.MooneyRivlin, measured(rubber)).undetermined == ()
    assert fx.fit(fx.Gent, fx.treloar1944()).undetermined == ()


def test_file_and_picture(tmp_path):
    data, file = fx.treloar1944(), tmp_path / "treloar.csv"
    rows = [f"{mode}, {x!r}, {y!r}" for mode, (l, P) in data.items() for x, y in zip(l.tolist(), P.tolist())]
    file.write_text("# Treloar (1944)\ntest, stretch, stress (MPa)\n" + "\n".join(rows) + "\n")
    found = fx.fit(fx.Gent, file)
    assert found.material.parameters == fx.fit(fx.Gent, data).material.parameters
    axes = found.plot(unit="MPa")
    assert len(axes.lines) == 6 and axes.get_ylabel() == "nominal stress (MPa)"
    assert axes.lines[0].get_xdata() == pytest.approx(data["uniaxial"][0])


@pytest.mark.parametrize("text", [
    "test,stress,stretch\nuniaxial,{P},{l}\n", "\ufefftest,stretch,stress [MPa]\nuniaxial,{l},{P}\n",
    "stretch\tspecimen\tNominal_stress (MPa)\tmode\n{l}\tno. 1\t{P}\tuniaxial\n", "uniaxial,{l},{P}\n",
    "# a remark, 1\ntest;stress;stretch\nuniaxial;{P:,};{l:,}\n", '"uniaxial","{l:,}","{P:,}"\n'])
def test_columns_go_by_their_names(tmp_path, text):
    """Columns in any order, tabs, a byte order mark and decimal commas give the same constant."""
    l = [1.25, 1.5, 2.0]
    P = [round(2 * 0.5 * (x - x**-2), 6) for x in l]
    head, row = ("\n".join(text.split("\n")[:-2]), text.split("\n")[-2])
    def show(x, comma):
        return repr(x).replace(".", ",") if comma else repr(x)
    rows = [row.replace(":,", "").format(l=show(x, ":," in row), P=show(y, ":," in row)) for x, y in zip(l, P)]
    (tmp_path / "t.csv").write_text("\n".join([*[head] * bool(head), *rows]) + "\n", encoding="utf-8")
    assert fx.fit(fx.NeoHookean, tmp_path / "t.csv").material.parameters["c10"] == pytest.approx(0.5, rel=1e-5)


@pytest.mark.parametrize("text, words", [
    ("", "has no rows"), ("test,stretch,stress\n", "has no rows"),
    ("uniaxial,1.5\n", "line 1: has 2 columns"),
    ("uniaxial,1.5,0.2\nuniaxial,2.0\n", "line 2: has 2 columns"),
    ("uniaxial;1,5;0.2\n", "'1,5' in line 1 has a decimal comma, '0.2' in line 1 a point"),
    ("uniaxial,1_5,0.2\n", "line 1: '1_5': must be a number"),
    ("test,width,stress\nuniaxial,0.5,0.2\n", "no 'stretch'; must be test, stretch"),
    ("test,stretch,work\nuniaxial,1.5,0.2\n", "no 'stress'; must be"),
    ("test,stretch,strain,stress\nuniaxial,1.5,0.5,0.2\n", "names both 'stretch' and 'strain'"),
    ("test,stretch,stress,rate\nuniaxial,1.5,0.2,1\n", "a column 'rate', which a fit does not use"),
    ("test,stretch,stress,humidity\nuniaxial,1.5,0.2,50\n", "a column 'humidity', which a fit does not use"),
    ("strain [%];stress [MPa]\n50;0.2\n", "no 'test'; .* give fit\\(..., test='uniaxial'\\)"),
    ("test,displacement [mm],stress\nuniaxial,5,0.2\n", "has a displacement: give fit"),
    ("test,stretch,force [N]\nuniaxial,1.5,0.2\n", "has a force: give fit"),
    ("test,stretch [%],stress\nuniaxial,1.5,0.2\n", "column 'stretch' is in '%': must be without a unit"),
    ("test,stretch,stress [N]\nuniaxial,1.5,0.2\n", "column 'stress' is in 'N': must be in one of Pa"),
    ("test,stretch,stress,stress (MPa)\nuniaxial,1.5,0.2,1\n", "two columns 'stress'"),
    ('uniaxial,1.5,"0.2\nuniaxial,2.0,0.3\n', "line 2: unexpected end of data"),
    ("uniaxial," + 200_000 * "1" + ",1\n", "field larger than field limit"),
    ("test,stretch,stress\nbiaxial,1.5,0.2\n", "line 2: test 'biaxial' is not known"),
    ("uniaxial,1.5,\n", "line 1: '': must be a number"),
])
def test_bad_file(tmp_path, text, words):
    (tmp_path / "t.csv").write_text(text)
    with pytest.raises(fx.InputError, match=words):
        fx.fit(fx.NeoHookean, str(tmp_path / "t.csv"))


def test_no_file(tmp_path):
    with pytest.raises(fx.InputError, match="is not there"):
        fx.fit(fx.NeoHookean, tmp_path / "none.csv")
    with pytest.raises(fx.InputError, match="needs a fourth column"):
        (tmp_path / "t.csv").write_text("uniaxial,1.5,0.2\n")
        fx.fit(fx.Viscoelastic, tmp_path / "t.csv")


@pytest.mark.thorough
def test_demo(tmp_path):
    printed = run("demos/fit_treloar.py", "--quick", "--out", tmp_path)
    summary = json.loads((tmp_path / "summary.json").read_text())
    assert summary["fits"]["Gent"]["rms_MPa"] == pytest.approx(0.138, abs=5e-4)
    assert summary["points"] == {"uniaxial": 24, "pure_shear": 13, "equibiaxial": 16}
    assert drawn(tmp_path / "fit_treloar.png") and "Gent-Gent" in printed
