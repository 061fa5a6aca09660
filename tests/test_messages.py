"""Messages for wrong input: the error names the argument, its value and the allowed values, before any solve."""

import math
from decimal import Decimal
from fractions import Fraction
from functools import partial

import numpy as np
import pytest
import ufl
from conftest import treloar

import formingx as fx
from formingx.tools.shapes import Arc, Line

MESH = {"radius": 1.0, "thickness": 0.1, "elements": (4, 1)}
NONE = np.array([])
L, P = np.array([1.1, 1.5, 2.0]), np.array([0.1, 0.4, 0.7])
RUBBER, GENT, P0 = fx.NeoHookean(c10=0.05), fx.Gent(mu=1.0, Jm=1.0), [(0.5, 1.0)]
GOOD, T = {"a": [0, 1, 2], "b": [0, 1, 4]}, np.linspace(0, 6, 30)
CURVE = fx.table({130: 2.0, 150: 0.6, 160: 0.6, 170: 0.2})
CUP = fx.tools.cup(radius=1.25, depth=0.4, mouth=0.1, fillet=0.1)


def scene(**change):
    arguments = {"mesh": fx.mesh.disc(**MESH), "materials": {"sheet": fx.NeoHookean(c10=1.0)},
                 "supports": [fx.Symmetry("axis"), fx.Clamped("rim")], "loads": [fx.Pressure("bottom")]}
    return fx.Scene(**{**arguments, **change})


def of(call, rows):
    """The rows of calls that differ in their arguments."""
    return [(partial(call, *arguments), words) for *arguments, words in rows]


REFUSED = [
    # meshes, materials, parts of a scene, scenes, runs
    *of(lambda change: fx.mesh.disc(**{**MESH, **change}), [
        ({"radius": 0.0}, "radius = 0.0.*greater than 0"),
        ({"radius": math.nan}, "radius = nan.*finite"),
        ({"radius": "wide"}, "radius = 'wide'.*number"),
        ({"thickness": -0.1}, "thickness.*-0.1.*greater than 0"),
        ({"thickness": {}}, "at least one layer"),
        ({"elements": (0, 1)}, "elements along the radius = 0.*at least 1"),
        ({"elements": (4, 1.5)}, "elements.*1.5.*whole number"),
        ({"elements": 4}, "elements = 4.*along the radius"),
        ({"grading": 0}, "grading = 0.*greater than 0"),
        ({"inner_radius": 2.0}, "inner_radius = 2.0.*below radius"),
        ({"thickness": {"a": 1, "b": 1}, "elements": (4, (1, 1, 1))}, "2 layers need as many")]),
    *of(lambda change: scene(**change), [
        ({"loads": [fx.Pressure("axis")]}, r"Pressure\('axis'\): .* lies on the axis R = 0 and has no area"),
        ({"contacts": [fx.Contact("axis", CUP)]}, "Contact.*'axis'.* lies on the axis R = 0 and has no area"),
        ({"loads": [fx.Gravity({"shet": 1e-9})]}, r"Gravity\(\): density: layer 'shet' is not known; known: 'sheet'"),
        ({"supports": [fx.Symmetry("axis"), *2 * [fx.SimplySupported("rim")]]}, "another support already constrains")]),
    (lambda: fx.trace(scene(), until=fx.pole_height(0.1), progress=False).part(units="mm"), "units = 'mm': must be"),
    (lambda: fx.trace(scene(), until=fx.pole_height(1.0), intermediate=fx.pole_height(0.5)),
     r"intermediate = Target\(pole height = 0.5\): must be a list"),
    (lambda: fx.Arrhenius(60, 150.0, unit="C"), "activation_energy = 60: must be in J/mol, at least 1000"),
    (lambda: fx.NeoHookean(c10=0.0), "no stiffness"),
    (lambda: fx.mesh.read("a\0b.msh"), "must be the name of a file"),
    (lambda: fx.MooneyRivlin(c10=1.0, c01=-0.1), "not stable.*c01"),
    (lambda: fx.MooneyRivlin(c10=0.0, c01=0.0), "no stiffness"),
    (lambda: fx.Yeoh(c10=1.0, c20=-1e300, c30=0.1), "c20 greater than .* = -0.547"),
    (lambda: fx.Ogden(mu=(1.0, 1.0), alpha=(2.0,)), "as many"),
    (lambda: fx.Hyperelastic(lambda I1, I2, a: a * (3 - I1), a=1.0), "no stiffness"),
    (lambda: fx.Hyperelastic(lambda I1, I2, a: a * I1, b=1.0), r"constants \['a'\]"),
    (lambda: fx.Hyperelastic(lambda I1, I2: None), "energy fails"),
    (lambda: fx.Hyperelastic(lambda I1, I2, a: a[0], a=1.0), "energy fails: .*"),
    (lambda: fx.Hyperelastic(lambda F: F, of="F"), r"shape \(3, 3\): must be a UFL scalar"),
    (lambda: fx.Hyperelastic("I1 - 3"), "energy = 'I1 - 3'.*function"),
    (lambda: fx.displacement(1.0, at=(0, 0), component=np.array([1.0, 2.0])), "component = .*'r' or 'z'"),
    (lambda: fx.SimplySupported("rim", weight=np.zeros(2)), "weight = .*'area' or 'stiffness'"),
    (lambda: fx.Symmetry("axis", normal=np.zeros(2)), "normal = .*'r' or 'z'"),
    (lambda: fx.MixedPressure(eps=-1e-3), "eps = -0.001.*negative"),
    (lambda: fx.DisplacementPenalty(eps=0), "eps = 0.*greater than 0"),
    (lambda: fx.DisplacementPenalty(points=5), "points = 5.*3, 4, 7"),
    (lambda: fx.Pressure("bottom", math.nan), "Pressure.*nan.*finite"),
    (lambda: fx.Symmetry("axis", normal="w"), "normal = .w.*.r. or .z."),
    (lambda: fx.pole_stretch(-1), "pole_stretch = -1.*greater than 0"),
    (lambda: fx.mesh.read("no such file.msh"), "not there"),
    (lambda: fx.DisplacementPenalty(stress_free=NONE), "stress_free = .*True or False"),
    (lambda: fx.Tool([(0, 0), (1, 0)], closed=NONE), "closed = .*True or False"),
    (lambda: fx.StepControl(largest=NONE), "largest = .*must be a number"),
    (lambda: fx.Contact("top", fx.tools.plane(z=1.0), points=NONE), "points = .*must be a number"),
    (lambda: fx.Clamped(None), "Clamped: on = None: must be the name of a boundary"),
    (lambda: fx.Pressure(None), "Pressure: on = None: must be the name of a boundary"),
    (lambda: fx.Contact(None, fx.tools.plane(z=1.0)), "Contact: on = None: must be the name of a boundary"),
    *of(lambda change: scene(**change), [
        ({"materials": {}}, "'sheet' has no material"),
        ({"materials": {"sheet": RUBBER, "skin": RUBBER}}, "layer 'skin'.*known: 'sheet'"),
        ({"materials": {"sheet": 2.0}}, "must be a formingx material"),
        ({"loads": [fx.Pressure("botom")]}, "'botom' is not known; known: 'axis', 'rim', 'bottom', 'top'"),
        ({"supports": [fx.Symmetry("axis")]}, "too little support.*translation along Z"),
        ({"supports": [fx.Clamped("rim")]}, "touches the axis"),
        ({"loads": [fx.Pressure("bottom"), fx.Pressure("top")]}, "one control drives a run"),
        ({"mesh": "disc"}, "mesh = 'disc'"),
        ({"quadrature_degree": 0}, "quadrature_degree = 0"), ({"quadrature_degree": 1e300}, "must be at most 30")]),
    (lambda: fx.trace(scene(), until=fx.pressure(0.1), progress=np.zeros(2)), "progress = .*must be True or False"),
    (lambda: fx.trace(scene(), until=fx.pressure(0.1), remesh=fx.instability()),
     "remesh = .*must be a formingx.Remesh"),
    (lambda: fx.Process(scene()).run([fx.Stage("a", duration=1.0)], remesh=fx.instability()),
     "Process: remesh = .*must be a formingx.Remesh"),
    (lambda: fx.trace(scene(), until=fx.pressure(0.1), stop_at=fx.Remesh(size=0.1)),
     "stop_at = Remesh.*must be fx.instability"),
    (lambda: fx.solve(scene(), to=0.1, increments=10**12),
     "increments = 1000000000000: must be at most max_steps = 1000"),
    (lambda: fx.trace(scene(), until=fx.pressure(-1e99), progress=False),
     "pressure = -1e.99: it is 5e.98 times the shear modulus, 2"),
    (lambda: scene(supports=[fx.PinnedNode(0.0, 0.0)], kinematics=fx.PlaneStrain()), "too little support.*rotation"),
    (lambda: scene(supports=[fx.Symmetry("axis")], kinematics=fx.PlaneStrain()),
     "too little support.*translation along Z"),
    (lambda: fx.trace(scene(supports=[fx.Symmetry("axis"), fx.PinnedNode(0.123, 0.456)]), until=fx.pressure(0.1)),
     "no node"),
    (lambda: fx.trace(scene(loads=[fx.Pressure("bottom", 0.1)]), until=fx.pressure(1.0)), "nothing is driven"),
    (lambda: fx.solve(scene(loads=[fx.Pressure("bottom", 0.1)]), to=1.0), "nothing is driven"),
    (lambda: scene(contacts=[fx.Contact("top", CUP.reversed())]), r"starts inside the tool.*use tool.reversed\(\)"),
    (lambda: scene(contacts=[fx.Contact("bottom", fx.tools.sphere(radius=0.2), direction=(0, 1))]),
     r"starts inside the tool.*upside down: use tool.mirrored\(\)"),
    (lambda: scene(contacts=[fx.Contact("bottom", fx.tools.male(radius=0.3, height=0.2), direction=(0, 1))]),
     r"starts inside the tool.*move it away from the body \(tool.moved\)"),
    (lambda: scene(supports=[fx.Symmetry("axis")], contacts=[fx.Contact("top", CUP)]),
     "too little support.*translation along Z.*tools hold only what touches them.*model one half"),
    (lambda: fx.Design(lambda wall: (scene(mesh=fx.mesh.disc(radius=60.0, thickness=wall, elements=(4, 1))),
                                     fx.pressure(0.1)), {"wall": fx.spline(3, 1.0)}).run(),
     "the profile was called with .*: must be a length from 0 to 1; divide by the length of the body"),
    # materials
    (lambda: fx.Ogden(mu=1.0, alpha=-2.0), r"mu = 1.0, alpha = -2.0 has mu alpha <= 0.*mu alpha > 0"),
    (lambda: fx.Ogden(mu=1.0, alpha=0.0), "mu alpha <= 0"),
    (lambda: fx.Ogden(mu=(1.0, 0.1), alpha=(2.0, -2.0)), "not stable.*mu alpha > 0"),
    (lambda: fx.Ogden(mu=np.array("x"), alpha=2.0), "must be a number"),
    (lambda: fx.Ogden(mu=(1.0, math.inf), alpha=(2.0, 3.0)), "mu2 = inf: must be a finite number"),
    (lambda: fx.MooneyRivlin(c10=math.nan, c01=0.1), "c10 = nan: must be a finite number"),
    (lambda: fx.MooneyRivlin(c10=1.0, c01="soft"), "c01 = 'soft': must be a number"),
    (lambda: fx.Yeoh(c10=1.0, c20=0.0, c30=-1e-3), "not stable.*c30 must be at least 0"),
    (lambda: fx.Yeoh(c10=1.0, c20=-1e-9, c30=0.0), "not stable"),
    (lambda: fx.Yeoh(c10=1.0, c20=math.nan, c30=0.0), "c20 = nan: must be a finite number"),
    (lambda: fx.Yeoh(c10=-1.0, c20=0.0, c30=0.0), "c10 = -1.0: must be greater than 0"),
    (lambda: fx.Gent(mu=1.0, Jm=0.0), "Jm = 0.0: must be greater than 0"),
    (lambda: fx.Gent(mu=math.inf, Jm=1.0), "mu = inf: must be a finite number"),
    (lambda: fx.ArrudaBoyce(mu=1.0, N=1.0), "N = 1.0: must be greater than 1"),
    (lambda: fx.ArrudaBoyce(mu=0.0, N=9.0), "mu = 0.0: must be greater than 0"),
    (lambda: fx.Hyperelastic(lambda I1, I2, a: a * ufl.bessel_I(0, I1), a=1.0), "contains BesselI"),
    (lambda: fx.Hyperelastic(lambda F, a: a * F[0, 0] ** 2, of="F", a=1.0), "no stiffness"),
    (lambda: fx.Hyperelastic(lambda F, a: a * (ufl.inner(F, F) - 3 + (F[0, 0] ** 2 - 1) ** 2), of="F", a=1.0).stress(
        "uniaxial", 2), "not isotropic"),
    (lambda: fx.NeoHookean(c10=1.0).stress("shear", 2.0), "mode 'shear' is not known; known: 'uniaxial'"),
    (lambda: fx.NeoHookean(c10=1.0).stress("uniaxial", [2.0, -1.0]), "stretch of -1: .*greater than 0"),
    (lambda: fx.NeoHookean(c10=1.0).stress("uniaxial", math.nan), "stretch of nan: .*finite"),
    (lambda: fx.NeoHookean(c10=1.0).stress("uniaxial", "far"), "'far': must be numbers"),
    (lambda: fx.NeoHookean(c10=1.0).check_stability((0.0, 2.0)), "stretch = 0.0: must be greater than 0"),
    (lambda: fx.NeoHookean(c10=1.0).check_stability(3.0), "3.0: must be a range"),
    (lambda: fx.Ogden([1.0], [2.0]), r"Ogden: too many positional arguments: must be Ogden\(mu=\.\.\., alpha=\.\.\.\)"),
    (lambda: fx.NeoHookean(1.0), r"must be NeoHookean\(c10=\.\.\.\)"),
    (lambda: fx.MooneyRivlin(c10=1.0), "missing a required argument: 'c01'"),
    (lambda: fx.Gent(mu=1.0, jm=2.0), r"must be Gent\(mu=\.\.\., Jm=\.\.\.\)"),
    (lambda: fx.Viscoelastic(), r"must be Viscoelastic\(equilibrium, branches, order.*, shift"),
    # meshes
    *of(lambda lines: fx.mesh.from_lines(*lines), [
        ([[(0, 0)], [(0, 1)]], "at least two points"), ([[(0, 0), (1, 0)], [(0, 1), (1, 1), (2, 1)]], "as many"),
        ([[(0, 0), (1, 0)], [(0, 1), (1, -1)]], "from_lines"), ([[(0, 0), (1, 0)], [(0, 0), (1, 1)]], "from_lines"),
        ([[(0, 0), (1, math.nan)], [(0, 1), (1, 1)]], "finite")]),
    *of(lambda wrong: fx.mesh.disc(**{"radius": 1.0, "thickness": 0.1, "elements": (10, 1), **wrong}), [
        ({"concentrate": 0.3}, r"concentrate = 0.3: must be \{reference radius: relative size\}"),
        ({"concentrate": {}}, "concentrate = {}: must be"),
        ({"concentrate": {1.2: 0.1}}, "concentrate: radius = 1.2: must be from 0.0 to 1.0"),
        ({"concentrate": {0.3: 0}}, "concentrate at 0.3 = 0: must be greater than 0"),
        ({"concentrate": {0.3: 1.5}}, "concentrate at 0.3 = 1.5: must be from 1e-6 to 1"),
        ({"concentrate": {"here": 0.1}}, "concentrate: radius = 'here': must be a number"),
        ({"concentrate": {0.3: 0.1}, "grading": 0.5}, "grading = 0.5 and concentrate = {0.3: 0.1}: give one"),
        ({"concentrate": {0.3: 0.1, 0.6: 0.1}, "elements": (2, 1)}, "along the radius = 2: must be at least 3")]),
    *of(lambda through: fx.mesh.disc(radius=1.0, thickness=0.1, elements=(3, through)), [
        ([1, -2], "relative size of an element through a layer = -2: must be greater than 0"),
        ([1, 1e7], "largest at most 1e6 times"), ([[]], "must be at least one"), (10**18, "must be at most 250000"),
        ([1, "x"], "relative size of an element through a layer = 'x'")]),
    *of(lambda wrong: fx.mesh.sphere(**{"inner_radius": 1.0, "thickness": 0.5, **wrong}), [
        ({"inner_radius": 0.0}, "sphere: inner_radius = 0.0: must be greater than 0"),
        ({"thickness": {"x": -1}}, "sphere: thickness of 'x' = -1"),
        ({"thickness": {"x": 1, "y": 1}, "elements": (4, (1, 2, 3))}, "sphere: elements through the layers"),
        ({"elements": 4}, "along the meridian")]),
    *of(lambda wrong: fx.mesh.disc(radius=1.0, thickness=0.1, elements=(10, 1)).with_part(**{
        "name": "plug", "of": "top", "within": (0, 0.5), **wrong}), [
        ({"name": "rim"}, "name = 'rim': must be a word that no boundary has yet; there are 'axis', 'rim'"),
        ({"of": "lid"}, "boundary 'lid' is not known"),
        ({"within": (0.5, 0)}, "the first must be below the second"),
        ({"within": (0, 0.45)}, "cuts the element edge from r = 0.4 to 0.5: both must be r of nodes"),
        ({"within": (2, 3)}, r"'top' has nothing there; its r is from 0 to 1"),
        ({"within": 1}, "within = 1"),
        ({"along": "x"}, "along 'x' is not known")]),
    *of(lambda wrong: fx.mesh.parison(**{"inner_radius": 1.0, "thickness": 0.5, "length": 2.0, **wrong}), [
        ({"length": 0}, "parison: length = 0: must be greater than 0"),
        ({"elements": (1, 1)}, "must be at least 2"),
        ({"inner_radius": -1}, "parison: inner_radius = -1")]),
    *of(lambda thickness: fx.mesh.disc(radius=1.0, thickness=thickness, elements=(4, 1)), [
        ({0: 0.1, 0.9: 0.2}, "must cover R from 0 to 1"), ({0: 0.1}, "must cover R from 0 to 1"),
        (lambda R: 0.5 - R, r"thickness of 'sheet' at R = 0.5 = 0.0: must be greater than 0"),
        (lambda R: "thick", "must be a number"),
        (lambda R: R.x, "R = 0: the function raised AttributeError: 'float'"),
        ({0: 0.1, 1: -1}, "at R = 1 = -1: must be greater"),
        ({"a": {0: 0.1, 2: math.nan}}, "'a' at R = 2 = nan")]),
    # integral laws
    (lambda: fx.KBKZ([]), "at least one"),
    (lambda: fx.KBKZ([(1.0, 0)]), "tau_1 = 0: must be greater than 0"),
    (lambda: fx.KBKZ([(1.0,)]), "number 1 is"),
    (lambda: fx.KBKZ(P0, damping=3.0), "must be PSM"),
    (lambda: fx.PSM(alpha=0, beta=0.1), "alpha = 0: must be greater than 0"),
    (lambda: fx.PSM(alpha=1, beta=2), "beta = 2: must be from 0 to 1"),
    (lambda: fx.Wagner(alpha=-1, beta=1), "alpha = -1: must be from 0 to 1"),
    (lambda: fx.KBKZ(P0).stress("shear", [1, 2], times=[0, 1]), "'shear' is not known"),
    (lambda: fx.KBKZ(P0).stress("uniaxial", [1, 2], times=[1, 0]), "times must not fall"),
    (lambda: fx.KBKZ(P0).stress("uniaxial", [1, -2]), "stretch = -2"),
    (lambda: fx.KBKZ(P0).constant_rate("uniaxial", 0, [2.0]), "rate = 0"),
    # relaxing materials
    (lambda: fx.Viscoelastic(RUBBER, []), "branches = .*must be at least one"),
    (lambda: fx.Viscoelastic(RUBBER, [(0.5, 0.0)]), "tau_1 = 0.0: must be greater than 0"),
    (lambda: fx.Viscoelastic(RUBBER, [(0.5, 1.0), (-1, 1)]), "mu_2 = -1.0: must be greater than 0"),
    (lambda: fx.Viscoelastic(RUBBER, [(0.5, 1.0, 2.0)]), "number 1 is .0.5, 1.0, 2.0.: must be .mu, tau."),
    (lambda: fx.Viscoelastic(RUBBER, 3), "must be a list of .mu, tau."),
    (lambda: fx.Viscoelastic("rubber", P0), "must be a material, or None"),
    (lambda: fx.Viscoelastic(fx.Viscoelastic(RUBBER, P0), P0), "must not relax itself"),
    (lambda: fx.Viscoelastic(RUBBER, P0, order=3), "order 3 is not known"),
    (lambda: fx.Viscoelastic(RUBBER, P0, shift=3.0), "tau_1: shift = 3.0: must be WLF"),
    (lambda: fx.Viscoelastic(fx.Hyperelastic(lambda I1, I2, mu_1: mu_1 * (I1 - 3), mu_1=1.0), P0), "a constant 'mu_1'"),
    (lambda: fx.Viscoelastic(RUBBER, P0).stress("uniaxial", [1, 2], times=[0]), "a time for each"),
    (lambda: fx.Viscoelastic(RUBBER, P0).stress("uniaxial", [1, 2], times=[1, 0]), "times must not fall"),
    (lambda: fx.Viscoelastic(RUBBER, P0).stress("uniaxial", [1, -2], times=[0, 1]), "point 1.*greater than 0"),
    (lambda: fx.Viscoelastic(RUBBER, P0).stress("uniaxial", [1, 2], times=[0, 1], between="time"),
     "'time' is not known"),
    (lambda: fx.Viscoelastic(RUBBER, P0).relaxation("uniaxial", 2, [-1]), "must not be negative"),
    (lambda: fx.Viscoelastic(RUBBER, P0).constant_rate("uniaxial", 0, [2]), "rate = 0: must be greater than 0"),
    (lambda: fx.Viscoelastic(RUBBER, P0).constant_rate("uniaxial", 1, [0.5, 2]), "all above or all below 1"),
    (lambda: fx.MixedPressure(space="P2"), "'P2' is not known; known: 'P0', 'P1', 'P1dg'"),
    *of(lambda options: fx.Remesh(**options), [
        ({"size": -1.0}, "Remesh: size = -1"), ({"size": 1.0, "corner": 2.0}, "corner = 2"),
        ({"size": 1.0, "volume_ratio": (1.1, 1.5)}, "volume_ratio")]),
    *of(lambda wrong: fx.tools.pot(**{"mouth": 40, "base": 25, "depth": 70, "sheet": 1.2, "fillet": 4} | wrong), [
        ({"base": 41}, "base = 41: must not be wider"), ({"plug": 25}, "plug = 25: must be below base"),
        ({"nose": 30}, "nose = 30: must not be above"), ({"depth": 0}, "depth = 0"), ({"fillet": 40}, "too large")]),
    # tools
    (lambda: fx.tools.cup(radius=1, depth=0.5, fillet=0.6), "too large for its corner"),
    (lambda: fx.Tool([(0, 0), (2, 0), (2, 1), (1, -1)]), "crosses itself"),
    (lambda: fx.Tool([(0, 0)]), "at least 2"),
    (lambda: fx.Tool([(0, 0), (0, 0), (1, 0)]), "are the same"),
    (lambda: fx.Tool([(0, 0), (1, 0), (1, 1)], fillets=[0, -1, 0]), "must not be negative"),
    (lambda: fx.Tool([(1, 0), (2, 0), (2, 1)], fillets=[0.1, 0, 0]), "no corner to round"),
    (lambda: fx.Tool([(0, 0), (1, 1)], fillets=0.1), "fillets = 0.1: the profile has no corner to round"),
    (lambda: fx.Tool([(0, 0), (1, 0), (2, 0)], fillets=0.1), "fillets = 0.1: the profile has no corner to round"),
    (lambda: fx.Tool([(0, 0), (1, 1)], fillets=-0.1), "fillets = -0.1: must not be negative"),
    (lambda: fx.Tool([(0, 0), (1, 0)], fillets=[0.1, 0]), "point 0 = 0.1: the profile runs straight on"),
    (lambda: fx.Tool([(0, 0), (1, 0), (2, 0), (2, 1)], fillets=[0, 0.1, 0.2, 0]), "point 1 = 0.1: .* straight on"),
    (lambda: fx.Tool.of_pieces([Line(np.zeros(2), np.ones(2)), Line(np.zeros(2), np.ones(2))]),
     "follow one another"),
    (lambda: fx.Tool.of_pieces([]), "at least one piece"),
    (lambda: fx.Tool.of_pieces(["line"]), "piece 0 = 'line': must be a Line or an Arc"),
    (lambda: fx.Tool.of_pieces(3), "must be a list of Line"),
    (lambda: fx.Tool.of_pieces([Line(np.zeros(2), np.array([np.nan, 1]))]), "piece 0: an end.*nan.*finite"),
    (lambda: fx.Tool.of_pieces([Line(np.ones(2), np.ones(2))]), "has no length"),
    (lambda: fx.Tool.of_pieces([Arc(np.zeros(2), 0.0, 0.0, 1.0)]), "piece 0: radius = 0.0.*greater than 0"),
    (lambda: fx.Tool.of_pieces([Arc(np.zeros(2), 1.0, 0.0, 0.0)]), "sweep = 0.0"),
    (lambda: fx.Tool.of_pieces([Arc(np.zeros(2), 1.0, 0.0, 7.0)]), "at most a full turn"),
    (lambda: fx.Tool.of_pieces([Arc(np.zeros(2), 1.0, np.inf, 1.0)]), "start = inf"),
    (lambda: fx.Tool([(0, 0), (2, 0), (1, 0)]), "doubles back"),
    (lambda: fx.Tool([(0, 0), (2, 0), (2, 1), (0.5, 1), (0.5, 0), (1.5, 0)]), "crosses itself|doubles back"),
    (lambda: fx.Tool([(0, 0), (2, 0), (2, 1), (3, 1), (3, 0), (1, 0)]), "crosses itself|doubles back"),
    (lambda: fx.Tool([(0, 0), ("1.0", 0)]), "'1.0': must be a number"),
    (lambda: fx.tools.plane("1.0"), "z = '1.0': must be a number"),
    (lambda: fx.Tool(np.array(1.0)), "must be a list of points"),
    (lambda: fx.tools.cup(radius=1, depth=5, draft=20), "leaves no floor"),
    (lambda: fx.tools.cone(half_angle=90), "below 90"),
    (lambda: fx.tools.cone(half_angle=5e-324), "at least 0.01"),
    (lambda: fx.tools.clamp_ring(radius=1, width=1, fillet=0.2, height=0.3), "fillet"),
    (lambda: fx.tools.bottle(radius=1, height=1, neck=2, shoulder=1, neck_height=1), "below radius"),
    # heat
    (lambda: fx.ThermalProperties(conductivity=-0.17, density=1, heat_capacity=1), "conductivity = -0.17"),
    (lambda: fx.ThermalProperties(conductivity=1, density=0, heat_capacity=1), "density = 0"),
    (lambda: fx.Convection("top", h=-1, air=20), "h = -1"),
    (lambda: fx.Radiation("top", emissivity=1.2, heater=400), "emissivity = 1.2: must be from 0 to 1"),
    (lambda: fx.Radiation("top", emissivity=fx.table({0: 0.5, 1: 1.1}), heater=400), "emissivity = 1.1"),
    (lambda: fx.Radiation("top", emissivity=0.9, heater=400, view_factor=-0.1), "view_factor = -0.1"),
    (lambda: fx.Absorption("top", flux=8000, coefficient=0), "coefficient = 0"),
    (lambda: fx.ContactWithTool("top", conductance=-5, tool=20), "conductance = -5"),
    (lambda: fx.ContactWithTool("top", conductance=5, tool="cold"), "tool = 'cold'"),
    (lambda: fx.ConductingTool(thickness=0.02, conductivity=-1, heat_capacity=1, back=30), "conductivity = -1"),
    (lambda: fx.ConductingTool(thickness=0.02, conductivity=1, heat_capacity=1, back=30, finest=0.1), "finest = 0.1"),
    # fits
    *of(lambda arguments: fx.fit(*arguments), [
        ((fx.NeoHookean, {}), "data = {}: must be {test"),
        ((fx.NeoHookean, [(L, P)]), "must be {test"),
        ((fx.NeoHookean, {"shear": (L, P)}), "test 'shear' is not known; known: 'uniaxial'"),
        ((fx.NeoHookean, {"uniaxial": (L, P[:2])}), r"stretch has the shape \(3,\), stress \(2,\)"),
        ((fx.NeoHookean, {"uniaxial": L}), "'uniaxial'.*must be .stretch, nominal stress"),
        ((fx.NeoHookean, {"uniaxial": ([10**400], [1.0])}), "'uniaxial'.*must be .stretch, nominal stress"),
        ((fx.NeoHookean, {"uniaxial": ([], [])}), r"shape \(0,\)"),
        ((fx.NeoHookean, {"uniaxial": (L, [0.1, math.nan, 1])}), "point 1: stretch = 1.5, stress = nan: must be fin"),
        ((fx.NeoHookean, {"uniaxial": ([1.0, -0.5], [0, 1])}), "point 1: stretch = -0.5.*greater than 0"),
        ((fx.NeoHookean, {"uniaxial": ([0.0, 0.5, 1.5], [0, 1, 2])}), r"stretch = 0.0.*Is it strain\? .* 1 \+ strain"),
        ((fx.NeoHookean, {"uniaxial": ([1.0, -2.0], [0, 1])}), "greater than 0$"),
        ((fx.NeoHookean, {"uniaxial": ([0.1, 0.5], [1, 2])}), r"sign of the strains .*is given as 1 \+ strain"),
        ((fx.NeoHookean, {"uniaxial": ([1.0, 1.0], [0, 0])}), "every stretch is 1"),
        ((fx.NeoHookean, {"uniaxial": (L, -P)}), "sign of the strains"),
        ((fx.NeoHookean, {"uniaxial": (L, 1e-300 * P)}), "largest stress is 7e-301: must be from 1e-50 to 1e50"),
        ((fx.Yeoh, {"uniaxial": (L, 1e300 * P)}), "largest stress is 7e.299"),
        ((GENT, {"uniaxial": (L, 0 * P)}), "largest stress is 0"),
        ((fx.NeoHookean, {"uniaxial": (L * 1e-300, P)}), "point 0: stretch = 1.1.*e-300: must be from 0.001 to 1000"),
        ((fx.Ogden, {"uniaxial": (L, P)}), "3 points cannot fix the 6 constants of Ogden"),
        ((fx.Ogden, {"uniaxial": (L, P)}, 0), "terms = 0.*at least 1"),
        ((fx.Ogden, {"uniaxial": (L, P)}, 9), "terms = 9.*at most 6"),
        ((fx.Gent, {"uniaxial": (L, P)}, 2), "terms = 2: Gent has no terms"),
        ((fx.Ogden(mu=1.0, alpha=2.0), {"uniaxial": (L, P)}, 2), "terms = 2 is for the class"),
        ((fx.Hyperelastic, {"uniaxial": (L, P)}), "Hyperelastic has no first guess.*instead of the class"),
        ((3.0, {"uniaxial": (L, P)}), "3.0: must be a formingx material"),
        ((GENT, {"uniaxial": (L, P)}), r"Gent\(mu=1.0, Jm=1.0\) has no finite stress at some stretch")]),
    *of(fx.fit, [
        (fx.Viscoelastic, {"uniaxial": (L, L)}, "needs the time"),
        (fx.Viscoelastic, [(L, L)], "number 1 is .*must be a TimedTest"),
        (fx.Viscoelastic, [fx.TimedTest("uniaxial", [0, 1], [1, 2], [0])], "stress has the shape"),
        (fx.Viscoelastic, [fx.TimedTest("uniaxial", [0, 0], [1, 2], [0, 1])], "no test lasts any time"),
        (fx.Viscoelastic, [fx.TimedTest("uniaxial", [0, 1], [1, 2], [0, 0])], "no stress is given"),
        (fx.Viscoelastic, [fx.TimedTest("uniaxial", [0, 1], [1, 2], [0, 1])], "2 points cannot fix the 3 constants"),
        (fx.Viscoelastic, [fx.TimedTest("shear", [0, 1], [1, 2], [0, 1])], "'shear' is not known")]),
    *of(lambda arguments: fx.fit(*arguments), [
        ((fx.KBKZ, []), "give a card with a spectrum and a damping"),
        ((fx.KBKZ([(1.0, 1.0)]), []), "give a card with a spectrum and a damping")]),
    *of(lambda arguments: fx.fit_spectrum(*arguments), [
        (([1.0, 2.0], [1.0], [1.0, 2.0]), "must be \\(n,\\)"),
        (([1.0, -2.0], [1.0, 1.0], [1.0, 2.0]), "must be above 0")]),
    (lambda: fx.TimedTest.constant_rate("uniaxial", 0, L, L), "rate = 0"),
    (lambda: fx.TimedTest.constant_rate("uniaxial", 1.0, "x", L), "TimedTest: stretches = 'x': must be finite numbers"),
    (lambda: fx.TimedTest.constant_rate("uniaxial", 1.0, [2.0, -1.0], L), "TimedTest: stretches = .*must be above 0"),
    (lambda: fx.TimedTest.relaxation("uniaxial", 2.0, "x", L), "TimedTest: times = 'x': must be finite numbers"),
    (lambda: fx.with_tests(RUBBER), "with_tests: no test is given"),
    # comparisons
    *of(lambda arguments: fx.compare(GOOD, GOOD, **arguments), [
        ({"columns": {"a": "a", "x": "b"}}, "^compare: ours: column 'x' is not known; known: 'a', 'b'"),
        ({"columns": {"a": "a", "b": "y"}}, "^compare: theirs: column 'y' is not known"),
        ({"columns": ["a"]}, "at least two columns"),
        ({"units": {"z": 1}}, "units: column 'z' is not known"),
        ({"units": {"a": 0}}, "must be greater than 0"),
        ({"units": 3}, "compare: units = 3: must be"),
        ({"columns": ["a", ["b"]]}, r"compare: columns: column = \['b'\]: must be a name"),
        ({"columns": 3}, "compare: columns = 3: must be a list of names"),
        ({"units": {"a": "cm"}}, "does not state the unit of column 'a'")]),
    (lambda: fx.compare(GOOD, {"a": [1, 2], "b": [1]}), "^compare: theirs: columns must be as long as each other"),
    (lambda: fx.compare(GOOD, {"a": ["x"], "b": [1]}), "numbers"),
    (lambda: fx.compare({"a": T, "b": T**2}, {"a": T[::-1], "b": T[::-1] ** 2}, along="arc length"), "backwards"),
    (lambda: fx.compare({"a": T * np.cos(T), "b": T * np.sin(T)}, {"a": (T * np.cos(T))[::-1],
     "b": (T * np.sin(T))[::-1]}),
     "backwards"),
    (lambda: fx.Design(lambda h, mu=0.1: None, {"x": (1.0, 0.5, 2.0)}),
     r"'x': build\(h, mu=0.1\) cannot be called with these: missing a"),
    (lambda: fx.Units("mm", "MPa").mass(1000.0, 1050.0), "density = 1050.* g/cm3"),
    (lambda: CURVE([140.0, 129.0]), "x = 129: must be from 130 to 170"),
    (lambda: CURVE.check(171.0, "temperature"), "temperature = 171"),
    (lambda: CURVE(np.nan), "x = nan"),
    *of(fx.table, [(points, "table") for points in ({1: 2}, [(1, 2), (2, 3)], {}, {1: 2, 2: np.inf}, {1: 2, "a": 3})]),
    (lambda: fx.Contact("top", CUP, fx.table({20.0: 0.1, 150.0: 0.4}), separates=False), "no Coulomb friction"),
]


@pytest.mark.parametrize("call, words", REFUSED)
def test_wrong_input_is_refused(call, words):
    with pytest.raises(fx.InputError, match=words):
        call()


def test_numbers_of_any_type():
    """Constants are kept as floats."""
    for made in (fx.Yeoh(c10=Decimal("0.5"), c20=Fraction(1, 8), c30=np.float32(0.25)),
                 fx.Ogden(mu=np.array(1.0), alpha=np.array(2)), fx.Ogden(mu=[Decimal(1)], alpha=[Decimal(2)])):
        assert made.shear_modulus == pytest.approx(1.0, rel=1e-12)
        assert {type(value) for value in made.parameters.values()} == {float}


def test_mesh_across_the_axis(tmp_path):
    file = tmp_path / "crossing.msh"
    fx.mesh.write(fx.mesh.disc(**MESH), file, shift=(-0.5, 0.0))
    with pytest.raises(fx.InputError, match="crosses the axis: its smallest R is -0.5"):
        scene(mesh=fx.mesh.read(file))


def test_hinge_of_layers_too_different():
    """What a hinge would ask of a soft layer is refused; where the soft layer is on top, or clamped, it runs."""
    hard, soft = fx.NeoHookean(c10=1e4), fx.NeoHookean(c10=1.0)
    mesh = fx.mesh.disc(radius=1.0, thickness={"lower": 0.03, "upper": 0.03}, elements=(10, 1))

    def layered(lower, upper, rim):
        return scene(mesh=mesh, materials={"lower": lower, "upper": upper}, supports=[fx.Symmetry("axis"), rim])
    weighted = fx.SimplySupported("rim", weight="stiffness")
    with pytest.raises(fx.InputError, match="'upper' is 1e.04 times softer than 'lower'.*weight='stiffness'"):
        layered(hard, soft, fx.SimplySupported("rim"))
    for rim in (weighted, fx.SimplySupported("rim")):
        with pytest.raises(fx.InputError, match="squeeze layer 'lower', 1e.04 times softer.*use Clamped"):
            layered(soft, hard, rim)
    for lower, upper, rim in ((hard, soft, weighted), (soft, hard, fx.Clamped("rim"))):
        path = fx.trace(layered(lower, upper, rim), until=fx.pole_stretch(2.5))
        assert path.counts.iterations < 100
    with pytest.raises(fx.InputError, match="weight = 'mass'"):
        fx.SimplySupported("rim", weight="mass")


def test_moved_nodes():
    """One node of a good mesh moved so that elements lie over each other, or turn inside out: no scene."""
    for by, words in ((-0.6, "lie over each other|touches or crosses itself|inside out"), (math.nan, "finite")):
        mesh = fx.mesh.disc(radius=1.0, thickness=0.3, elements=(4, 2))
        x = mesh.domain.geometry.x
        x[np.argmin(np.hypot(x[:, 0] - 0.5, x[:, 1] - 0.15)), 0] += by
        with pytest.raises(fx.InputError, match=words):
            scene(mesh=mesh)


def test_column_and_value_that_a_path_does_not_have():
    path = fx.trace(treloar(), until=fx.pressure(0.1))
    with pytest.raises(fx.InputError, match="column 'height' is not known; known: pressure"):
        path["height"]
    with pytest.raises(fx.InputError, match="intermediate = Target.*must be a list of targets"):
        fx.trace(treloar(), until=fx.pressure(0.1), intermediate=fx.pressure(0.05))
    with pytest.raises(fx.InputError, match="does not pass pressure = 0.3"):
        path.state_at(fx.pressure(0.3))
    with pytest.raises(fx.InputError, match="does not pass pressure = 0.10001: its values lie between 0 and 0.1"):
        path.state_at(fx.pressure(0.10001))


def test_the_last_state_of_a_path_is_found_by_a_value_of_six_digits():
    """A pole height of 0.5123456 is written 0.512346: the path ends just before it."""
    path = fx.trace(treloar(), until=fx.pole_height(0.5123456), progress=False)
    found = path.state_at(fx.pole_height(0.512346))
    assert found.measures["pole_height"] == pytest.approx(0.512346, rel=1e-10)
    assert path.last.measures["pressure"] < found.measures["pressure"] < (1 + 1e-5) * path.last.measures["pressure"]


def test_a_clamp_is_pressed_from_the_side_of_its_lower_ring():
    """The pressure acts on the face of the lower ring, and presses the sheet onto the upper one."""
    upper, lower = fx.tools.plane(z=0.1), fx.tools.plane(z=0.0).mirrored()
    sheet = fx.mesh.disc(radius=1.0, thickness=0.1, elements=(4, 1))
    clamped = scene(mesh=sheet, contacts=[fx.Contact("top", upper, "none"), fx.Contact("bottom", lower, "none")])
    assert clamped.driven is clamped.loads[0]
    with pytest.raises(fx.InputError, match="no tool faces the pressure"):
        scene(mesh=sheet, contacts=[fx.Contact("bottom", lower, "none")])


def test_a_film_of_too_long_elements_names_them():
    """A film ten times thicker is inflated with accuracy="standard" (tests/test_extremes.py)."""
    film = fx.mesh.disc(radius=1.0, thickness=1e-7, elements=(20, 1))
    with pytest.raises(fx.ConvergenceError, match=r"more elements along a film, or Membrane\(\)") as error:
        fx.trace(scene(mesh=film, materials=fx.NeoHookean(c10=1.0)), until=fx.pole_stretch(1.1), progress=False)
    assert "touches" not in str(error.value)


def test_no_state_is_found_beyond_a_maximum_of_the_pressure():
    path = fx.trace(treloar(), until=fx.pressure(0.6), at_limit_point="stop", progress=False)
    with pytest.raises(fx.InputError, match="does not pass pressure"):
        path.state_at(fx.pressure(path.last.measures["pressure"] * (1 + 1e-6)))


def test_a_body_does_not_pass_the_axis():
    """A ring whose inner edge is driven beyond it: J > 0 there, for two factors change their sign."""
    mesh = fx.mesh.disc(radius=10.0, inner_radius=2.0, thickness=1.0, elements=(16, 2))
    scene = fx.Scene(mesh=mesh, materials=fx.NeoHookean(c10=1.0),
                     supports=[fx.PrescribedDisplacement("inner", "r"), fx.Clamped("rim")])
    with pytest.raises(fx.ConvergenceError, match="turned inside out") as error:
        fx.trace(scene, until=fx.travel(-3.0), progress=False)
    assert -2.0 < error.value.path["travel"][-1] < -1.9
