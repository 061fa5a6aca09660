"""What a sheet must be so that a trough blown of it is even: its thickness, or its constant.

Plane strain: a sheet of half width 1, held at its rims, is blown into a trough with vertical walls, 1.5 deep, with sharp
corners, on which it sticks, until the free arc in the corner has a radius below 0.05. Wanted is an even wall h = 0.01:
by the thickness at rest h0, or by the constant C = c10 with a uniform h0. The profile is a table over the sheet.

Places of the sheet are named by where they end: at the mouth of the straight wall 1 below the rim (half_wall: half as
deep), and at a distance from the corner along wall or floor.
"""

import numpy as np
from common import parser, save, say, summarise

import formingx as fx
from formingx.figures import figure
from formingx.results import files

DEPTH, WALL, C = 1.5, 0.01, 0.5
PRESSURE = 0.5
PLACES = {"rim": 0.0, "half_wall": (DEPTH - 1) / 2, "mouth": DEPTH - 1, "corner_0.5": DEPTH - 0.5,
          "corner_0.1": DEPTH - 0.1}                          # how deep they end on the wall


def trough(profile, of, elements):
    """The scene of a sheet whose thickness ("h0") or constant ("C") goes with a profile over its width, its target."""
    thickness = (lambda R: WALL * profile(R)) if of == "h0" else 2.5 * WALL
    c10 = (lambda R, Z: C * profile(R)) if of == "C" else C
    mesh = fx.mesh.disc(radius=1.0, thickness=thickness, elements=elements)
    mould = fx.tools.cup(radius=1.0 + WALL / 2, depth=DEPTH + WALL / 2)
    scene = fx.Scene(mesh=mesh, materials=fx.NeoHookean(c10=c10), kinematics=fx.PlaneStrain(),
                     supports=[fx.Symmetry("axis"), fx.SimplySupported("rim")], loads=[fx.Pressure("bottom")],
                     contacts=[fx.Contact("top", mould, "stick")])
    return scene, fx.pressure(PRESSURE)
