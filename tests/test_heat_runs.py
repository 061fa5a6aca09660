"""Arguments and results of `fx.heat`: starts, units, ranks, windows, files, pictures, errors."""

import numpy as np
import pytest
from conftest import run_json
from test_heat import SHEET, D, strip

import formingx as fx

SIDES = [fx.Convection("bottom", h=60, air=220), fx.Convection("top", h=10, air=80)]


def sides(**options):
    return fx.heat(strip(6), SHEET, SIDES, **({"start": 25.0, "times": [5.0, 20.0], "unit": "C"} | options))


@pytest.fixture(scope="module")
def heated():
    return sides()


def test_times_of_output_are_hit_and_between_steps_the_temperature_is_smooth(heated):
    assert all(t in heated.times for t in (0.0, 5.0, 20.0)) and heated.times[-1] == 20.0
    assert heated.errors.max() <= 1e-3
    point, t = [(0.0, D / 2)], 11.3
    exact = sides(times=[t, 20.0]).at_points(point)[0]
    assert heated.at_points(point, t)[0] == pytest.approx(exact, abs=5e-3)
    assert heated.at_points(point, [0.0])[0] == pytest.approx(25.0, abs=1e-12)


def test_hottest_coldest_and_when_the_sheet_is_in_a_window(heated):
    hot, cold = heated.hottest(), heated.coldest()
    assert abs(hot.Z) < 1e-9 and cold.Z > D / 2
    distance, T = heated.line_profile([20.0])
    assert T.max() == pytest.approx(hot.temperature, abs=1e-9) and distance[-1] == pytest.approx(D)
    assert T.min() >= cold.temperature - 0.05
    window = heated.time_to_reach(30.0, 90.0)
    assert heated.coldest(window.reached).temperature == pytest.approx(30.0, abs=1e-6)
    assert heated.hottest(window.left).temperature == pytest.approx(90.0, abs=1e-6)
    assert heated.time_to_reach(150.0, 160.0) == (None, None)
    assert heated.time_to_reach(20.0, 300.0) == (0.0, None)


def test_initial_temperatures_given_in_all_ways_agree(heated, tmp_path):
    """A number, a function, a table, a file, a run and a Function: the same temperatures where they say the same."""
    heated.field_to_csv(tmp_path / "start.csv")
    (tmp_path / "line.csv").write_text("Z,T\n0,20\n0.003,80\n")
    places = [(0.0, D * x) for x in (0, 0.31, 1)]
    begin = {name: sides(start=start, times=[1e-3]).at_points(places, [0.0])[0] for name, start in {
        "run": heated, "function": heated.temperature(), "file": tmp_path / "start.csv",
        "line": tmp_path / "line.csv", "of Z": lambda R, Z: 20 + 60 * Z / D}.items()}
    end = heated.at_points(places)[-1]
    assert begin["run"][[0, 2]] == pytest.approx(end[[0, 2]], abs=1e-9)
    assert np.array_equal(begin["run"], begin["function"])
    assert begin["run"] == pytest.approx(end, abs=2e-3)               # quadratic between nodes, which are others
    assert begin["file"] == pytest.approx(end, abs=0.2)               # linear between nodes
    assert begin["line"] == pytest.approx(begin["of Z"], abs=1e-9)
    table = fx.table({0.0: 100.0, 1.0: 50.0})
    assert sides(start=table, times=[1e-3]).at_points(places, [0.0])[0] == pytest.approx(100.0, abs=1e-2)
    cooled = fx.heat(strip(6), SHEET, [], start=heated, times=30.0, unit="C")      # no law: nothing gets out
    assert cooled.heat_stored.sum() == pytest.approx(0.0, abs=1e-9 * heated.heat_stored.sum())
    assert np.ptp(cooled.line_profile()[1]) < np.ptp(heated.line_profile()[1][-1]) / 3


@pytest.mark.thorough
def test_celsius_and_kelvin_are_the_same_run():
    """So is a run in millimetres."""
    found = {}
    for unit, zero, mm in (("C", 0.0, 1.0), ("K", 273.15, 1.0), ("mm", 0.0, 1e3)):
        mesh = fx.mesh.disc(radius=0.05 * D * mm, thickness=D * mm, elements=(1, 4))
        sheet = fx.ThermalProperties(conductivity=0.17 / mm, density=1050 / mm**3, heat_capacity=1800.0)
        laws = [fx.Radiation("top", emissivity=0.85, heater=400 + zero, stefan_boltzmann=5.670374419e-8 / mm**2),
                fx.ContactWithTool("bottom", conductance=50 / mm**2, tool=60 + zero)]
        run = fx.heat(mesh, sheet, laws, start=25.0 + zero, times=[4.0], unit="K" if unit == "K" else "C")
        found[unit] = run.line_profile(points=9)[1][0] - zero
        assert np.abs(run.balance).max() < 1e-10
    assert found["K"] == pytest.approx(found["C"], rel=1e-7)
    assert found["mm"] == pytest.approx(found["C"], rel=1e-7)


def test_files_and_picture(heated, tmp_path):
    heated.to_csv(tmp_path / "steps.csv")
    rows = (tmp_path / "steps.csv").read_text().splitlines()
    assert rows[0].startswith("time,estimated_error [C],coldest [C],hottest [C],heat_stored,heat of Convection")
    assert len(rows) == len(heated.times) + 1
    assert float(rows[-1].split(",")[3]) == heated.hottest().temperature
    axes = heated.plot_line_profile()
    assert [line.get_label() for line in axes.lines] == ["t = 5", "t = 20"]
    assert axes.lines[1].get_ydata()[0] == pytest.approx(heated.at_points([(0.0, 0.0)])[-1, 0])


RANKS = """
import json, sys
sys.path.insert(0, "tests")
import formingx as fx
from test_heat import SHEET, SKIN, TWO, everything
mesh = fx.mesh.disc(radius=5e-3, thickness=TWO, elements=(3, 2))
run = fx.heat(mesh, {"core": SHEET, "skin": SKIN}, everything(), start=25.0, times=[0.2, 0.5], unit="C", tolerance=0.05)
numbers = [*run.at_points([(1e-3, 1e-3), (4e-3, 2e-3)]).ravel(), *run.hottest(), *run.line_mean(),
           *(h.sum() for h in run.heat_through.values()), *run.tool_profile("bottom", (2e-3, 0))[1], len(run.times)]
try:
    fx.heat(mesh, {"core": SHEET, "skin": SKIN}, [], start=fx.table({0: 20, 3e-3: 50}), times=1.0, unit="C")
except fx.InputError as error:
    found = mesh.comm.gather("must be from 0 to 0.003" in str(error))
if mesh.comm.rank == 0:
    print(json.dumps(list(map(float, numbers)) + found[:1]))
"""


@pytest.mark.thorough
def test_ranks_agree():
    one, two = (run_json(RANKS, ranks) for ranks in (1, 2))
    assert two == pytest.approx(one, rel=1e-8)


@pytest.fixture(scope="module")
def small():
    return fx.mesh.disc(radius=5e-3, thickness=D, elements=(1, 1))


@pytest.mark.parametrize("changes, words", [
    ({"boundaries": [fx.Convection("side", h=1, air=20)]}, "boundary 'side' is not known; known: 'axis'"),
    ({"boundaries": [fx.Convection("top", h=1, air=-300)]}, "air = -300.0: must be at least -273.15"),
    ({"boundaries": [fx.Radiation("top", emissivity=1, heater=fx.table({0: 300, 4e-3: 400}))]}, "R on 'top' = 0.005"),
    ({"boundaries": [fx.ContactWithTool("top", conductance=1, tool=-280)]}, "must be at least -273.15"),
    ({"boundaries": ["top"]}, "'top' is not allowed here"),
    ({"boundaries": [fx.FixedTemperature("top", temperature=30), fx.HeatFlux("top", flux=1)]}, "does nothing"),
    ({"unit": "F"}, "unit 'F' is not known"),
    ({"start": -274.0}, "absolute zero"),
    ({"start": "missing.csv"}, "is not there"),
    ({"start": lambda R, Z: R / 0 * np.nan}, "not a finite number, at"),
    ({"times": [2.0, 1.0]}, "times that grow|several that grow"),
    ({"times": []}, "several that grow"),
    ({"times": 0.0}, "times = 0.0"),
    ({"tolerance": 0}, "tolerance = 0"),
    ({"materials": {"skin": SHEET}}, "layer 'skin' is not known"),
    ({"materials": {}}, "layer 'sheet' has no material"),
    ({"materials": 3.0}, "must be ThermalProperties"),
    ({"kinematics": "plane"}, "must be Axisymmetric"),
    ({"displacement": 1.0}, "must be a Function or expression"),
    ({"mesh": "disc"}, "must come from formingx.mesh"),
])
@pytest.mark.filterwarnings("ignore::RuntimeWarning")
def test_runs_that_are_refused(changes, words, small):
    arguments = {"mesh": small, "materials": SHEET, "boundaries": [], "start": 25.0, "times": 1.0,
                 "unit": "C"} | changes
    with pytest.raises(fx.InputError, match=words):
        fx.heat(arguments.pop("mesh"), arguments.pop("materials"), arguments.pop("boundaries"), **arguments)


def test_wrong_requests_to_a_heat_result_are_refused(heated, tmp_path):
    for ask, words in ((lambda: heated.at_points([(0.0, 2 * D)]), "not in the mesh"),
                       (lambda: heated.temperature(21.0), "must be from 0 to 20"),
                       (lambda: heated.time_to_reach(3.0, 2.0), "must be below high"),
                       (lambda: heated.tool_profile("top", (0, 0)), "conducting tool on boundary 'top' is not known"),
                       (lambda: sides(start=heated, unit="K"), "is in 'C', this run in 'K'")):
        with pytest.raises(fx.InputError, match=words):
            ask()
    (tmp_path / "part.csv").write_text("R,Z,T\n0,0,20\n1,0,30\n0,1e-3,40\n1,1e-3,50\n")
    with pytest.raises(fx.InputError, match="lies outside the points of the file"):
        sides(start=tmp_path / "part.csv")


def test_too_many_time_steps_are_reported():
    with pytest.raises(fx.ConvergenceError, match="max_steps = 5") as error:
        sides(max_steps=5)
    assert len(error.value.path.times) == 6


def test_mixed_units_of_a_run_are_reported(caplog):
    """A sheet in mm with constants in SI; one with the Stefan-Boltzmann constant in SI."""
    sheet = fx.mesh.disc(radius=50.0, thickness=2.0, elements=(4, 2))
    laws = {"start": 25.0, "times": 1.0, "unit": "C", "tolerance": 1.0}
    si = fx.ThermalProperties(conductivity=0.2, density=1050.0, heat_capacity=1800.0)
    fx.heat(sheet, si, [fx.Convection("top", h=10.0, air=100.0)], **laws)
    assert "the diffusivity, conductivity / (density heat_capacity), is 1.06e-07, and the body 50 long" in caplog.text
    caplog.clear()
    mm = fx.ThermalProperties(conductivity=0.2e-3, density=1.05e-3, heat_capacity=1.8)
    heater = {"emissivity": 0.9, "heater": 450.0}
    fx.heat(sheet, mm, [fx.Radiation("top", **heater)], **laws)
    assert "are all in one system of units? sigma is" in caplog.text
    caplog.clear()
    fx.heat(sheet, mm, [fx.Radiation("top", stefan_boltzmann=5.67e-14, **heater)], **laws)
    assert not caplog.text


def test_radiation_heats_to_its_steady_state():
    """First steps in which Newton's method finds no solution are shortened."""
    sheet = fx.mesh.disc(radius=0.02, thickness=0.004, elements=(3, 3))
    polymer = fx.ThermalProperties(conductivity=0.2, density=1000.0, heat_capacity=2000.0)
    run = fx.heat(sheet, polymer, [fx.Radiation(face, emissivity=0.9, heater=500.0) for face in ("bottom", "top")],
                  start=20.0, times=1e6, unit="C", tolerance=0.1)
    assert np.allclose(run.at_points([(0.0, 0.0), (0.0, 0.002)]), 500.0, atol=1e-6)
