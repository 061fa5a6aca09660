"""Form a pot with a cold plug: does relaxation, chill or friction make its base thick?

A sheet of 1.2 mm at 150 C is clamped at a radius of 45 mm. A plug with a round nose (a ball of 20 mm) pushes it to 80 %
of the depth in 1 s; then vacuum draws it into the mould in 0.3 s. The mould has a mouth radius of 40 mm, a base of 25
mm, a depth of 70 mm and fillets of 4 and 2 mm. The sheet sticks to the mould, which takes no heat. At 150 C the sheet
has an equilibrium modulus of 0.04 MPa and a branch of 0.16 MPa and 0.5 s. On cooling it stiffens, by a table, and
relaxes more slowly, by Arrhenius' law. The friction of the plug is 0.6 at 150 C, 0.3 at 100 and 0.15 at 20 (a table).
The values are of the order of those of polystyrene, but of no particular grade.

Plugs at 30, 100 and 150 C take heat through a contact of 0, 200 and 1000 W/(m2 K), where and while they touch. Then
eight runs, for a plug at 30 C, have each of relaxation, chill and friction or not; a sheet without relaxation is
elastic and has the same instantaneous modulus. Straight vacuum is run for comparison. Base, corner and minimum wall are
given over the thickness of the sheet. The runs are made in parallel processes, or with mpirun over the ranks. Lengths
in mm, stresses in MPa, heat in W, times in s, temperatures in C.
"""

import numpy as np
from common import COMM, parser, save, say, summarise, sweep
from mpi4py import MPI

import formingx as fx
from formingx import figures
from formingx.results import files
from formingx.results.show import plots

RADIUS, THICKNESS, MOUTH, BASE, DEPTH, FILLET, LIP = 45.0, 1.2, 40.0, 25.0, 70.0, 4.0, 2.0
PLUG, TRAVEL, STROKE, SUCTION, VACUUM = 20.0, 0.8 * DEPTH, 1.0, 0.3, 0.1        # mm, mm, s, s, MPa
HOT, COLD = 150.0, 30.0
POT = fx.tools.pot(mouth=MOUTH, base=BASE, depth=DEPTH, sheet=THICKNESS, fillet=FILLET, lip=LIP, plug=PLUG, nose=PLUG)
POLYMER = fx.ThermalProperties(conductivity=1.7e-4, density=1.05e-6, heat_capacity=1800.0)     # W/(mm K), kg/mm3
STIFFER = fx.table({20: 5.0, 60: 4.0, 100: 2.0, 150: 1.0, 160: 0.9})
SLOWER = fx.Arrhenius(80e3, HOT, unit="C")
FRICTION = {"by temperature": fx.table({20: 0.15, 100: 0.3, 150: 0.6, 160: 0.6}), "none": "none", "as hot": 0.6}
PLUGS = [(HOT, 0), (100.0, 200), (100.0, 1000), (COLD, 200), (COLD, 1000), (HOT, 1000)]  # C, W/(m2 K)
MOST = PLUGS[-2]
FACTORS = ("relaxation", "chill", "friction")
KEYS = {"base": "base", "corner": "corner", "least": "minimum wall"}


def modulus(at_hot):
    """Return a modulus as a function of the temperature, given its value at 150 C (MPa)."""
    return fx.of_temperature(lambda T: at_hot * STIFFER(T))


def scene(relaxes, plug, friction, elements, comm):
    """Return the scene. plug: (temperature in C, conductance in W/(m2 K)) of the plug."""
    if relaxes:
        sheet = fx.Viscoelastic(fx.NeoHookean(c10=modulus(0.02)), [(modulus(0.16), 0.5)], shift=SLOWER)
    else:
        sheet = fx.NeoHookean(c10=modulus(0.1))
    temperature, conductance = plug
    heat = fx.Cooling(POLYMER, unit="C", tools={"plug": (1e-6 * conductance, temperature)}, tolerance=0.5)
    mesh = fx.mesh.disc(radius=RADIUS, thickness=THICKNESS, elements=elements, concentrate={MOUTH + 1: 0.4}, comm=comm)
    return fx.Scene(mesh=mesh, materials=sheet, temperature=HOT, heat=heat if conductance else None,
                    supports=[fx.Symmetry("axis"), fx.Clamped("rim")], loads=[fx.Pressure("bottom", name="vacuum")],
                    contacts=[fx.Contact("top", POT.mould, "stick", name="mould"),
                              fx.Contact("bottom", POT.plug, FRICTION[friction], direction=(0, 1), name="plug")])


def process(assisted):
    """Return the stages: plug and vacuum, or vacuum alone."""
    suck = fx.Stage("vacuum", control="vacuum", until=fx.pressure(VACUUM), duration=SUCTION,
                    step=fx.StepControl(target=8), inactive=[] if assisted else ["plug"])
    return [fx.Stage("plug", control="plug", until=fx.travel(TRAVEL), duration=STROKE), suck] if assisted else [suck]


def form(case):
    """Return numbers and shapes of one run on this process. case: relaxes, plug, friction, elements, accuracy."""
    relaxes, plug, friction, elements, accuracy = case
    made = scene(relaxes, plug or (HOT, 0), friction, elements, MPI.COMM_SELF)
    stages, stopped = process(plug is not None), ""
    try:
        path = fx.Process(made).run(stages, accuracy=accuracy, max_steps=2000, progress=False)
    except fx.ConvergenceError as error:
        path, stopped = error.path, str(error)
    found = {"stopped": stopped} if stopped else {}
    shapes = {}
    for stage in stages:
        states = [s for s in path.states if s.stage == stage.name]
        if not states:
            continue
        shapes[stage.name] = path.profile(states[-1])
        if stage.name == "plug":
            found |= under_plug(path, states[-1])
        elif not stopped:
            found |= thickness(shapes[stage.name])
    counts = path.counts
    found |= {"steps": counts.steps, "newton_iterations": counts.iterations, "cutbacks": counts.failures,
              "solve_seconds": counts.seconds}
    return found, shapes


def under_plug(path, state):
    """Return the force on the plug at full travel, and temperature and wall of the base there."""
    below, above = path.temperature([[0.0, 0.0], [0.0, THICKNESS]], state)
    return {"plug_force_N": -float(state.measures["plug_force"]),
            "base_under_plug": float(path.profile(state).wall_ratio[0]),
            "base_C_at_plug": float(below), "base_C_on_top": float(above)}


def thickness(profile):
    """Return the walls of base and corner and the minimum wall, over the thickness of the sheet."""
    arc = next(p for p in POT.mould.pieces if getattr(p, "radius", None) == FILLET)
    middle = arc.centre + FILLET * np.array([np.cos(a := arc.start + arc.sweep / 2), np.sin(a)])
    ratio, corner = profile.wall_ratio, np.hypot(*(profile.top - middle).T).argmin()
    return {"base": float(ratio[0]), "corner": float(ratio[corner]), "least": float(ratio.min()),
            "least_at_R_mm": float(profile.reference_radius[ratio.argmin()])}


def name_of(plug):
    return f"{plug[0]:g}_C_{plug[1]:g}_W_per_m2K"


def label_of(name):
    """Return the label of a run in figures."""
    return name.replace("_C_", " °C, ").replace("_W_per_m2K", " W/m²K").replace(f"{HOT:g} °C, 0 W/m²K",
                                                                               "no heat to the plug")


def combination(relaxes, chills, rubs):
    """Return the names of the factors that are present."""
    return " + ".join(f for f, there in zip(FACTORS, (relaxes, chills, rubs)) if there) or "none of the three"


def cases_of(quick):
    """Return {name: (relaxes, plug, friction)} of the plugs, of the eight combinations, and of runs for comparison."""
    plugs = [PLUGS[0], MOST] if quick else PLUGS
    cases = {name_of(plug): (True, plug, "by temperature") for plug in plugs} | {
        "straight vacuum": (True, None, "by temperature")}
    if not quick:
        cases |= {combination(*which): (which[0], MOST if which[1] else PLUGS[0],
                                        "by temperature" if which[2] else "none")
                  for which in np.ndindex(2, 2, 2) if which[0] == 0 or which[2] == 0}
        cases["cold plug, friction as hot"] = (True, MOST, "as hot")
    return cases


def effects(factorial):
    """Return {factor: {wall: effect, averaged over the other two}} of {(relaxes, chills, rubs): numbers}."""
    return {factor: {key: float(np.mean([(1 if which[k] else -1) * n[key] for which, n in factorial.items()]) * 2)
                     for key in KEYS} for k, factor in enumerate(FACTORS)}


def line(name, n):
    """Return a line about one run."""
    wall = ", ".join(f"{word} {n[key]:.4f}" for key, word in KEYS.items() if key in n)
    under = "" if "base_under_plug" not in n else (
        f"; under the plug {n['base_under_plug']:.4f}, {n['base_C_at_plug']:.1f} C at the plug")
    return f"{name}: {wall}{under}; {n['steps']} states, {n['solve_seconds']:.1f} s {n.get('stopped', '')[:200]}"


def draw(found, shapes, factorial):
    """Return a figure: the run of the coldest plug, the walls of all plugs, the effects of the factors."""
    figure, (sections, walls, bars) = figures.figure(3, width=4.2, height=4.2)
    sections.plot(*POT.mould.outline().T, "k", linewidth=1.2)
    sections.plot(*(POT.plug.outline() + [0, TRAVEL]).T, "0.6", linewidth=1.2)
    for k, (stage, profile) in enumerate(shapes[name_of(MOST)].items()):
        plots.outline(profile, sections, color=f"C{k}", label={"plug": "under the plug", "vacuum": "part"}[stage])
    sections.set(xlabel="r, mm", ylabel="z, mm", xlim=(0, 1.05 * RADIUS), ylim=(-5, 1.1 * DEPTH),
                 title=f"plug at {MOST[0]:g} °C")
    sections.legend(frameon=False, fontsize="small", loc="lower left")
    for name, of in shapes.items():
        if "vacuum" in of and ("_C_" in name or name == "straight vacuum") and name != name_of(PLUGS[-1]):
            walls.plot(of["vacuum"].reference_radius, of["vacuum"].wall_ratio, "k--" if name.startswith("s") else "-",
                       label=label_of(name))
    walls.set(xlabel="reference radius R, mm", ylabel="wall / original", ylim=(0, None), title="plugs")
    walls.legend(frameon=False, fontsize="small")
    rows = {combination(*which): n for which, n in factorial.items()} or found
    place = np.arange(len(rows))
    for k, (key, word) in enumerate(KEYS.items()):
        bars.barh(place + 0.27 * (1 - k), [n.get(key, np.nan) for n in rows.values()], 0.25, label=word)
    bars.set_yticks(place, [label_of(name).replace(" + ", "\n+ ").replace(", ", ",\n") for name in rows],
                    fontsize="x-small")
    bars.set(xlabel="wall / original", title="what makes the base")
    bars.legend(frameon=False, fontsize="small", loc="lower right")
    return figure


def main():
    options = parser("cold_plug", __doc__, elements=40, layers=2, accuracy=1e-2)
    args = options.parse_args()
    elements, accuracy = ((20, 1), 2e-2) if args.quick else ((args.elements, args.layers), args.accuracy)
    cases = cases_of(args.quick)
    results = sweep(form, [(*case, elements, accuracy) for case in cases.values()])
    found = {name: numbers for name, (numbers, _) in zip(cases, results)}
    shapes = {name: of for name, (_, of) in zip(cases, results)}
    for name, numbers in found.items():
        say(line(name, numbers))
    whole = {(cases[name][0], cases[name][1] == MOST, cases[name][2] != "none"): found[name] for name in cases
             if name not in ("straight vacuum", "cold plug, friction as hot") and cases[name][1] in (PLUGS[0], MOST)}
    summary: dict = {"plugs": {name: found[name] for name in found if "_C_" in name},
                     "beside": {name: found[name] for name in found if name == "straight vacuum" or "as hot" in name}}
    if len(whole) == 8:
        whole = dict(sorted(whole.items()))
        summary["factors"] = {combination(*which): numbers for which, numbers in whole.items()}
        if all("base" in numbers for numbers in whole.values()):
            summary["effects"] = effects(whole)
            for factor, by in summary["effects"].items():
                say(f"{factor}: " + ", ".join(f"{word} {by[key]:+.4f}" for key, word in KEYS.items())
                    + " of the sheet's thickness, averaged over the other two")
        files.write_rows(args.out / "factors.csv", [*FACTORS, *KEYS], [
            [*map(int, which), *(numbers.get(key, np.nan) for key in KEYS)] for which, numbers in whole.items()], COMM)
    save(draw(found, shapes, whole if len(whole) == 8 else {}), args.out / "cold_plug.png")
    summarise(args.out, summary | {"mesh": {"radius_elements": elements[0], "thickness_elements": elements[1]},
                                   "accuracy": accuracy, "versions": files.versions()})


if __name__ == "__main__":
    main()
