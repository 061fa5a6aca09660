"""Error of the wall with `accuracy=` in random moulds, for which its constants were not chosen.

    ./fx python3 benchmarks/random_moulds.py [--seeds 24] [--first 101] [--out FOLDER]

A seed gives the shape and size of the mould, the thickness and the material of the sheet, friction, and plane strain or
a body of revolution. Errors are those of `accuracy_in_moulds.py`, relative to columns of half the length of "fine" and
two more elements through the sheet.
"""

import argparse
import random
from pathlib import Path

from accuracy_in_moulds import PROMISED, elements, error, finest, in_mould, wall
from mpi4py import MPI

import formingx as fx
from formingx.results import files

MATERIALS = [fx.NeoHookean(c10=0.4), fx.MooneyRivlin(c10=0.3, c01=0.04), fx.Gent(mu=0.8, Jm=70.0),
             fx.Ogden(mu=[0.5, 0.05], alpha=[1.6, 4.0])]


def cup(draw, R, h, lip, depth=(0.25, 0.75), draft=(2, 15), fillet=(0.05, 0.3)):
    """Return a cup of radius R for a sheet of thickness h; draw(a, b) returns a random number."""
    return fx.tools.cup(radius=R, depth=R * draw(*depth), mouth=h, draft=draw(*draft), fillet=R * draw(*fillet),
                        lip=lip)


def narrow(draw, R, h, lip):
    """Return a cup deeper than wide."""
    return cup(draw, R, h, lip, (0.9, 1.4), (2, 6), (0.08, 0.2))


def bowl(draw, R, h, lip):
    """Return a bowl of large fillets."""
    top = R * draw(0.4, 0.8)
    return fx.tools.Tool([(0.0, top + h), (0.35 * R, top + h), (0.8 * R, 0.45 * top + h), (R, h), (3 * R, h)],
                         [0.0, 0.25 * R, 0.2 * R, lip, 0.0])


def step(draw, R, h, lip):
    """Return a mould with a step half-way up, over whose edge the sheet is drawn."""
    top, base, ledge = R * draw(0.3, 0.7), R * draw(0.4, 0.6), R * draw(0.72, 0.85)
    z = top * draw(0.35, 0.65)
    return fx.tools.Tool([(0.0, top + h), (base, top + h), (1.1 * base, z + h), (ledge, z + h), (R, h), (3 * R, h)],
                         [0.0, *(R * draw(0.05, 0.12) for _ in range(3)), lip, 0.0])


def scene(seed):
    """Return a name of the scene of a seed, a function of its mesh that returns the path, and arguments of `disc`.

    The function takes `step` and `nodes_per_step`, too.
    """
    numbers = random.Random(seed)
    draw, choose = numbers.uniform, numbers.choice
    R, shape = choose([12.0, 45.0, 80.0]), choose([cup, cup, bowl, step, step, narrow])
    h, material, friction = R * 10 ** draw(-2.3, -1.4), choose(MATERIALS), choose(["stick", "stick", 0.3, "none"])
    kinematics, lip = choose([None, None, fx.PlaneStrain()]), R * draw(0.03, 0.1)
    tool, pressure = shape(draw, R, h, lip), (1.5 if shape is narrow else 1.0) * h / R * draw(8, 18)

    def run(mesh, **steps):
        return in_mould(mesh, material, tool, pressure, kinematics, friction, **steps)
    plane = ", plane" if kinematics else ""
    name = f"{shape.__name__}, R {R:g}, h/R {h / R:.2g}, {type(material).__name__}, {friction}{plane}"
    return name, run, {"radius": R + 0.9 * lip, "thickness": h}


def errors(run, sheet):
    """Return {accuracy: (elements as text, error of the wall, number of findings that question the wall)}."""
    paths = {accuracy: run(fx.mesh.disc(**sheet, accuracy=accuracy)) for accuracy in PROMISED}
    reference = wall(run(finest(paths["fine"], fx.mesh.disc(**sheet, accuracy="fine").preset)))
    return {accuracy: ("{} x {}".format(*elements(path)), error(path, reference),
                       sum(found.severity != "note" for found in path.findings())) for accuracy, path in paths.items()}


def arguments(description, name, seeds, first):
    """Return the arguments of a benchmark called `name`: seeds, a range of numbers, and out, the folder of its results.
    """
    options = argparse.ArgumentParser(description=description.splitlines()[0])
    options.add_argument("--seeds", type=int, default=seeds, help="number of seeds")
    options.add_argument("--first", type=int, default=first, help="first seed")
    options.add_argument("--out", type=Path, default=Path("results", name), help="folder for summary.json")
    args = options.parse_args()
    return range(args.first, args.first + args.seeds), args.out


def main():
    seeds, out = arguments(__doc__, "random_moulds", 24, 101)
    rows, over, reported = {}, [], 0
    for seed in seeds:
        name, run, sheet = scene(seed)
        rows[f"{seed}"] = found = errors(run, sheet)
        shown = [f"{text} {value:.2%}{'!' * (value > PROMISED[accuracy])}"
                 for accuracy, (text, value, _) in found.items()]
        print(f"{seed} {name:60} {', '.join(shown)}", flush=True)
        for accuracy, (_, value, findings) in found.items():
            if value > PROMISED[accuracy]:
                over.append(value / PROMISED[accuracy])
                reported += findings > 0
    walls = {seed: {accuracy: value for accuracy, (_, value, _) in row.items()} for seed, row in rows.items()}
    summary = {"moulds": len(rows), "runs": 3 * len(rows), "over": len(over), "reported": reported,
               "largest_ratio": max(over, default=1.0), "errors": walls}
    files.write_summary(out / "summary.json", summary, MPI.COMM_WORLD)
    print({key: value for key, value in summary.items() if key != "errors"})


if __name__ == "__main__":
    main()
