"""Write the reports that `browse.py` opens: of a section with stages, of a tray, of a trough and of a design."""

import re
import sys
from pathlib import Path

import numpy as np

import formingx as fx

ROOT, out = Path(__file__).parents[1], Path(sys.argv[1]).resolve()
out.mkdir(parents=True, exist_ok=True)
script, = re.findall(r"```python\n(.*?)```", (ROOT / "README.md").read_text(), re.S)
script = script.replace('path.view3d("pot.png")', "").replace('"pot.html"', repr(str(out / "section.html")))
exec(compile(script.replace('"pot.csv"', repr(str(out / "pot.csv"))), "README.md", "exec"), {})

units = fx.Units(length="mm", stress="MPa")
sheet = fx.mesh.sheet(fx.mesh.rectangle(160, 100, corner=20, part="quarter"), size=12)
mould = fx.tools.box(half=(80, 50), depth=30, corner=20, fillet=8, draft=5)
tray = fx.trace(fx.Scene(mesh=sheet, thickness=1.0, materials=fx.NeoHookean(c10=0.05), loads=[fx.Pressure("top")],
                         supports=[fx.SimplySupported("rim"), fx.Symmetry("x0", "x"), fx.Symmetry("y0", "y")],
                         contacts=[fx.Contact("bottom", mould, name="mould")]), until=fx.pressure(0.05), progress=False)
tray.report(out / "tray.html", units=units, density=1.05)

trough = fx.trace(fx.Scene(mesh=fx.mesh.disc(radius=60, thickness=0.5, elements=(10, 1)), kinematics=fx.PlaneStrain(),
                           materials=fx.NeoHookean(c10=0.4), supports=[fx.Symmetry("axis"), fx.SimplySupported("rim")],
                           loads=[fx.Pressure("bottom")]), until=fx.pole_height(50.0), progress=False)
trough.report(out / "trough.html", units=units)


def build(rim):
    """Return a sheet that is blown, thicker or thinner at its rim."""
    mesh = fx.mesh.disc(radius=40.0, thickness=2.0, elements=(12, 1))
    stiff = fx.NeoHookean(c10=lambda R, Z: 0.4 * (1 + rim * (np.asarray(R) / 40.0) ** 2))
    return fx.Scene(mesh=mesh, materials=stiff, supports=[fx.Symmetry("axis"), fx.Clamped("rim")],
                    loads=[fx.Pressure("bottom", name="air")]), fx.pole_height(20.0)


fx.Design(build, {"rim": (0.0, -0.5, 2.0)}).fit(even=True, max_runs=3).report(out / "design.html", units=units)
