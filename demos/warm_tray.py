"""Form a tray from a sheet that is heated by zones, sags, is chilled by plug and mould, and sets.

The sheet is heated from both sides by heaters of several zones and sags under its weight. It is transferred, pushed by
a plug whose friction depends on the temperature of the touching face, drawn into a cold mould by a vacuum, and held
until it has set. Heat flows through the thickness at each node. The polymer is illustrative. Runs without chill, with
constant friction, and with one temperature through the thickness stand beside it. A disc that is heated, pushed by a
plug and blown into a mould is compared with an axisymmetric solid. Lengths in mm, stresses in MPa, times in s,
temperatures in C, heat in W.
"""

import numpy as np
from common import parser, save, say, summarise

import formingx as fx
from formingx import figures
from formingx.results import files

SHEET, THICKNESS, DENSITY, START, AIR, SIGMA = (160.0, 100.0), 1.5, 1.05, 110.0, 40.0, 5.67e-14
HEATERS = ([0.0, 50.0, 80.0], [0.0, 30.0, 50.0], [[300.0, 310.0, 350.0], [310.0, 320.0, 360.0], [350.0, 360.0, 400.0]])
STIFFNESS = {90.0: 0.3, 110.0: 0.12, 130.0: 0.07, 150.0: 0.05, 180.0: 0.04}          # c10 of the melt, by temperature
SET, SETTING = (80.0, 100.0), 80.0                                     # solidification, and the card's temperature
FRICTION = {40.0: 0.12, 100.0: 0.25, 130.0: 0.6, 160.0: 1.2}           # of the plug, by temperature of the face
PLUG, MOULD = (0.25e-3, 60.0), (0.6e-3, 25.0)                          # contact conductance, temperature
CORE, TRANSFER, TRAVEL, SPEED, SEAL, VACUUM, EVACUATION, HOLD = 150.0, 1.5, 34.0, 100.0, 0.01, 0.09, 0.5, 14.0
MELT = fx.ThermalProperties(conductivity=0.2e-3, density=1.05e-3, heat_capacity=1.9)
UNIFORM = fx.ThermalProperties(conductivity=0.2, density=1.05e-3, heat_capacity=1.9)      # one temperature at a node
CASES = ("all", "no_chill", "constant_friction", "one_temperature")
UNITS = fx.Units(length="mm", stress="MPa", time="s")

RADIUS, DISC, PLACES = 40.0, 0.8, ("0", "0.25", "0.5", "0.75")         # the disc, places over its radius
DISC_MOULD = fx.Tool([(60.0, 0.0), (34.0, 0.0), (28.0, -18.0), (0.0, -18.0)], [0.0, 6.0, 10.0, 0.0])
DISC_PLUG = fx.tools.sphere(radius=16.0, z=0.0)


def material():
    """Return the polymer: a melt that relaxes, and solidifies on cooling."""
    melt = fx.Viscoelastic(fx.NeoHookean(c10=fx.table(STIFFNESS)), [(0.1, 0.5)], shift=fx.Arrhenius(90e3, 150.0, unit="C"))
    return fx.Solidification(melt, modulus=300.0, between=SET)


def cooling(case):
    """Return the heat conduction of the tray in a case."""
    heaters = [fx.Radiation(face, emissivity=0.9, heater=fx.zones(*HEATERS), view_factor=0.8, stefan_boltzmann=SIGMA,
                            name=f"heater {face}") for face in ("bottom", "top")]
    air = [fx.Convection(face, h=1e-5, air=AIR) for face in ("bottom", "top")]
    return fx.Cooling(UNIFORM if case == "one_temperature" else MELT, heaters + air, unit="C", tolerance=0.2,
                      tools={} if case == "no_chill" else {"plug": PLUG, "mould": MOULD})


def tray(case, size):
    """Return the path of a quarter of the tray in a case; triangles of an edge length `size`."""
    sheet = fx.mesh.sheet(fx.mesh.rectangle(*SHEET, corner=10.0, part="quarter"), size=size)
    mould = fx.tools.box(half=(72, 42), depth=36, corner=18, fillet=8, lip=3, draft=8).moved(z=-6.0)
    plug = fx.tools.box(half=(48, 22), depth=40, corner=14, fillet=8, draft=5, mouth=40, plug=True)
    table = fx.table(FRICTION)
    scene = fx.Scene(
        mesh=sheet, thickness=THICKNESS, materials=material(), temperature=START, heat=cooling(case),
        model=fx.Membrane(wrinkles=0.01),
        supports=[fx.SimplySupported("rim"), fx.Symmetry("x0", "x"), fx.Symmetry("y0", "y")],
        loads=[fx.Pressure("top", name="vacuum"), fx.Gravity(1e-9 * DENSITY, 9810.0)],
        contacts=[fx.Contact("bottom", mould, "stick", name="mould"),
                  fx.Contact("top", plug, float(table(140.0)) if case == "constant_friction" else table,
                             direction=(0, 0, -1), name="plug")])
    cold = ["heater bottom", "heater top"]
    return fx.Process(scene).run([
        fx.Stage("oven", until=fx.temperature(CORE, at=(0.0, 0.0)), duration=90.0, inactive=["plug", "mould"]),
        fx.Stage("transfer", duration=TRANSFER, inactive=[*cold, "plug", "mould"]),
        fx.Stage("plug", control="plug", until=fx.travel(TRAVEL), speed=SPEED, inactive=cold),
        fx.Stage("seal", control="vacuum", until=fx.pressure(SEAL), duration=0.05, inactive=cold),
        fx.Stage("vacuum", control="vacuum", until=fx.pressure(VACUUM), duration=EVACUATION, inactive=[*cold, "plug"]),
        fx.Stage("hold", duration=HOLD, inactive=[*cold, "plug"])], progress=False, accuracy="draft")
