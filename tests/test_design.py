"""Derivatives of runs by parameters of their script, and optimisation with them."""

from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

import formingx as fx

CAN = {"supports": [fx.Symmetry("axis"), fx.SimplySupported("rim")], "loads": [fx.Pressure("bottom")]}


def disc(c=0.0, h=0.05, height=0.6):
    """Return an inflated sheet with a constant c of a varying stiffness, a thickness h, and a height of the pole."""
    mesh = fx.mesh.disc(radius=1.0, thickness=h, elements=(8, 1))
    return fx.Scene(mesh=mesh, materials=fx.NeoHookean(c10=lambda R, Z: 0.5 * (1 + c * R**2)), **CAN), \
        fx.pole_height(height)


def programmed(h, model=None):
    """Return an inflated sheet whose thickness varies along the radius."""
    mesh = fx.mesh.disc(radius=1.0, thickness=lambda R: np.exp(h(R)) / 50, elements=(10, 1))
    return fx.Scene(mesh=mesh, materials=fx.NeoHookean(c10=0.5), model=model, **CAN), fx.pole_stretch(1.2)


def pole_wall(path):
    return path.profile().thickness[0]


def highest_pressure(path):
    return path["pressure"].max()


def test_derivatives_are_those_of_whole_runs():
    """Derivatives of pressure, wall and volume by constant, thickness and target agree with central differences."""
    design = fx.Design(disc, {"c": (0.0, -1, 1), "h": (0.05, 0.01, 0.1), "height": (0.6, 0.1, 1.0)})
    run, at = design.run(), {"c": 0.0, "h": 0.05, "height": 0.6}
    for measure, of in (("pressure", lambda run: run.path["pressure"][-1:]), ("wall", lambda run: run.wall)):
        by = run.derivative(measure)[1]
        for k, (name, dp) in enumerate({"c": 1e-3, "h": 1e-5, "height": 1e-4}.items()):
            above, below = (of(design.run({name: at[name] + s * dp})) for s in (1, -1))
            assert by[:, k] == pytest.approx((above - below) / (2 * dp), rel=2e-5, abs=1e-7)
    assert run.derivative(pole_wall)[1][0] == pytest.approx(run.derivative("wall")[1][0], rel=1e-12)
    volume, by = run.derivative("volume")
    assert volume == pytest.approx(np.pi * 0.05, rel=1e-9) and by[0] == pytest.approx([0, np.pi, 0], abs=1e-8)


def test_differences_of_whole_runs_are_the_derivatives():
    """Also of a measure of earlier states, at a bound, and in an executor; a run that fails is named."""
    ranges = {"c": (0.0, -1, 1), "h": (0.05, 0.01, 0.05), "height": (0.6, 0.1, 1.0)}
    exact, seen = fx.Design(disc, ranges).run(), []

    def build(c, h, height):
        seen.append(h)
        return disc(c, h, height)
    with ThreadPoolExecutor(1) as one:
        design = fx.Design(build, ranges, derivatives="runs", executor=one)
        run = design.run()
        for measure in ("wall", "pressure", "volume"):
            assert run.derivative(measure)[1] == pytest.approx(exact.derivative(measure)[1], rel=0.05, abs=2e-4)
        assert design.whole_runs.count == 3
        assert run.derivative(highest_pressure)[1].shape == (1, 3) and design.whole_runs.count == 6
        assert design.whole_runs.since(0)[1] == "6 for differences of whole runs, by the executor"
        assert max(seen) == 0.05 and min(seen) == pytest.approx(0.05 - 0.02 * 0.04)         # not beyond the bound
        answer = design.fit(even=True, start=run, max_runs=9)
    assert answer.cv[1] < answer.cv[0] and answer.paths <= 9 and answer.difference_runs > 0
    with pytest.raises(fx.InputError, match=r"no derivative by height: the run at 0.78, next to 0.6, fails: .*a=10"):
        fx.Design(lambda height: disc(height=height if height < 0.65 else fail("a=10")), {"height": (0.6, 0, 9)},
                  derivatives="runs").run().derivative("wall")
    with pytest.raises(fx.InputError, match=r"Design: derivatives 'difference' is not known; known: 'exact', 'runs'"):
        fx.Design(disc, ranges, derivatives="difference")


def fail(text):
    raise fx.InputError(text)


def heated(heater):
    """Return a sheet that heaters soften before it is blown."""
    mesh = fx.mesh.disc(radius=0.15, thickness=2e-3, elements=(4, [1, 1]))
    heat = fx.heat(mesh, fx.ThermalProperties(conductivity=0.17, density=1050.0, heat_capacity=1800.0), unit="C",
                   start=25.0, times=20.0, tolerance=5.0, boundaries=[
                       fx.Radiation(face, emissivity=0.7, heater=fx.table({0.0: heater, 0.15: 400.0}))
                       for face in ("top", "bottom")])
    softer = fx.NeoHookean(c10=fx.table({20.0: 5e6, 100.0: 1e6, 160.0: 2e5, 220.0: 5e4, 300.0: 2e4}))
    return fx.Scene(mesh=mesh, materials=softer, temperature=heat, **CAN), fx.pole_height(0.06)


@pytest.mark.slow
def test_derivative_by_a_heater_temperature_includes_radiation_and_conduction():
    """The derivative by a heater temperature includes radiation and conduction, which the user's function computes."""
    design = fx.Design(heated, {"heater": (430.0, 300, 500)})
    above, below = (design.run({"heater": heater}).wall for heater in (431, 429))
    by = design.run().derivative("wall")[1][:, 0]
    assert by == pytest.approx((above - below) / 2, abs=0.01 * abs(by).max())


def pushed(b, mu="none"):
    """Return a sheet that a ball is pushed into."""
    mesh = fx.mesh.disc(radius=1.0, thickness=0.05, elements=(8, 1))
    scene = fx.Scene(mesh=mesh, materials=fx.NeoHookean(c10=lambda R, Z: 0.5 * (1 + b * R**2)),
                     supports=[fx.Symmetry("axis"), fx.Clamped("rim")],
                     contacts=[fx.Contact("top", fx.tools.sphere(radius=0.8, z=0.05), mu, direction=(0, -1))])
    return scene, fx.travel(0.25)


def blown(b):
    """Return a sheet that relaxes as it is inflated."""
    mesh = fx.mesh.disc(radius=1.0, thickness=0.05, elements=(8, 1))
    relaxes = fx.Viscoelastic(fx.NeoHookean(c10=lambda R, Z: 0.5 * (1 + b * R**2)), branches=[(1.0, 1.0)])
    scene = fx.Scene(mesh=mesh, materials=relaxes, supports=CAN["supports"], loads=[fx.Pressure("bottom", name="air")])
    return scene, [fx.Stage("blow", control="air", until=fx.pressure(0.03), duration=1.0)]


@pytest.mark.parametrize("build", (
    lambda b: disc(c=b), pushed, pytest.param(blown, marks=pytest.mark.thorough), lambda b: pushed(0.0, 0.3 + b)),
                         ids=("elastic", "contact", "relaxing", "friction"))
def test_linearisation_error_is_of_second_order(build):
    """The error of the linearisation is of second order over two decades: elastic, in contact, in time, of friction."""
    design = fx.Design(build, {"b": (0.0, -1, 1)})
    run = design.run()
    wall, by = run.derivative("wall")
    steps = np.array([1e-1, 1e-2, 1e-3])
    left = [np.linalg.norm(design.run({"b": t}).wall - wall - t * by[:, 0]) for t in steps]
    assert np.diff(np.log(left)) / np.diff(np.log(steps)) == pytest.approx(2.0, abs=0.05)


def test_a_membrane_with_a_programmed_wall():
    """The derivative by the value at a knot agrees with central differences, for a membrane."""
    design = fx.Design(lambda h: programmed(h, fx.Membrane()), {"h": fx.spline(6, start=0.0, smooth=True)})
    by, h = design.run().derivative("wall")[1], 1e-3 * np.eye(6)[4]
    above, below = (design.run({"h": way * h}).wall for way in (1, -1))
    assert by[:, 4] == pytest.approx((above - below) / 2e-3, rel=1e-4, abs=1e-8)


def test_an_even_wall():
    """In at most 4 runs the wall is even; the thickness at the pole is then the wall times the stretch squared."""
    answer = fx.Design(programmed, {"h": fx.spline(6, start=0.0, low=-2, high=2, smooth=True)}).fit(even=True,
                                                                                                    min_change=1e-3)
    assert answer.paths <= 4 and answer.cv[0] > 0.03 and answer.cv[1] < 1e-3
    assert np.exp(answer.values["h"](0.0)) / 50 == pytest.approx(1.2**2 * answer.best.wall.mean(), rel=2e-3)
    assert answer.best.volume == pytest.approx(answer.before.volume, rel=1e-5)
    assert "unevenness" in str(answer) and abs(answer.predicted / answer.best.wall - 1).max() < 0.02


def test_wrong_arguments_of_designs_are_refused():
    def finer(n):
        return fx.Scene(mesh=fx.mesh.disc(radius=1.0, thickness=0.05, elements=(int(round(8 + 1e6 * n)), 1)),
                        materials=fx.NeoHookean(c10=0.5), **CAN), fx.pole_height(0.3)
    with pytest.raises(fx.InputError, match="changes the elements of the mesh"):
        fx.Design(finer, {"n": 0.0}).run().derivative("wall")
    design = fx.Design(disc, {"c": 0.0})
    with pytest.raises(fx.InputError, match="nothing to fit"):
        design.fit()
    with pytest.raises(fx.InputError, match="are both given: must be one of them"):
        design.fit(wall=0.04, even=True)
    for wall, words in ((lambda s: "a", "fit: wall: the function of arrays reference length fails: ValueError"),
                        (lambda s: 0.5 - s, "fit: wall: must be greater than 0 at all reference lengths")):
        with pytest.raises(fx.InputError, match=words):
            design.fit(wall=wall)
    with pytest.raises(fx.InputError, match="no parameter has an effect"):
        fx.Design(lambda b: disc(), {"b": 1.0}).fit(wall=0.04, volume=None)
    with pytest.raises(fx.InputError, match="parameter 'd' is not known"):
        design.run({"d": 1})
    with pytest.raises(fx.InputError, match="must return \\(scene, target\\)"):
        fx.Design(lambda c: disc()[0], {"c": 0.0}).run()
    with pytest.raises(fx.InputError, match="looks at earlier states"):
        fx.Design(disc, {"height": 1.4}).run().derivative(highest_pressure)
    for wrong, words in (((1, 2, 3), "must be from 2 to 3"), ((1, 2), "must be a number"),
                         ((1, 3, 0), "below the second")):
        with pytest.raises(fx.InputError, match=words):
            fx.Design(disc, {"c": wrong})
    with pytest.raises(fx.InputError, match="c = 'x': must be a number"):
        design.run({"c": "x"})
    run = fx.Design(disc, {"height": 0.3}).run()
    for wrong in (3, None, lambda path: "x", lambda path: np.nan):
        with pytest.raises(fx.InputError, match="must be 'wall', 'volume', a column"):
            run.derivative(wrong)
    for wrong in (-0.1, np.nan):
        with pytest.raises(fx.InputError, match="spread: height"):
            run.spread({"height": wrong})


@pytest.mark.thorough
def test_results_name_unattainable_targets_and_the_reason():
    """Results name a wall, a volume and a minimum wall that the bounds make unattainable, and the reason."""
    design = fx.Design(programmed, {"h": fx.spline(2, start=0.0, low=-0.3, high=0.3)})
    answer = design.fit(wall=1.0, volume=None)
    assert "within the bounds, would be 0.9 % better" in answer.reason
    wall = answer.best.wall
    assert f"the wanted wall was not reached: wanted 1, reached {wall.mean():.4g} on the mean" in str(answer)
    assert f"the largest deviation is {100 * (wall.min() - 1):+.3g} %, at reference length" in str(answer)
    assert "It is stopped by bounds: h" in str(answer) and "the volume" not in answer.missed
    lines = {line.get_label(): line.get_ydata() for line in answer.plot_wall().lines}
    assert np.all(lines["wanted"] == 1.0)
    wanted = 1.01 * design.run().wall.mean()
    near = design.fit(wall=wanted, volume=None, max_runs=3)
    assert near.target_wall.mean() == pytest.approx(wanted) and near.best.wall.mean() == pytest.approx(wanted, rel=1e-3)
    held = design.fit(wall=1.2 * design.run().wall.mean(), max_runs=3)
    assert "It is stopped by the volume, which is held at" in str(held)
    assert "the volume that was asked for, 99, was not reached" in str(design.fit(even=True, volume=99.0, max_runs=4))
    answer = design.minimum_weight(min_wall=1.0)
    assert "minimum wall that was asked for, 1, was not reached" in str(answer)
    assert answer.best.vector.min() > 0.2                              # as thick as may be, not as light


def cup(b, fillet=0.2):
    """Return a sheet that sticks to a cup where it touches it."""
    mesh = fx.mesh.disc(radius=1.0, thickness=0.03, elements=(12, 1))
    mould = fx.tools.cup(radius=1.0, depth=0.7, mouth=0.03, draft=10.0, fillet=fillet)
    return fx.Scene(mesh=mesh, materials=fx.NeoHookean(c10=lambda R, Z: 0.5 * (1 + b * (R**2 - 0.5))),
                    contacts=[fx.Contact("top", mould, "stick")], **CAN), fx.pressure(0.25)


def test_derivatives_include_the_change_of_gap_closure_times():
    """Derivatives of a sticking sheet agree with differences of runs; with constant steps they would be 0.04 wrong.

    Walls within an element of the rim or the axis scatter with the steps, and do not count.
    """
    design = fx.Design(cup, {"b": (0.0, -1, 1)})
    run = design.run()
    exact = run.derivative("wall")[1][:, 0] / 0.03
    above, below = (design.run({"b": b}).wall for b in (0.02, -0.02))
    assert abs(exact - (above - below) / 0.04 / 0.03)[2:-2].max() < 0.006
    assert exact[[3, 12, 19]] == pytest.approx([-0.13, -0.055, 0.11], abs=0.02)


def pot(mu, travel, relaxing=False):
    """Return a sheet that a plug with friction forms, then a low air pressure; it may relax."""
    mesh = fx.mesh.disc(radius=3.0, thickness=0.1, elements=(12, 1))
    plug = fx.tools.male(radius=1.5, height=8.0, base=-8.0, draft=3.0, fillet=0.8)
    sheet = fx.Viscoelastic(fx.NeoHookean(c10=0.5), branches=[(1.0, 2.0)]) if relaxing else fx.NeoHookean(c10=1.0)
    scene = fx.Scene(mesh=mesh, materials=sheet, supports=[fx.Symmetry("axis"), fx.Clamped("rim")],
                     loads=[fx.Pressure("bottom", name="air")],
                     contacts=[fx.Contact("bottom", plug, mu, direction=(0, 1), name="plug")])
    return scene, [fx.Stage("plug", control="plug", until=fx.travel(travel), speed=4.0 if relaxing else None),
                   fx.Stage("air", control="air", until=fx.pressure(0.03), duration=0.5 if relaxing else None)]


@pytest.mark.parametrize("relaxing", (False, pytest.param(True, marks=pytest.mark.slow)))
def test_stages_friction_and_time(relaxing):
    """Derivatives by friction and by the travel of the first stage agree with differences, also of a relaxing sheet."""
    at = {"mu": 0.3, "travel": 1.8}
    design = fx.Design(lambda **values: pot(**values, relaxing=relaxing), {"mu": (0.3, 0, 1), "travel": (1.8, 1, 2)},
                       step=fx.StepControl(target=8))
    by = design.run().derivative("wall")[1]
    for k, name in enumerate(at):
        above, below = (design.run({name: at[name] + h}).wall for h in (0.01, -0.01))
        whole = (above - below) / 0.02
        assert np.linalg.norm(by[:, k] - whole) < (0.02 if relaxing else 2e-3) * np.linalg.norm(whole), name


def hinged(c10, h, duration):
    """A relaxing sheet that is hinged at its rim, blown in a given time, then held."""
    scene = fx.Scene(mesh=fx.mesh.disc(radius=10.0, thickness=h, elements=(8, 1)),
                     materials=fx.Viscoelastic(fx.NeoHookean(c10=c10), [(0.4, 1.0)]), **{
                         **CAN, "loads": [fx.Pressure("bottom", name="air")]})
    return scene, [fx.Stage("blow", control="air", until=fx.pressure(0.005), duration=duration),
                   fx.Stage("hold", duration=1.0)]


@pytest.mark.parametrize("h, duration", [pytest.param(0.5, 1.0, marks=pytest.mark.thorough), (0.2, 0.1)])
def test_a_relaxing_sheet_that_is_hinged_has_derivatives(h, duration):
    """Its first states turn by round-off; the derivative is that of whole runs."""
    design = fx.Design(lambda c10, h: hinged(c10, h, duration), {"c10": (0.2, 0.1, 0.4), "h": (h, 0.1, 1.0)})
    by = design.run().derivative("pole_height")[1][0]
    for k, (name, step) in enumerate({"c10": 2e-4, "h": 2e-4}.items()):
        above, below = (design.run({"c10": 0.2, "h": h} | {name: {"c10": 0.2, "h": h}[name] + sign * step})
                        .path["pole_height"][-1] for sign in (1, -1))
        assert by[k] == pytest.approx((above - below) / (2 * step), rel=1e-3)


def test_dissipated_energy_has_no_derivative_and_is_kept():
    """It depends on all states; a derivative of the wall leaves the run and its energy balance as they are."""
    design = fx.Design(lambda mu, travel: pot(mu, travel, relaxing=True), {"mu": (0.2, 0, 1), "travel": (0.3, 0.1, 1)})
    run = design.run()
    before, balance = run.path["dissipated_energy"], run.path.work()["unbalanced"]
    run.derivative(lambda path: path.part().min_wall)
    assert before[-1] > 0 and np.array_equal(run.path["dissipated_energy"], before)
    assert np.array_equal(run.path.work()["unbalanced"], balance)
    for wrong in (run.derivative, lambda name: run.spread({"mu": 0.1}, name)):
        with pytest.raises(fx.InputError, match="this column 'dissipated_energy' looks at earlier states"):
            wrong("dissipated_energy")


def pressed(c10, nose, travel, force=None):
    """Return a sheet that a ball without friction is pushed into, to a travel or to a force."""
    mesh = fx.mesh.disc(radius=40.0, thickness=1.2, elements=(10, 1))
    ball = fx.tools.sphere(radius=nose).mirrored()
    scene = fx.Scene(mesh=mesh, materials=fx.NeoHookean(c10=c10), supports=[fx.Symmetry("axis"), fx.Clamped("rim")],
                     contacts=[fx.Contact("bottom", ball, "none", direction=(0, 1), name="plug")])
    return scene, [fx.Stage("down", control="plug", until=fx.force(force) if force else fx.travel(travel))]


def test_forces_of_tools():
    """Derivatives of a tool force are exact for a constant that it is linear in, and agree with differences of runs."""
    at = {"c10": 0.25, "nose": 15.0, "travel": 14.0}
    design = fx.Design(pressed, {"c10": 0.25, "nose": (15.0, 10, 18), "travel": (14.0, 8, 18)})
    force, by = design.run().derivative("plug_force")
    assert by[0, 0] == pytest.approx(force[0] / 0.25, rel=2e-5)
    for k, (name, h) in enumerate({"nose": 0.1, "travel": 0.1}.items(), start=1):
        above, below = (design.run({name: at[name] + s * h}).path["plug_force"][-1] for s in (1, -1))
        assert by[0, k] == pytest.approx((above - below) / (2 * h), rel=3e-3), name
    to_force = fx.Design(lambda c10: pressed(c10, 15.0, None, force[0]), {"c10": (0.25, 0.1, 0.5)}).run()
    assert to_force.derivative("plug_force")[1].item() == pytest.approx(0.0, abs=1e-4 * force[0] / 0.25)
    assert to_force.derivative("travel")[1].item() == pytest.approx(-by[0, 0] / by[0, 2], rel=1e-4)


def test_runs_of_designs_do_not_change_the_scene():
    """Runs of designs take one node per step, but the contact of the user's scene does not change."""
    mould = fx.Contact("top", fx.tools.plane(0.3), "stick")

    def build(c10):
        return fx.Scene(mesh=fx.mesh.disc(radius=1.0, thickness=0.05, elements=(8, 1)), contacts=[mould], **CAN,
                        materials=fx.NeoHookean(c10=c10)), fx.pressure(0.06)
    run = fx.Design(build, {"c10": (0.5, 0.4, 0.6)}).run()
    assert mould.nodes_per_step is None and not run.path.problem.contact.limit.predicts_events


@pytest.mark.thorough
def test_a_stage_that_waits_ends_where_its_target_is_met():
    """Of a sheet that creeps under its weight, the derivative of the time to a given sag agrees with differences."""
    creeps = fx.TransientNetwork(fx.NeoHookean(c10=1e-6), [(1.0, 2.0)])

    def sagging(weight):
        mesh = fx.mesh.disc(radius=1.0, thickness=1e-3, elements=(8, 1))
        scene = fx.Scene(mesh=mesh, materials=creeps, supports=CAN["supports"], model=fx.Membrane(),
                         loads=[fx.Gravity(1.0, value=weight)])
        return scene, [fx.Stage("sag", until=fx.sag(0.05), duration=60.0)]
    design = fx.Design(sagging, {"weight": (1e-4, 5e-5, 2e-4)})
    run = design.run()
    above, below = (design.run({"weight": weight}).path.last.time for weight in (1.01e-4, 0.99e-4))
    assert run.derivative(lambda path: path.last.time)[1].item() == pytest.approx((above - below) / 2e-6, rel=2e-3)
    assert abs(run.derivative("sag")[1].item()) < 1e-6


def test_runs_without_derivatives_name_the_reason():
    """A run with a stage that keeps a quantity constant in the presence of friction refuses derivatives."""
    def held(mu):
        scene, stages = pot(mu, 1.0)
        return scene, [*stages[:1], fx.Stage("hold", control="air", constant=fx.pole_height(1.05), duration=1.0)]
    run = fx.Design(held, {"mu": (0.3, 0, 1)}, step=fx.StepControl(target=8)).run()
    with pytest.raises(fx.InputError, match="no derivative: there is none yet for a stage that follows"):
        run.derivative("wall")


def test_spread_and_table():
    run = fx.Design(disc, {"c": (0.0, -1, 1), "h": (0.05, 0.01, 0.1)}).run()
    by = run.derivative("wall")[1]
    assert run.spread({"c": 0.1, "h": 0.002}) == pytest.approx(np.hypot(0.1 * by[:, 0], 0.002 * by[:, 1]))
    assert "c" in str(run.sensitivities("wall")) and run.sensitivities("pressure").jacobian.shape == (1, 2)
    with pytest.raises(fx.InputError, match="parameter 'mu' is not known"):
        run.spread({"mu": 0.1})


@pytest.mark.thorough
def test_covariance_of_a_fit():
    """Standard deviations use the covariance of correlated constants of a fit, and add an independent thickness.

    The pressure of a membrane at a given height is proportional to the modulus and to the thickness.
    """
    def inflated(c10, c01, h):
        return fx.Scene(mesh=fx.mesh.disc(radius=1.0, thickness=h, elements=(8, 1)), loads=[fx.Pressure("bottom")],
                        materials=fx.MooneyRivlin(c10=c10, c01=c01), model=fx.Membrane(),
                        supports=[fx.Symmetry("axis"), fx.SimplySupported("rim")]), fx.pole_height(0.6)
    fit = fx.fit(fx.MooneyRivlin, fx.treloar1944(), within=(1, 3))
    run = fx.Design(inflated, {**fit.constants, "h": 0.01}).run()
    by = run.derivative("pressure")[1][0]
    expected = np.sqrt(by[:2] @ fit.covariance @ by[:2])
    assert run.spread(fit, "pressure")[0] == pytest.approx(expected, rel=1e-12)
    independent = np.hypot(*(by[:2] * list(fit.errors.values())))
    assert expected < 0.8 * independent                                  # the constants make up for each other
    assert run.spread(fit.errors, "pressure")[0] == pytest.approx(independent, rel=1e-12)
    band = run.band([fit, {"h": 2e-4}], "pressure")
    pressure = run.path["pressure"][-1]
    assert band.deviation[0] == pytest.approx(np.hypot(expected, 0.02 * pressure), rel=1e-4)
    assert band.high[0] - pressure == pytest.approx(1.96 * band.deviation[0], rel=1e-3)
    assert "deviation" in str(band) and run.band(fit).plot().get_ylabel() == "wall"
    with pytest.raises(fx.InputError, match="band: confidence = 0: must be between 0 and 1"):
        run.band(fit, confidence=0)
    with pytest.raises(fx.InputError, match="parameter 'c10' is not known; known: c01, h"):
        fx.Design(lambda c01, h: inflated(0.2, c01, h), {"c01": 0.01, "h": 0.01}).run().spread(fit)
    bare = fx.fit(fx.MooneyRivlin, {"uniaxial": ([1.5, 2.0], [0.3, 0.5])})       # as many points as constants
    with pytest.raises(fx.InputError, match="leave c10, c01 open"):
        run.spread(bare)
    with pytest.raises(fx.InputError, match="must be .parameter: standard deviation., a Fit"):
        run.spread([0.1])


@pytest.mark.thorough
def test_report_shows_standard_deviations(tmp_path):
    run = fx.Design(disc, {"c": (0.0, -1, 1), "h": (0.05, 0.01, 0.1)}).run()
    text = run.report(tmp_path / "run.html", deviations={"h": 0.002}).read_text()
    assert "How sure" in text and "volume" in text and "pressure" in text
    assert "How sure" not in run.report(tmp_path / "run.html").read_text()


def test_report_of_a_parameter_without_bounds(tmp_path):
    run = fx.Design(disc, {"c": (0.0, -1, 1), "h": 0.05}).run()
    text = run.report(tmp_path / "run.html").read_text()
    assert "inf</td>" not in text and text.count("<td class=number></td>") == 2
    assert "of its start value if a bound is missing" in text


def test_minimum_weight():
    """The smallest wall equals the required minimum, no wall is much larger, and the volume decreases."""
    design = fx.Design(programmed, {"h": fx.spline(4, start=0.0, low=-1, high=1)})
    answer = design.minimum_weight(min_wall=0.012, max_runs=10)
    assert answer.best.wall.min() == pytest.approx(0.012, rel=2e-3)
    assert answer.best.volume < 0.95 * answer.before.volume
    assert answer.best.wall.max() < 0.0125


@pytest.mark.thorough
def test_minimum_weight_keeps_a_parameter_without_effect():
    """A modulus changes no wall at a given height, but for round-off: the search leaves it at its start."""
    def build(h, modulus):
        mesh = fx.mesh.disc(radius=1.0, thickness=lambda R: np.exp(h(R)) / 50, elements=(10, 1))
        return fx.Scene(mesh=mesh, materials=fx.Gent(mu=modulus, Jm=50.0), **CAN), fx.pole_height(0.6)
    design = fx.Design(build, {"h": fx.spline(3, start=0.0, low=-1, high=1), "modulus": (0.6, 0.2, 2.0)})
    answer = design.minimum_weight(min_wall=0.012, max_runs=6)
    assert answer.best.vector[-1] == 0.6 and "modulus at its" not in str(answer)
    assert answer.best.volume < 0.98 * answer.before.volume


@pytest.mark.thorough
def test_report(tmp_path):
    """Reports of a search and of a run are single files with pictures, bounds and parameters without effect."""
    design = fx.Design(lambda h, idle: programmed(h), {"h": fx.spline(4, 0.0, -0.04, 1.0), "idle": (1.0, 0.0, 2.0)})
    answer = design.fit(even=True, max_runs=3)
    assert answer.attainable() <= answer.cv[1] + 1e-6
    text = answer.report(tmp_path / "answer.html", "Even <cap>", deviations={"h": 0.01}).read_text()
    for word in ("Even &lt;cap&gt;", "unevenness", "At bounds: h[", "lowest", "Without effect on the wall: idle"):
        assert word in text, word
    assert text.count("data:image/png") == 4 and "http" not in text.split("<body>")[1]
    assert "data:image/png" in answer.best.report(tmp_path / "run.html").read_text()
    axes = answer.best.sensitivities("wall").plot()
    assert [label.get_text() for label in axes.get_yticklabels()] == answer.best.parameters.names


def chilled(start):
    """Return a hot sheet that a cold ball is pushed into, with friction; air cools it, too."""
    mesh = fx.mesh.disc(radius=50.0, thickness=2.0, elements=(8, 1))
    polymer = fx.ThermalProperties(conductivity=0.2e-3, density=1e-3, heat_capacity=2.0)
    cooling = fx.Cooling(polymer, [fx.Convection("top", h=5e-5, air=25.0)], unit="C", tools={"ball": (1e-4, 40.0)})
    softens = fx.NeoHookean(c10=fx.table({20.0: 0.5, 80.0: 0.3, 120.0: 0.1, 160.0: 0.05, 200.0: 0.04}))
    scene = fx.Scene(mesh=mesh, materials=softens, temperature=start, heat=cooling,
                     supports=[fx.Symmetry("axis"), fx.Clamped("rim")],
                     contacts=[fx.Contact("top", fx.tools.sphere(radius=20.0, z=2.0), 0.2, direction=(0, -1),
                                          name="ball")])
    return scene, [fx.Stage("push", control="ball", until=fx.travel(25.0), duration=2.0)]


@pytest.mark.thorough
def test_derivative_of_the_force_on_a_cooled_sheet_under_a_ball():
    """The force falls by 1.7 % a degree; the derivative holds the heat that is conducted away in each step."""
    design = fx.Design(chilled, {"start": (150.0, 100, 200)}, step=fx.StepControl(largest=0.05))
    above, below = (design.run({"start": 150.0 + s}).path["tool_force"][-1] for s in (1, -1))
    force, by = design.run().derivative("tool_force")
    assert by[0, 0] == pytest.approx((above - below) / 2, rel=3e-3) and by[0, 0] / force[0] < -0.01
