"""Heat through the thickness of sheets in three dimensions: series, tools, thinning, layers, zones, stages."""

import numpy as np
import pytest

import formingx as fx
from formingx.exact import heat as exact
from formingx.extensions.heat import stepping
from formingx.extensions.space.heat.basis import ColumnBasis, gauss_lobatto
from formingx.extensions.space.heat.columns import ColumnConduction

POLYMER = fx.ThermalProperties(conductivity=0.2e-3, density=1e-3, heat_capacity=2.0)
SLAB = exact.Slab(1.0, 0.2e-3, 2e-3)
STEEL = fx.ConductingTool(thickness=20.0, conductivity=40e-3, heat_capacity=3.611e-3, back=30.0)
DEPTHS = np.array([0.0, 0.25, 0.5, 0.75, 1.0])
HELD = [fx.SimplySupported("rim"), fx.Symmetry("x0", "x"), fx.Symmetry("y0", "y")]


def sheet(size=15.0, **options):
    """Mesh of a quarter of a disc of radius 20."""
    return fx.mesh.sheet(fx.mesh.circle(20.0, part="quarter"), size=size, **options)


def scene(heat, mesh=None, thickness=1.0, temperature=150.0, materials=None, **options):
    """Scene of a quarter of a disc of radius 20, 1 thick."""
    return fx.Scene(mesh=mesh or sheet(), thickness=thickness, temperature=temperature, heat=heat, supports=HELD,
                    materials=materials or fx.NeoHookean(c10=0.1), loads=[fx.Pressure("bottom", name="air")], **options)


def wait(times, boundaries, tolerance=2e-3, **options):
    """Return the path of a sheet at rest whose stages end at `times`."""
    stages = [fx.Stage(f"wait {t:g}", duration=t - before) for before, t in zip([0.0, *times], times)]
    return fx.Process(scene(fx.Cooling(POLYMER, boundaries, unit="C", tolerance=tolerance), **options)).run(
        stages, progress=False, accuracy="draft")


def at_times(path, times, point=(3.0, 4.0)):
    """Temperatures at one point and DEPTHS, shape (times, 5)."""
    found = []
    for t in times:
        state = next(s for s in reversed(path.states) if abs(s.time - t) < 1e-9)
        found.append(path.temperature([point] * len(DEPTHS), state, depth=DEPTHS))
    return np.array(found)


class Nodes:
    """Nodes of a sheet that is stretched by `ratio` in area."""

    def __init__(self, thickness, ratio=1.0):
        self.points, self.comm = np.array([[float(k), 0.0, 0.0] for k in range(len(thickness))]), fx.mesh.MPI.COMM_SELF
        self.area, self.thickness, self.ratio = np.ones(len(thickness)), np.asarray(thickness), ratio
        self.faces = {"bottom": -1.0, "top": 1.0}

    def area_ratio(self):
        return np.full(len(self.area), self.ratio)


def columns(boundaries, thickness=(1.0,), ratio=1.0, start=150.0):
    """Columns of sheets of some thicknesses without a mesh."""
    basis = ColumnBasis([1.0], [POLYMER], ["sheet"])
    return ColumnConduction(Nodes(thickness, ratio), basis, boundaries, np.full(len(thickness), start), -273.15)


def integrate(body, end, tolerance):
    """Temperatures of columns at a time, and the heat that they stored and received."""
    state, t, dt, stored, received = body.start(), 0.0, 1e-4 * end, 0.0, 0.0
    while t < end:
        trial = stepping.fitted(dt, end - t)
        found = stepping.step(body, state, trial)
        dt = stepping.next_length(trial, found.error, tolerance)
        if found.error <= tolerance:
            state, t, stored = found.state, t + trial, stored + found.stored
            received += found.heats.sum()
    return state, stored, received


def test_gauss_lobatto_rule_is_exact():
    """Points, weights and slopes: polynomials up to degree 2 n - 1 are integrated, up to n differentiated."""
    for order in (1, 2, 8, 12):
        x, w, slopes = gauss_lobatto(order)
        for k in range(2 * order):
            assert w @ x**k == pytest.approx(1 / (k + 1), rel=1e-12)
        assert slopes @ x**order == pytest.approx(order * x ** (order - 1), abs=1e-11)


def test_sheet_in_air_against_the_series():
    """Air of two temperatures at both faces: 1e-3 of the difference to the colder air, at all times and depths."""
    h, air, times = (1e-3, 5e-5), (40.0, 20.0), (0.5, 2.0, 8.0)
    path = wait(times, [fx.Convection("bottom", h=h[0], air=air[0]), fx.Convection("top", h=h[1], air=air[1])])
    wanted = exact.series(SLAB, 150.0, h, air, DEPTHS, times)
    assert np.abs(at_times(path, times) - wanted).max() < 1e-3 * 130.0


def test_sheet_on_cold_steel_against_the_laplace_transform():
    """A sheet on steel that conducts in its own depth: 1e-3 of the difference, and the face is colder than the top."""
    times = (0.05, 0.5, 3.0)
    path = wait(times, [fx.ContactWithTool("bottom", conductance=1e-3, tool=STEEL),
                        fx.Convection("top", h=1e-5, air=25.0)])
    tool = exact.Slab(20.0, 40e-3, 3.611e-3)
    wanted, _ = exact.sheet_on_tool(SLAB, tool, 1e-3, 150.0, 30.0, 1e-5, 25.0, DEPTHS, [0.0], times)
    found = at_times(path, times)
    assert np.abs(found - wanted).max() < 1e-3 * 125.0
    assert found[1, -1] - found[1, 0] > 20.0


def test_points_of_a_column_resolve_a_chilled_face():
    """The errors that `heat/basis.py` states, with a Biot number of 20: against a polynomial of degree 60."""
    def cooled(order, fourier):
        x, w, slopes = gauss_lobatto(order)
        K = slopes.T @ (w[:, None] * slopes)
        K[0, 0] += 20.0
        rates, modes = np.linalg.eigh(K / np.sqrt(np.outer(w, w)))
        return x, (modes * np.exp(-rates * fourier)) @ (modes.T @ np.sqrt(w)) / np.sqrt(w)
    basis = ColumnBasis([1.0], [POLYMER], ["sheet"])
    for fourier, error in ((1e-3, 2.1e-3), (1e-2, 1.4e-5)):
        (x, found), (fine, wanted) = cooled(len(basis.depths) - 1, fourier), cooled(60, fourier)
        from scipy.interpolate import BarycentricInterpolator
        off = np.abs(found - BarycentricInterpolator(fine, wanted)(x)).max()
        assert 0.5 * error < off < error


@pytest.mark.parametrize("boundaries", [
    [fx.Radiation("top", emissivity=0.9, heater=500.0, stefan_boltzmann=5.67e-14), fx.HeatFlux("bottom", flux=1e-3)],
    [fx.Absorption("bottom", flux=0.02, coefficient=1.5), fx.Convection("top", h=2e-5, air=20.0)],
    [fx.ContactWithTool("bottom", conductance=1e-3, tool=STEEL), fx.Convection("top", h=2e-5, air=20.0)]])
def test_stored_heat_is_the_heat_through_the_faces(boundaries):
    """To round-off in each step, for nonlinear laws, absorbed radiation and a tool that conducts."""
    _, stored, received = integrate(columns(boundaries, (1.0, 2.0)), 3.0, 0.05)
    assert abs(stored) > 0.01 and received == pytest.approx(stored, rel=1e-9)


def test_radiation_against_the_method_of_lines():
    """A heater at 500 C above one face: finite volumes give the same temperatures to 1e-3 of their rise."""
    law = fx.Radiation("top", emissivity=0.9, heater=500.0, stefan_boltzmann=5.67e-14)
    body = columns([law], start=20.0)
    (T,), *_ = integrate(body, 6.0, 1e-3)

    def flux(T):
        return 0.9 * 5.67e-14 * (773.15**4 - (T + 273.15) ** 4)
    x, wanted = exact.method_of_lines(SLAB, 20.0, (lambda T: 0.0 * T, flux), [6.0])
    rise = wanted[0].max() - 20.0
    assert np.ptp(wanted[0]) > 20.0
    assert np.abs(body.basis.shapes(x) @ T[0] - wanted[0]).max() < 1e-3 * rise


@pytest.mark.parametrize("ratio", [1.0, 2.0])
def test_temperatures_belong_to_the_present_thickness(ratio):
    """A column of 2, unstretched and stretched to twice its area, in air: the temperatures of a slab of 2 and of 1."""
    h, air, slab = (1e-3, 5e-5), (40.0, 20.0), exact.Slab(2.0 / ratio, 0.2e-3, 2e-3)
    laws = [fx.Convection("bottom", h=h[0], air=air[0]), fx.Convection("top", h=h[1], air=air[1])]
    body = columns(laws, (2.0,), ratio=ratio)
    (T,), *_ = integrate(body, 2.0, 2e-3)
    wanted = exact.series(slab, 150.0, h, air, slab.thickness * DEPTHS, [2.0])[0]
    assert body.basis.shapes(DEPTHS) @ T[0] == pytest.approx(wanted, abs=0.1)


def test_a_stretched_sheet_touches_a_tool_with_its_present_area():
    """A column of 2, stretched to twice its area, on steel: the temperatures of a slab of thickness 1."""
    body = columns([fx.ContactWithTool("bottom", conductance=1e-3, tool=STEEL), fx.Convection("top", h=1e-5, air=25.0)],
                   (2.0,), ratio=2.0)
    (T, _), *_ = integrate(body, 0.5, 2e-3)
    wanted, _ = exact.sheet_on_tool(SLAB, exact.Slab(20.0, 40e-3, 3.611e-3), 1e-3, 150.0, 30.0, 1e-5, 25.0, DEPTHS,
                                    [0.0], [0.5])
    assert body.basis.shapes(DEPTHS) @ T[0] == pytest.approx(wanted[0], abs=0.1)


def test_a_stage_solves_its_implicit_equation():
    """M D = k + c R(y + D) in columns of two thicknesses, with laws that are not linear and a tool that conducts."""
    body = columns([fx.ContactWithTool("bottom", conductance=1e-3, tool=STEEL),
                    fx.Radiation("top", emissivity=0.9, heater=500.0, stefan_boltzmann=5.67e-14)], (1.0, 2.0), 1.5)
    state, c = body.start(), 0.7
    known = [1e-3 * part for part in state]
    found = body.stage(state, known, c, state[0])
    assert np.abs(found.changes[0]).max() > 5.0
    assert body.mass(found.changes[0]) == pytest.approx(known[0] + c * found.rates[0], abs=1e-9)


def test_slope_of_a_law_is_the_derivative_of_its_flux():
    law, = columns([fx.Radiation("top", emissivity=0.9, heater=500.0, stefan_boltzmann=5.67e-14)])._laws
    flux, slope = law.flux(np.array([150.0]))
    quotient = (law.flux(np.array([150.01]))[0] - law.flux(np.array([149.99]))[0]) / 0.02
    assert slope == pytest.approx(quotient, rel=1e-6) and abs(slope[0] * 1e-2) < flux[0]


def test_layers_absorb_what_does_not_pass_them():
    """Radiation of 0.02 into two layers: together they absorb 1 - exp(-a h) of it."""
    basis = ColumnBasis([0.25, 0.75], [POLYMER, POLYMER], ["skin", "core"])
    body = ColumnConduction(Nodes([1.0]), basis, [fx.Absorption("bottom", flux=0.02, coefficient=1.5)],
                            np.array([150.0]), -273.15)
    assert body.rates(body.start())[1][0] == pytest.approx(0.02 * (1 - np.exp(-1.5)), rel=1e-9)


def test_layers_against_a_section():
    """A foam below a solid: the temperatures of `fx.heat` in a section with the same layers."""
    foam = fx.ThermalProperties(conductivity=0.05e-3, density=0.2e-3, heat_capacity=2.0)
    laws = [fx.Convection("bottom", h=1e-3, air=40.0), fx.Convection("top", h=5e-5, air=20.0)]
    heat = fx.Cooling({"foam": foam, "skin": POLYMER}, laws, unit="C", tolerance=2e-3)
    mesh = sheet(layers=["foam", "skin"])
    stage = fx.Stage("wait", duration=1.0)
    path = fx.Process(scene(heat, mesh, {"foam": 0.6, "skin": 0.4}, materials={
        name: fx.NeoHookean(c10=0.1) for name in mesh.layers})).run([stage], progress=False, accuracy="draft")
    flat = fx.mesh.disc(radius=20.0, thickness={"foam": 0.6, "skin": 0.4}, elements=(2, [6, 6]))
    section = fx.heat(flat, {"foam": foam, "skin": POLYMER}, laws, start=150.0, times=[1.0], unit="C", tolerance=1e-3)
    wanted = section.at_points([(1.0, z) for z in DEPTHS])[-1]
    assert at_times(path, [1.0])[0] == pytest.approx(wanted, abs=0.1)


def test_zones_heat_each_place_by_its_own(tmp_path):
    """Between four zones of a heater: each column is heated by its own temperature, from a CSV file too."""
    heater = fx.zones([0.0, 20.0], [0.0, 20.0], [[620.0, 560.0], [500.0, 440.0]])
    (tmp_path / "zones.csv").write_text("x,y,heater\n0,0,620\n20,0,560\n0,20,500\n20,20,440\n")
    stored = fx.zones(tmp_path / "zones.csv", column="heater")
    assert np.array_equal(stored.values, heater.values) and float(stored(-5.0, 30.0)) == 500.0
    path = wait([1.0], [fx.Radiation("top", emissivity=0.9, heater=stored, stefan_boltzmann=5.67e-14)],
                temperature=20.0)
    for x, y in ((0.0, 0.0), (20.0, 0.0), (0.0, 20.0)):
        law = fx.Radiation("top", emissivity=0.9, heater=float(heater(x, y)), stefan_boltzmann=5.67e-14)
        (T,), *_ = integrate(columns([law], start=20.0), 1.0, 2e-3)
        assert path.temperature([(x, y)], depth=1.0)[0] == pytest.approx(T[0, -1], abs=0.05)


def test_a_stage_leaves_a_heater_out():
    """The heaters of an oven stop at the end of its stage, in three dimensions and in a section.

    Both have one name. An unknown name, and the name of another item of the scene, are refused.
    """
    heaters = [fx.HeatFlux(face, flux=0.01, name="oven") for face in ("bottom", "top")]
    heat = fx.Cooling(POLYMER, heaters, unit="C", tolerance=0.02)
    flat = fx.Scene(mesh=fx.mesh.disc(radius=20.0, thickness=1.0, elements=(4, 3)), materials=fx.NeoHookean(c10=0.1),
                    supports=[fx.Symmetry("axis"), fx.SimplySupported("rim")], temperature=20.0, heat=heat,
                    loads=[fx.Pressure("bottom", name="air")])
    for made, points in ((scene(heat, temperature=20.0), {"depth": [0.5]}), (flat, {})):
        stages = [fx.Stage("oven", duration=2.0), fx.Stage("wait", duration=20.0, inactive=["oven"])]
        path = fx.Process(made).run(stages, progress=False, accuracy="draft")
        wanted = 20.0 + 0.02 * 2.0 / 2e-3                    # flux times time over capacity, evened out
        assert path.temperature([(3.0, 0.5)], **points)[0] == pytest.approx(wanted, abs=0.2)
    with pytest.raises(fx.InputError, match="'ovn' is not in the scene"):
        fx.Process(scene(heat)).run([fx.Stage("oven", duration=2.0, inactive=["ovn"])])
    with pytest.raises(fx.InputError, match="an item of the scene is called 'air'"):
        scene(fx.Cooling(POLYMER, [fx.HeatFlux("top", flux=0.01, name="air")], unit="C"))


@pytest.mark.parametrize("boundary, options, words", [
    (fx.Convection("rim", h=1e-5, air=20.0), {}, "'rim' is an edge, and heat flows through the thickness"),
    (fx.FixedTemperature("top", temperature=20.0), {}, "has no prescribed temperature: use ContactWithTool"),
    (fx.Convection("top", h=fx.table({0.0: 1e-5, 20.0: 2e-5}), air=20.0), {}, "takes fx.zones"),
    (fx.Convection("top", h=1e-5, air=20.0), {"work_to_heat": 1e-3}, "is not heated by its work")])
def test_cooling_refuses_by_name(boundary, options, words):
    with pytest.raises(fx.InputError, match=words):
        scene(fx.Cooling(POLYMER, [boundary], unit="C", **options))


def test_other_refusals():
    """Zones in a section, shares of layers that vary, a depth in a section, and a depth that is no share."""
    air = fx.Convection("top", h=fx.zones([0.0], [0.0], [[1e-5]]), air=20.0)
    with pytest.raises(fx.InputError, match="a section takes a table over R"):
        fx.heat(fx.mesh.disc(radius=1.0, thickness=0.1, elements=(2, 1)), POLYMER, [air], start=20.0, times=1.0,
                unit="C")
    mesh = sheet(layers=["foam", "skin"])
    with pytest.raises(fx.InputError, match="must be the same share of the thickness everywhere"):
        scene(fx.Cooling(POLYMER, unit="C"), mesh, {"foam": 0.6, "skin": lambda x, y: 0.4 + 0.01 * x})
    path = wait([0.1], [fx.Convection("top", h=1e-5, air=20.0)])
    with pytest.raises(fx.InputError, match="must be numbers from 0 to 1"):
        path.temperature([(3.0, 4.0)], depth=1.5)


def test_a_checkpoint_keeps_the_columns(tmp_path):
    """A run that is resumed from a checkpoint continues with the temperatures of all columns."""
    heat = fx.Cooling(POLYMER, [fx.ContactWithTool("bottom", conductance=1e-3, tool=STEEL)], unit="C")
    first, second = fx.Stage("one", duration=0.5), fx.Stage("two", duration=0.5)
    process = fx.Process(scene(heat))
    whole = process.run([first, second], progress=False, accuracy="draft")
    part = process.run([first], progress=False, accuracy="draft", checkpoint=tmp_path / "run")
    again = process.run([first, second], progress=False, accuracy="draft", start=part)
    assert at_times(again, [1.0]) == pytest.approx(at_times(whole, [1.0]), abs=1e-9)


def test_oven_ends_at_a_temperature_of_the_core():
    """A stage ends when the core has its temperature, found by the series; in a section too, and for a point at a face.

    A sheet without heat conduction, a depth in a section and a point outside the sheet are refused.
    """
    h, air = (4e-5, 4e-5), (300.0, 300.0)
    laws = [fx.Convection("bottom", h=h[0], air=air[0]), fx.Convection("top", h=h[1], air=air[1])]
    heat = fx.Cooling(POLYMER, laws, unit="C", tolerance=2e-3)
    flat = fx.Scene(mesh=fx.mesh.disc(radius=20.0, thickness=1.0, elements=(3, 4)), materials=fx.NeoHookean(c10=0.1),
                    supports=[fx.Symmetry("axis"), fx.SimplySupported("rim")], temperature=20.0, heat=heat,
                    loads=[fx.Pressure("bottom", name="air")])
    times = {}
    for name, made, target in (("core", scene(heat, temperature=20.0), fx.temperature(150.0, at=(3.0, 4.0))),
                               ("face", scene(heat, temperature=20.0), fx.temperature(150.0, at=(3.0, 4.0), depth=1.0)),
                               ("section", flat, fx.temperature(150.0, at=(3.0, 0.5)))):
        path = fx.Process(made).run([fx.Stage("oven", duration=200.0, until=target)], progress=False, accuracy="draft")
        times[name] = path.last.time
        assert path.last.target[0] == "temperature"
    found = exact.series(SLAB, 20.0, h, air, [0.5, 1.0], [times["core"], times["face"], times["section"]])
    assert [found[0, 0], found[1, 1], found[2, 0]] == pytest.approx([150.0] * 3, abs=0.05)
    assert times["face"] < times["core"]
    stage = fx.Stage("oven", duration=2.0, until=fx.temperature(30.0, at=(30.0, 0.0)))
    with pytest.raises(fx.InputError, match="is not in the mesh"):
        fx.Process(scene(heat)).run([stage], progress=False)
    with pytest.raises(fx.InputError, match="the temperature of the scene does not change"):
        fx.Process(scene(None)).run([stage], progress=False)


@pytest.mark.thorough
def test_error_without_conduction_along_the_sheet():
    """The numbers of docs/how/warm_tray.md: half of a sheet on a cold tool, against conduction in two dimensions."""
    mesh = fx.mesh.disc(radius=20.0, thickness=1.5, elements=(80, 8), concentrate={10.0: 0.05})
    tool = fx.table({0.0: 1e-3, 9.99: 1e-3, 10.01: 0.0, 20.0: 0.0})
    run = fx.heat(mesh, POLYMER, [fx.Convection("bottom", h=tool, air=20.0)], start=150.0, times=[2.0], unit="C",
                  kinematics=fx.PlaneStrain(), tolerance=0.02)
    body = columns([fx.Convection("bottom", h=1e-3, air=20.0)], (1.5,))
    (T,), *_ = integrate(body, 2.0, 2e-3)
    inside = run.at_points([(9.5, 0.0), (9.0, 0.0)])[-1] - T[0, 0]
    outside = 150.0 - run.at_points([(10.5, 0.0), (11.0, 0.0)])[-1]
    assert inside / 130.0 == pytest.approx([0.020, 0.002], abs=1e-3)
    assert outside / 130.0 == pytest.approx([0.09, 0.014], abs=2e-3)


def test_a_tube_cools_from_its_outer_face():
    """Depth 0 is the inner face: the temperatures of a slab between air of 60 C inside and 20 C outside."""
    h, air = (1e-4, 1e-3), (60.0, 20.0)
    tube = fx.mesh.tube(radius=10.0, length=40.0, elements=(6, 6), part="quarter", end="closed")
    laws = [fx.Convection("inner", h=h[0], air=air[0]), fx.Convection("outer", h=h[1], air=air[1])]
    made = fx.Scene(mesh=tube, thickness=1.0, materials=fx.NeoHookean(c10=0.5), temperature=150.0,
                    heat=fx.Cooling(POLYMER, laws, unit="C", tolerance=2e-3), loads=[fx.Pressure("inner", name="air")],
                    supports=[fx.Clamped("neck"), fx.Symmetry("x0", "x"), fx.Symmetry("y0", "y")])
    path = fx.Process(made).run([fx.Stage("wait", duration=2.0)], progress=False, accuracy="draft")
    wanted = exact.series(SLAB, 150.0, h, air, DEPTHS, [2.0])
    assert at_times(path, [2.0], (10.0, 0.0, -20.0)) == pytest.approx(wanted, abs=0.1)
