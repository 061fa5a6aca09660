"""Measure the processor time of saving, loading and reporting a run with relaxation, heat and friction.

The states of a short run are repeated until there are as many as in a long one. `--json FILE` writes the numbers.
"""

import argparse
import json
import tempfile
import time
from dataclasses import replace
from pathlib import Path

import formingx as fx


def scene(elements: int) -> fx.Scene:
    """Return the scene of a film that a plug pushes and chills."""
    heat = fx.Cooling(fx.ThermalProperties(conductivity=1e-2, density=1.0, heat_capacity=1.0), unit="C",
                      tools={"plug": (0.025, 40.0)})
    return fx.Scene(mesh=fx.mesh.disc(radius=2.0, thickness=0.1, elements=(elements, 1)),
                    materials=fx.Viscoelastic(fx.NeoHookean(c10=0.1), branches=[(0.3, 0.1), (0.2, 1.0)]),
                    temperature=100.0, heat=heat, supports=[fx.Symmetry("axis"), fx.Clamped("rim")],
                    contacts=[fx.Contact("top", fx.tools.sphere(radius=1.0, z=0.1), 0.3, direction=(0, -1),
                                         name="plug")])


def main() -> None:
    """Run it."""
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("--states", type=int, default=800)
    options.add_argument("--elements", type=int, default=36)
    options.add_argument("--json", type=Path)
    given = options.parse_args()
    body = scene(given.elements)
    path = fx.Process(body).run([fx.Stage("down", control="plug", until=fx.travel(0.6), speed=1.0),
                                 fx.Stage("hold", duration=0.4)], accuracy="draft", progress=False)
    states = path.record.segments[-1].states
    states[:] = [replace(states[k * len(states) // given.states]) for k in range(given.states)]
    found = {"states": given.states}
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place) / "run"
        for name, act in (("save", lambda: path.save(folder)), ("load", lambda: fx.load(folder, body)),
                          ("report", lambda: path.report(Path(place) / "report.html"))):
            began = time.process_time()
            act()
            found[name] = round(time.process_time() - began, 2)
        found["megabytes"] = round(sum(file.stat().st_size for file in folder.rglob("*") if file.is_file()) / 1e6, 1)
    print(", ".join(f"{name} {value}" for name, value in found.items()))
    if given.json:
        given.json.write_text(json.dumps(found, indent=1))


if __name__ == "__main__":
    main()
