"""Conduction: series, orders, heat balance, the deformed body, contact with a tool; the references themselves."""

import numpy as np
import pytest
import ufl
from dolfinx import fem

import formingx as fx
from formingx import _compat
from formingx.exact import heat as reference
from formingx.extensions.heat import stepping
from formingx.extensions.heat.conduction import Conduction

D = 3e-3
SHEET = fx.ThermalProperties(conductivity=0.17, density=1050.0, heat_capacity=1800.0)
SLAB = reference.Slab(D, 0.17, 1050.0 * 1800.0)
TOOL = {"conductivity": 0.4, "heat_capacity": 0.84e6}


def strip(elements=10, thickness=D):
    return fx.mesh.disc(radius=0.05 * D, thickness=thickness, elements=(1, elements))


def body_of(mesh, boundaries=(), start=25.0, displacement=None, materials=None, kinematics=None):
    """The equations of a body, at a uniform temperature or one of (R, Z), in C."""
    body = Conduction(mesh, materials or dict.fromkeys(mesh.layers, SHEET), boundaries, kinematics or fx.Axisymmetric(),
                      -273.15, displacement)
    body.T.x.array[:] = 0
    body.T.x.array[: len(body.points)] = start(*body.points.T) if callable(start) else start
    body.T.x.scatter_forward()
    return body


def fixed_steps(body, end, steps):
    """The state after equal steps."""
    state = body.start()
    for _ in range(steps):
        state = stepping.step(body, state, end / steps).state
    return state


def test_tangent_of_a_step_is_the_derivative_of_its_heat():
    """M dT - c dR/dT dT, with conduction, convection, radiation and a tool of constant temperature."""
    rng, c, size = np.random.default_rng(3), 2.0, 1e-3
    body = body_of(strip(), [fx.Convection("bottom", h=30.0, air=180.0), fx.Radiation("bottom", emissivity=0.9,
                   heater=500.0), fx.ContactWithTool("top", conductance=400.0, tool=20.0)], lambda R, Z: 80 + 3e4 * Z)
    state = body.start()
    change, touch = rng.standard_normal(len(state[0])), body.tool_contacts[0]
    up, down = (body.rates([state[0] + sign * size * change, state[1]])[0][0] for sign in (1, -1))
    exact = body.mass(change) - c * (up - down) / (2 * size)
    body.rates(state)
    body._factorise(c, [touch.response(state[1], 0 * state[1], c)], afresh=True)
    body._rhs.array_w[:] = change
    body._matrix.mult(body._rhs, body._out)
    np.testing.assert_allclose(body._out.array_r, exact, atol=1e-8 * np.abs(exact).max())


# the references against each other

def test_series_and_finite_volumes_agree():
    times, h, air = [5, 40], (60.0, 10.0), (220.0, 80.0)

    def source(x):
        return 4e6 * np.exp(-1500 * x)
    fluxes = [lambda T, k=k: h[k] * (air[k] - T) for k in (0, 1)]
    x, T = reference.method_of_lines(SLAB, 25.0, fluxes, times, cells=200, source=source)
    assert reference.series(SLAB, 25.0, h, air, x, times, source) == pytest.approx(T, abs=2e-5)


def test_transform_agrees_with_the_series_and_with_the_contact_of_half_spaces():
    times = [0.2, 3.0]
    perfect = reference.Slab(0.02, 1e9, 1e12)                 # stays at its temperature
    x = np.linspace(0, D, 7)
    sheet, _ = reference.sheet_on_tool(SLAB, perfect, 1000.0, 150.0, 30.0, 10.0, 25.0, x, [0.0], times)
    assert sheet == pytest.approx(reference.series(SLAB, 150.0, (1000.0, 10.0), (30.0, 25.0), x, times), abs=1e-5)
    # half spaces in perfect contact: both faces at the mean weighted by effusivity (Carslaw and Jaeger, section 2.15)
    tool = reference.Slab(0.02, 0.4, 0.84e6)
    e, f = (np.sqrt(b.conductivity * b.capacity) for b in (SLAB, tool))
    a, b = reference.sheet_on_tool(SLAB, tool, 1e9, 150.0, 30.0, 0.0, 25.0, [0.0], [0.0], [0.1])
    assert [a[0, 0], b[0, 0]] == pytest.approx([(e * 150 + f * 30) / (e + f)] * 2, abs=1e-2)


# heat in a slab

def test_convection_and_absorption_are_those_of_the_series():
    times, places = [2.0, 20.0, 100.0], np.linspace(0, D, 5)

    def source(x):
        return 8000 * 1500 * np.exp(-1500 * (D - x))
    run = fx.heat(strip(), SHEET, [fx.Convection("bottom", h=60, air=220), fx.Convection("top", h=10, air=80),
                                   fx.Absorption("top", flux=8000, coefficient=1500)],
                  start=25.0, times=times, unit="C")
    exact = reference.series(SLAB, 25.0, (60.0, 10.0), (220.0, 80.0), places, times, source)
    found = run.at_points(np.column_stack([0 * places, places]))
    assert found == pytest.approx(exact, abs=1e-4 * (exact.max() - 25))
    s, weights = np.polynomial.legendre.leggauss(20)
    mean = reference.series(SLAB, 25.0, (60.0, 10.0), (220.0, 80.0), D * (s + 1) / 2, times, source) @ weights / 2
    assert run.line_mean() == pytest.approx(mean, abs=1e-4 * (exact.max() - 25))


def test_a_temperature_step_at_a_face_causes_no_oscillation():
    """A face set to 125 C in a body at 25 C: T = 125 - 100 erf(x/sqrt(4 a t)) (Carslaw and Jaeger, section 2.4)."""
    from scipy.special import erf
    times = [0.5, 2.0]
    run = fx.heat(strip(24), SHEET, [fx.FixedTemperature("bottom", temperature=125)], start=25.0, times=times, unit="C")
    x = np.linspace(0, D, 13)
    exact = 125 - 100 * erf(x / np.sqrt(4 * SHEET.diffusivity * np.array(times)[:, None]))
    assert run.at_points(np.column_stack([0 * x, x])) == pytest.approx(exact, abs=1e-2)
    history = run.at_points([(0.0, D / 12)], run.times[1:])[:, 0]
    assert np.all(np.diff(history[run.times[1:] > 0.05]) > 0)
    given = run.heat_through["FixedTemperature('bottom')"].sum()
    assert given == pytest.approx(run.heat_stored.sum(), rel=1e-10)
    # what comes in after 0.5 s: 2 k dT/sqrt(pi a) (sqrt(2) - sqrt(0.5))
    late = run.heat_stored[run.times > 0.5].sum() / (np.pi * (0.05 * D) ** 2)
    assert late == pytest.approx(2 * 0.17 * 100 / np.sqrt(np.pi * SHEET.diffusivity) * np.sqrt(0.5), rel=1e-3)


def test_a_tool_that_conducts():
    times, places = [0.5, 2.0, 20.0], np.array([0, D / 2, D])
    tool = fx.ConductingTool(thickness=0.01, back=30.0, **TOOL)
    run = fx.heat(strip(24), SHEET, [fx.ContactWithTool("bottom", conductance=300, tool=tool),
                                     fx.Convection("top", h=10, air=25)], start=150.0, times=times, unit="C")
    depths = np.array([0.0, 1e-3])
    sheet, inside = reference.sheet_on_tool(SLAB, reference.Slab(0.01, *TOOL.values()), 300, 150.0, 30.0, 10, 25.0,
                                             places, depths, times)
    assert run.at_points(np.column_stack([0 * places, places])) == pytest.approx(sheet, abs=1e-4 * 125)
    for t, exact in zip(times, inside):
        y, T = run.tool_profile("bottom", (0.0, 0.0), t)
        assert T[0] == pytest.approx(exact[0], abs=1e-4 * 125)
        assert np.interp(depths[1], y, T) == pytest.approx(exact[1], abs=5e-2)              # linear between its nodes
    assert np.abs(run.balance).max() < 1e-10


# orders

def mode(R, Z, t=0.0):
    """A disc of radius and thickness 1, insulated: T = J0(m R) cos(pi Z) exp(-(m^2 + pi^2) t), J1(m) = 0."""
    from scipy.special import j0
    m = 3.8317059702075125
    return j0(m * R) * np.cos(np.pi * Z) * np.exp(-(m**2 + np.pi**2) * t)


UNIT = fx.ThermalProperties(conductivity=1.0, density=1.0, heat_capacity=1.0)


def test_order_3_in_space():
    errors, end = [], 0.02
    for n in (3, 6, 12):
        body = body_of(fx.mesh.disc(radius=1.0, thickness=1.0, elements=(n, n)), start=mode,
                       materials={"sheet": UNIT})
        T = fixed_steps(body, end, 60)[0]
        R, Z = (body.points[:, k] for k in (0, 1))
        errors.append(np.abs(T - mode(R, Z, end)).max())
    slopes = np.log2(np.array(errors[:-1]) / errors[1:])
    assert np.all(slopes > 2.8) and errors[-1] < 1e-3


def everything(tool=None):
    """All kinds of boundary but a fixed temperature, which `test_a_sudden_temperature_...` has."""
    tool = tool or fx.ConductingTool(thickness=0.01, back=30.0, elements=12, finest=0.01, **TOOL)
    heater = fx.table({0.0: 350.0, 1e-3: 380.0, 7e-3: 420.0})
    return [fx.Radiation("top", emissivity=0.9, heater=heater), fx.Convection("top", h=8, air=60),
            fx.Absorption("top", flux=3000, coefficient=900), fx.HeatFlux("rim", flux=-200),
            fx.ContactWithTool("bottom", conductance=100, tool=tool)]


def test_order_2_in_time():
    body = body_of(strip(3), everything())
    begin = fixed_steps(body, 20.0, 20)                         # past the jump

    def after(steps):
        state = begin
        for _ in range(steps):
            state = stepping.step(body, state, 20.0 / steps).state
        return np.concatenate([part.ravel() for part in state])
    exact = after(64)
    errors = [np.abs(after(n) - exact).max() for n in (4, 8, 16)]
    slopes = np.log2(np.array(errors[:-1]) / errors[1:])
    assert np.all(np.abs(slopes - 2) < 0.25) and errors[0] > 1e-4


def test_error_of_a_step_is_estimated():
    """Of third order in the step, and near what the step is off."""
    body = body_of(strip(3), everything())
    begin = fixed_steps(body, 20.0, 20)
    found = []
    for dt in (2.0, 1.0):
        exact = begin
        for _ in range(8):
            exact = stepping.step(body, exact, dt / 8).state
        one = stepping.step(body, begin, dt)
        off = max(np.abs(a - b).max() for a, b in zip(one.state, exact))
        found.append((one.error, off))
    assert 2.5 < np.log2(found[0][0] / found[1][0]) < 3.3
    assert all(0.3 < estimate / true < 5 for estimate, true in found)


# balance

TWO = {"core": D / 2, "skin": D / 2}
SKIN = fx.ThermalProperties(conductivity=0.4, density=900.0, heat_capacity=2100.0)


@pytest.mark.parametrize("kinematics", [fx.Axisymmetric(), pytest.param(fx.PlaneStrain(), marks=pytest.mark.thorough)])
def test_heat_stored_is_heat_given(kinematics):
    mesh = fx.mesh.disc(radius=5e-3, thickness=TWO, elements=(3, 2))
    run = fx.heat(mesh, {"core": SHEET, "skin": SKIN}, everything(), start=25.0, times=[1.0, 5.0], unit="C",
                  tolerance=1e-2, kinematics=kinematics)
    assert np.abs(run.balance).max() < 1e-10
    given = {name: heat.sum() for name, heat in run.heat_through.items()}
    area = np.pi * 5e-3**2 if kinematics.dimension_of_volume == 3 else 5e-3
    assert given["Absorption('top')"] == pytest.approx(area * 3000 * (1 - np.exp(-900 * D)) * 5, rel=1e-6)
    rim = 2 * np.pi * 5e-3 * D if kinematics.dimension_of_volume == 3 else D
    assert given["HeatFlux('rim')"] == pytest.approx(-200 * rim * 5, rel=1e-10)
    # the heat stored by density and heat capacity: two layers at their mean temperatures
    weight = (lambda R: 2 * np.pi * R) if kinematics.dimension_of_volume == 3 else (lambda R: 1)
    mesh = run.mesh
    T, dx = run.temperature(), ufl.Measure("dx", mesh.domain, subdomain_data=mesh.cells)
    R = ufl.SpatialCoordinate(mesh.domain)[0]
    stored = sum(fem.assemble_scalar(_compat.compile_form(c * (T - 25) * weight(R) * dx(mesh.layers[name])))
                 for name, c in (("core", 1050 * 1800.0), ("skin", 900 * 2100.0)))
    assert run.heat_stored.sum() == pytest.approx(stored, rel=1e-9)


def test_no_heat_flows_outside_the_contact_area():
    """A face half of which touches: the tool below the rest stays as it was, and only the touching half gives heat."""
    mesh = fx.mesh.disc(radius=0.04, thickness=D, elements=(8, 3))
    tool = fx.ConductingTool(thickness=0.01, back=30.0, **TOOL)
    body = body_of(mesh, [fx.ContactWithTool("bottom", conductance=300, tool=tool)], start=150.0)
    touch = body.tool_contacts[0]
    away = touch.points[:, 0] > 0.0201
    touch.conductance[away] = 0.0
    body.update()
    begin = body.start()
    found = stepping.step(body, begin, 0.2)
    lines = found.state[1]
    assert np.all(lines[away] == 0.0) and np.all(lines[~away, 0] > 1.0)
    far = body.points[:, 0] > 0.035
    assert np.abs(found.state[0][far] - 150).max() < 0.05 < 5 < np.abs(found.state[0] - 150).max()
    assert found.stored == pytest.approx(found.heats.sum(), rel=1e-10)
    touch.conductance[:] = 0.0                                  # and with none at all
    body.update()
    found = stepping.step(body, begin, 0.2)
    assert np.abs(found.state[0] - 150).max() < 1e-10 and np.all(found.heats == 0)


# the deformed body

def stretched(mesh, by):
    """Displacement of a disc stretched `by` in its plane, its volume kept."""
    u = fem.Function(fem.functionspace(mesh.domain, ("Lagrange", 2, (2,))))
    u.interpolate(lambda x: np.stack([(by - 1) * x[0], (by**-2 - 1) * x[1]]))
    return u


def test_a_stretched_sheet_is_a_thinner_one():
    """Forms in the reference, with k J F^-1 F^-T and Nanson's areas, against a mesh of the deformed sheet."""
    by, numbers = 1.5, []
    rest = fx.mesh.disc(radius=4e-3, thickness=D, elements=(2, 3))
    thin = fx.mesh.disc(radius=4e-3 * by, thickness=D / by**2, elements=(2, 3))
    laws = [law for law in everything() if not isinstance(law, fx.Radiation)]
    for mesh, u, reach in ((rest, stretched(rest, by), 1.0), (thin, None, by)):
        heater = fx.table({R * reach: T for R, T in ((0.0, 350.0), (1e-3, 380.0), (7e-3, 420.0))})     # R at rest
        body = body_of(mesh, [fx.Radiation("top", emissivity=0.9, heater=heater), *laws], displacement=u)
        state = fixed_steps(body, 5.0, 5)
        order = np.lexsort(np.round(body.points / body.points.max(0), 6).T)
        numbers.append(np.append(state[0][order], body.stored(state[0] - 25.0)))
    assert numbers[0] == pytest.approx(numbers[1], rel=1e-9)


def test_conduction_follows_a_changed_displacement():
    mesh = fx.mesh.disc(radius=4e-3, thickness=D, elements=(2, 3))
    u = stretched(mesh, 1.0)
    body, plain, fresh = (body_of(mesh, everything(), displacement=v) for v in (u, None, stretched(mesh, 1.4)))
    begin = body.start()
    first, same = (stepping.step(b, begin, 1.0).state[0] for b in (body, plain))
    assert first == pytest.approx(same, rel=1e-11)
    u.x.array[:] = stretched(mesh, 1.4).x.array
    body.update()
    after, right = (stepping.step(b, begin, 1.0).state[0] for b in (body, fresh))
    assert after == pytest.approx(right, rel=1e-12) and np.abs(after - first).max() > 0.1


def test_conduction_does_not_depend_on_rigid_rotation():
    mesh, c, s = fx.mesh.disc(radius=5e-3, thickness=TWO, elements=(2, 2)), np.cos(0.7), np.sin(0.7)
    u = fem.Function(fem.functionspace(mesh.domain, ("Lagrange", 2, (2,))))
    u.interpolate(lambda x: np.stack([c * x[0] - s * x[1] - x[0], s * x[0] + c * x[1] - x[1]]))
    bodies = [body_of(mesh, everything(), displacement=v, kinematics=fx.PlaneStrain(),
                      materials={"core": SHEET, "skin": SKIN}) for v in (None, u)]
    a, b = (fixed_steps(body, 2.0, 2)[0] for body in bodies)
    assert a == pytest.approx(b, rel=1e-11)
