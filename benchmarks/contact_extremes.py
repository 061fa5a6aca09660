"""Run contact far from its defaults: penalties, ramps, fillets, friction, depths and thicknesses.

The cup of demos/cup.py on 30 x 2 x 2 triangles, to 60 psi times h0/0.3 cm.
"""

import argparse
import time

import formingx as fx

CASES = {
    "penalty": [{"penalty": 2.0 * 10**k} for k in range(1, 8)],
    "ramp": [{"ramp": 10.0**-k} for k in range(6, 0, -1)],
    "fillet": [{"fillet": f} for f in (0.0, 0.33, 1.0, 4.0)] + [{"fillet": 10.0, "depth": 10.0}],
    "friction": [{"friction": mu} for mu in ("none", 0, 0.01, 0.3, 3, 1e3, "stick")],
    "depth": [{"depth": d} for d in (2.0, 5.0, 10.0, 20.0, 30.0)],
    "thickness": [{"thickness": h} for h in (2.0, 1.0, 0.3, 0.1, 0.02)],
}


def run(elements, *, layers=2, pressures=None, thickness=0.3, depth=5.0, fillet=1.0, friction="stick", **options):
    """Return the path and how it ended."""
    mesh = fx.mesh.disc(radius=10.0, thickness=thickness, elements=(elements, layers))
    targets = [fx.pressure(p) for p in pressures or (60.0 * thickness / 0.3,)]
    cup = fx.tools.cup(radius=10.0, depth=depth, mouth=thickness, fillet=fillet)
    scene = fx.Scene(mesh=mesh, materials=fx.MooneyRivlin(c10=50.0, c01=15.0), loads=[fx.Pressure("bottom")],
                     supports=[fx.Symmetry("axis"), fx.Clamped("rim")],
                     contacts=[fx.Contact("top", cup, friction, **options)])
    try:
        return fx.trace(scene, until=targets[-1], intermediate=targets[:-1], step=fx.StepControl(target=8),
                        max_steps=400,
                        progress=False), "done"
    except fx.ConvergenceError as error:
        return error.path, str(error).split(" The nearest")[0]


def main():
    options = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    options.add_argument("--elements", type=int, default=30, help="elements along the radius")
    args = options.parse_args()
    print(f"{'case':34}{'psi':>8}{'pole t/t0':>10}{'least':>8}{'depth/h0':>10}{'length':>8}{'states':>8}{'Newton':>8}"
          f"{'cuts':>6}{'s':>7}  end")
    for cases in CASES.values():
        for case in cases:
            began = time.perf_counter()
            path, end = run(args.elements, **case)
            ratio, m, c = path.profile().thickness_ratio, path.last.measures, path.counts
            label = ", ".join(f"{k} {v}" if isinstance(v, str) else f"{k} {v:g}" for k, v in case.items())
            print(f"{label:34}{m['pressure']:8.4g}{ratio[0]:10.5f}{ratio.min():8.4f}"
                  f"{path['penetration'].max() / case.get('thickness', 0.3):10.1e}{m['contact_length']:8.2f}"
                  f"{c.steps:8d}{c.iterations:8d}{c.failures:6d}{time.perf_counter() - began:7.1f}  {end}", flush=True)


if __name__ == "__main__":
    main()
