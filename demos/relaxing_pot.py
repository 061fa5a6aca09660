"""Form a pot of a sheet that relaxes: plug, hold, vacuum and release.

The deep cup is that of demos/plug_and_vacuum.py. An elastic sheet that separates from its plug recovers: the base is as
thin as without a plug. Here the sheet relaxes. Its instantaneous modulus is that of the elastic one (130 psi), and 90 %
of it relax with tau = 1 s. The plug (radius 5 cm, edge 1.5 cm, friction 0.3) travels 60 % of the depth at 0.6, 6 or
60 cm/s, in 10, 1 or 0.1 tau, and waits for 0, 0.1, 1 or 10 tau. Vacuum comes at once, faster than the sheet relaxes.
The part stays in the mould for 5 tau. Pressure and mould are removed together, and the part, fixed at its rim, recovers
for 10 tau. Straight vacuum and the elastic sheet are run for comparison. Lengths in cm, stresses in psi, times in
tau = 1 s.
"""

import numpy as np
from common import parser, save, say, summarise
from deep_cup import PRESSURES, RADIUS, THICKNESS
from plug_and_vacuum import DEPTH, EDGE, MOULD, SHARE, end_of, thickness
from relaxing import cost

import formingx as fx
from formingx import figures
from formingx.results import files

INSTANT = 130.0                                              # psi: 2 (50 + 15), the Mooney sheet of deep_cup.py
SHEETS = {"relaxing": fx.Viscoelastic(fx.NeoHookean(c10=0.05 * INSTANT), branches=[(0.9 * INSTANT, 1.0)]),
          "elastic": fx.NeoHookean(c10=INSTANT / 2)}
SPEEDS, HOLDS = (0.6, 6, 60), (0, 0.1, 1, 10)                # cm/s; s
TRAVEL, PLUG_RADIUS, IN_MOULD, RECOVERY = SHARE * DEPTH, 5.0, 5.0, 10.0
STEP = fx.StepControl(target=8)
AWAY = ["mould", "plug", "vacuum"]


def scene(sheet, elements):
    plug = fx.tools.male(radius=PLUG_RADIUS, height=40.0, base=-40.0, fillet=EDGE)
    return fx.Scene(mesh=fx.mesh.disc(radius=RADIUS, thickness=THICKNESS, elements=elements), materials=SHEETS[sheet],
                    supports=[fx.Symmetry("axis"), fx.Clamped("rim")], loads=[fx.Pressure("bottom", name="vacuum")],
                    contacts=[fx.Contact("top", MOULD, "stick", name="mould"),
                              fx.Contact("bottom", plug, 0.3, direction=(0, 1), name="plug")])


def process(speed, hold):
    """Return the stages; without a speed there is no plug."""
    vacuum = {"control": "vacuum", "until": fx.pressure(PRESSURES[-1]), "intermediate": [fx.pressure(PRESSURES[0])]}
    stages = [fx.Stage("vacuum", inactive=["plug"], step=STEP, **vacuum)]
    if speed is not None:
        stages = [fx.Stage("plug", control="plug", until=fx.travel(TRAVEL), speed=speed)]
        stages += [fx.Stage("hold", duration=hold)] if hold else []
        stages += [fx.Stage("vacuum", step=STEP, **vacuum)]
    return [*stages, fx.Stage("in the mould", duration=IN_MOULD, inactive=["plug"]),
            fx.Stage("out of the mould", inactive=AWAY), fx.Stage("recovery", duration=RECOVERY, inactive=AWAY)]


def form(sheet, speed, hold, elements, accuracy):
    """Return the path as far as it came, and why it stopped ("" at its end)."""
    try:
        return fx.Process(scene(sheet, elements)).run(process(speed, hold), accuracy=accuracy, max_steps=2000,
                                                      progress=False), ""
    except fx.ConvergenceError as error:
        return error.path, str(error)


def numbers(path, stopped):
    """Return the numbers of one run: wall in the mould, forces of the plug, springback of the base."""
    done = {state.stage for state in path.states}
    found: dict = {"stopped": stopped} if stopped else {}
    if "plug" in done:
        found["plug_force_lbf_at_full_travel"] = float(end_of(path, "plug").measures["plug_force"])
        found["plug_force_lbf_after_hold"] = float(
            end_of(path, "hold" if "hold" in done else "plug").measures["plug_force"])
    if "in the mould" in done:
        found |= thickness(path, end_of(path, "vacuum"))
    if "recovery" in done:
        deep = end_of(path, "in the mould").measures["pole_height"]
        for stage, name in (("out of the mould", "at_once"), ("recovery", "after_10_tau")):
            found[f"springback_cm_{name}"] = float(deep - end_of(path, stage).measures["pole_height"])
    return found | cost(path)


def line(name, n):
    """Return a line about one run."""
    parts = [name + ":"]
    if "plug_force_lbf_at_full_travel" in n:
        parts.append(f"plug {n['plug_force_lbf_at_full_travel']:.4g} lbf, {n['plug_force_lbf_after_hold']:.4g} after"
                     f" the hold;")
    if "base" in n:
        parts.append(f"base {n['base']:.4f}, corner {n['corner']:.4f}, thinnest {n['least']:.4f} of h0;")
    if "springback_cm_at_once" in n:
        parts.append(f"springs back {n['springback_cm_at_once']:.3f} cm at once, {n['springback_cm_after_10_tau']:.3f}"
                     f" in 10 tau;")
    return " ".join([*parts, f"{n['steps']} states, {n['solve_seconds']:.1f} s", n.get("stopped", "")[:200]])


def draw(paths, found):
    """Return a figure: walls with and without a plug, base and corner over the hold time."""
    figure, (walls, bases) = figures.figure(2, width=5.2)
    for name, path in paths.items():
        if "vacuum" in {s.stage for s in path.states}:
            profile = path.profile(end_of(path, "vacuum"))
            walls.plot(profile.reference_radius, profile.wall_ratio, label=f"{name} s" if "hold" in name else name)
    walls.set(xlabel="reference radius R, cm", ylabel="wall / original", ylim=(0, 1.02))
    walls.legend(frameon=False, fontsize="small")
    for k, (speed, holds) in enumerate(found.items()):
        at = np.array([float(t.removeprefix("hold_")) for t in holds])
        for key, style in (("base", "o-"), ("corner", "s--")):
            bases.plot(np.maximum(at, 0.02), [n.get(key, np.nan) for n in holds.values()], style, color=f"C{k}",
                       label=f"{key}, {speed.removeprefix('speed_')} cm/s")
    bases.set(xlabel="hold time, s (0 is drawn at 0.02 s)", ylabel="thickness / original", xscale="log", ylim=(0, None))
    bases.legend(frameon=False, fontsize="small")
    return figure


def main():
    options = parser("relaxing_pot", __doc__, elements=30, layers=1, accuracy=1e-2)
    args = options.parse_args()
    elements = (20, 1) if args.quick else (args.elements, args.layers)
    speeds, holds = ((6,), (0, 1)) if args.quick else (SPEEDS, HOLDS)
    paths, summary = {}, {"straight": {}, "plug": {}, "elastic": {}}

    def run(sheet, speed, hold, name):
        path, stopped = form(sheet, speed, hold, elements, args.accuracy)
        paths[name], found = path, numbers(path, stopped)
        say(line(name, found))
        path.to_csv(args.out / f"{name.replace(' ', '_').replace('/', '_per_')}.csv")
        return found
    summary["straight"] = straight = run("relaxing", None, 0, "straight vacuum")
    summary["elastic"] = run("elastic", 6, 0, "elastic, plug")
    for speed in speeds:
        summary["plug"][f"speed_{speed:g}"] = {
            f"hold_{hold:g}": run("relaxing", speed, hold, f"plug {speed:g} cm/s, hold {hold:g}") for hold in holds}
    every = {(s, h): n for s, of in summary["plug"].items() for h, n in of.items() if "base" in n}
    if every and "base" in straight:
        best = max(every, key=lambda k: every[k]["base"])
        summary["thickest_base"] = {"at": "/".join(best), "base": every[best]["base"],
                                    "over_straight": every[best]["base"] / straight["base"]}
        say(f"thickest base: {every[best]['base']:.4f} at {', '.join(best)},"
            f" {summary['thickest_base']['over_straight']:.3f} of that without a plug")
    kept = dict(list(paths.items())[:2] + list(paths.items())[-len(holds):])
    save(draw(kept, summary["plug"]), args.out / "relaxing_pot.png")
    summarise(args.out, summary | {"mesh": {"radius_elements": elements[0], "thickness_elements": elements[1]},
                                   "accuracy": args.accuracy, "versions": files.versions()})


if __name__ == "__main__":
    main()
