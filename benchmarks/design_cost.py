"""Measure the processor time of derivatives of a run, over that of the run, by the number of parameters.

The stuck cup of `demos/gradients.py` with knots of its constant over the radius, and the bottle of
`demos/even_bottle.py` with knots of its wall over the meridian; the smallest time of three. `--json FILE` writes the
numbers.
"""

import argparse
import json
import sys
import time
from pathlib import Path

import formingx as fx

sys.path.insert(0, str(Path(__file__).parents[1] / "demos"))
from even_bottle import WALL, bottle  # noqa: E402


def cup(constant, elements=(30, 1)):
    """Return the scene of a sheet that sticks to a cup, with a profile of its constant, and its target."""
    mesh = fx.mesh.disc(radius=1.0, thickness=0.03, elements=elements)
    mould = fx.tools.cup(radius=1.0, depth=0.7, mouth=0.03, draft=10.0, fillet=0.2)
    scene = fx.Scene(mesh=mesh, materials=fx.NeoHookean(c10=lambda R, Z: 0.5 * constant(R)),
                     supports=[fx.Symmetry("axis"), fx.SimplySupported("rim")], loads=[fx.Pressure("bottom")],
                     contacts=[fx.Contact("top", mould, "stick")])
    return scene, fx.pressure(0.25)


CASES = {"cup": lambda knots: fx.Design(cup, {"constant": fx.spline(knots, start=1.0)}),
         "bottle": lambda knots: fx.Design(bottle, {"wall": fx.spline(knots, start=WALL, low=0.1, high=0.39)},
                                           step=fx.StepControl(target=8))}


def main() -> None:
    """Run it."""
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("--parameters", type=int, nargs="*", default=[2, 7, 14, 64])
    options.add_argument("--json", type=Path)
    given = options.parse_args()
    found: dict[str, dict[str, float]] = {}
    for name, make in CASES.items():
        for knots in given.parameters:
            design, times = make(knots), []
            for _ in range(3):
                began = time.process_time()
                run = design.run()
                between = time.process_time()
                run.derivative("wall")
                times.append((between - began, time.process_time() - between))
            path, derivatives = (min(part) for part in zip(*times))
            found.setdefault(name, {})[str(knots)] = round(derivatives / path, 2)
            print(f"{name}, {knots} parameters: run {path:.2f} s, {len(run.path)} states; derivatives"
                  f" {derivatives:.2f} s, {derivatives / path:.2f} of a run", flush=True)
    if given.json:
        given.json.write_text(json.dumps(found, indent=1))


if __name__ == "__main__":
    main()
