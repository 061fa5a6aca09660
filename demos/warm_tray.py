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
HEATERS = ([0.0, 50.0, 80.0], [0.0, 30.0, 50.0], [[300.0, 305.0, 330.0], [305.0, 310.0, 335.0], [330.0, 335.0, 350.0]])
STIFFNESS = {20.0: 0.6, 90.0: 0.6, 110.0: 0.25, 130.0: 0.1, 150.0: 0.05, 180.0: 0.03, 350.0: 0.03}  # c10 by temperature
SET, SETTING = (80.0, 100.0), 80.0                                     # solidification, and the card's temperature
FRICTION = {20.0: 0.1, 40.0: 0.1, 100.0: 0.2, 130.0: 0.4, 160.0: 0.6, 350.0: 0.6}  # of the plug, by temperature
PLUG, MOULD = (0.8e-3, 60.0), (0.6e-3, 25.0)                           # contact conductance, temperature
CORE, TRANSFER, TRAVEL, SPEED, SEAL, VACUUM, EVACUATION, HOLD = 150.0, 1.5, 34.0, 50.0, 0.01, 0.09, 0.5, 10.0
RIM, DEPTH = -6.0, 36.0                                               # z of the flange, depth of the mould below it
MELT = fx.ThermalProperties(conductivity=0.2e-3, density=1.05e-3, heat_capacity=1.9)
UNIFORM = fx.ThermalProperties(conductivity=0.2, density=1.05e-3, heat_capacity=1.9)      # one temperature at a node
CASES = ("all", "no_chill", "constant_friction", "one_temperature")
UNITS = fx.Units(length="mm", stress="MPa", time="s")

RADIUS, DISC, PLACES = 40.0, 0.8, ("0", "0.25", "0.5", "0.75")         # the disc, places over its radius
DISC_MOULD = fx.Tool([(60.0, 0.0), (34.0, 0.0), (28.0, -18.0), (0.0, -18.0)], [0.0, 6.0, 10.0, 0.0])
DISC_PLUG, DISC_MOULD_TEMPERATURE = fx.tools.sphere(radius=16.0, z=0.0), 20.0
SECTION, NEIGHBOURS = 40, 8                                            # elements of the section, nodes of a mean


def material():
    """Return the polymer: a melt that relaxes, and solidifies on cooling."""
    shift = fx.Arrhenius(90e3, 150.0, unit="C")
    melt = fx.Viscoelastic(fx.NeoHookean(c10=fx.table(STIFFNESS)), [(0.1, 0.5)], shift=shift)
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
    mould = fx.tools.box(half=(72, 42), depth=DEPTH, corner=18, fillet=8, lip=3, draft=8).moved(z=RIM)
    plug = fx.tools.box(half=(48, 22), depth=40, corner=14, fillet=8, draft=5, mouth=40, plug=True)
    table = fx.table(FRICTION)
    scene = fx.Scene(
        mesh=sheet, thickness=THICKNESS, materials=material(), temperature=START, heat=cooling(case),
        model=fx.Membrane(wrinkles=0.01),
        supports=[fx.SimplySupported("rim"), fx.Symmetry("x0", "x"), fx.Symmetry("y0", "y")],
        loads=[fx.Pressure("top", name="vacuum"), fx.Gravity(1e-9 * DENSITY, 9810.0)],
        contacts=[fx.Contact("bottom", mould, "stick", name="mould"),
                  fx.Contact("top", plug, float(table(CORE)) if case == "constant_friction" else table,
                             direction=(0, 0, -1), name="plug")])
    cold = ["heater bottom", "heater top"]
    return fx.Process(scene).run([
        fx.Stage("oven", until=fx.temperature(CORE, at=(0.0, 0.0)), duration=90.0, inactive=["plug", "mould"]),
        fx.Stage("transfer", duration=TRANSFER, inactive=[*cold, "plug", "mould"]),
        fx.Stage("plug", control="plug", until=fx.travel(TRAVEL), speed=SPEED, inactive=cold),
        fx.Stage("seal", control="vacuum", until=fx.pressure(SEAL), inactive=cold),
        fx.Stage("vacuum", control="vacuum", until=fx.pressure(VACUUM), duration=EVACUATION, inactive=[*cold, "plug"]),
        fx.Stage("hold", duration=HOLD, inactive=[*cold, "plug"])], progress=False, accuracy="draft")


def formed(path):
    """Return the last state before the hold: the sheet has just been drawn into the mould."""
    return path.state("vacuum")


def numbers(path):
    """Return the summary's numbers of a tray: walls, time to demould, difference between both faces at the base."""
    wall = path.wall()
    X, z = wall.reference_points[:, :2], wall.deformed_points[:, 2]
    base = int(np.argmin(np.hypot(*X.T)))
    part = z < RIM - 1.0                                                # without the flange
    thick = X[int(np.argmax(np.where(part, wall.at_nodes, 0.0)))]
    times, hottest = cooled(path, thick)
    low = wall.middle[:, 2] < RIM - DEPTH * 2 / 3
    faces = path.temperature([(0.0, 0.0)] * 2, formed(path), depth=[0.0, 1.0])
    below = np.flatnonzero(hottest < SETTING)
    return {"base_wall_mm": float(wall.at_nodes[base]), "corner_wall_mm": float(wall.wall[low].min()),
            "time_to_demould_s": float(np.interp(-SETTING, -hottest, times)) if len(below) else None,
            "faces_differ_C": float(faces[1] - faces[0])}


def cooled(path, place):
    """Return times since the end of forming, and the hottest temperature of the column at a place (x, y)."""
    depths, begin = np.linspace(0.0, 1.0, 21), formed(path).time
    states = [state for state in path.states if state.time >= begin and state.stage in ("vacuum", "hold")]
    hottest = [path.temperature([place] * len(depths), state, depth=depths).max() for state in states]
    return np.array([state.time - begin for state in states]), np.array(hottest)


def disc_scene(section, size):
    """Return the scene of a quarter of a disc with triangles of an edge length `size`, or of its section."""
    heat = fx.Cooling(fx.ThermalProperties(conductivity=0.25e-3, density=1e-3, heat_capacity=2.0), [
        fx.Radiation("top", emissivity=0.9, heater=500.0, stefan_boltzmann=SIGMA, name="heater"),
        fx.Convection("top", h=1.5e-5, air=AIR), fx.Convection("bottom", h=1e-5, air=AIR)], unit="C",
        tools={"plug": (0.3e-3, 70.0), "mould": (0.8e-3, DISC_MOULD_TEMPERATURE)})
    stiffness = fx.table({20.0: 0.5, 80.0: 0.3, 110.0: 0.12, 140.0: 0.06, 180.0: 0.03})
    options = {"materials": fx.NeoHookean(c10=stiffness), "temperature": 130.0, "heat": heat,
               "loads": [fx.Pressure("top", name="air")]}
    friction = fx.table({60.0: 0.05, 130.0: 0.5})
    if section:
        return fx.Scene(
            mesh=fx.mesh.disc(radius=RADIUS, thickness=DISC, elements=(SECTION, [0.06, 0.12, 0.2, 0.2, 0.12, 0.06])),
            supports=[fx.SimplySupported("rim"), fx.Symmetry("axis")], **options,
            contacts=[fx.Contact("bottom", DISC_MOULD, "stick", name="mould"),
                      fx.Contact("top", DISC_PLUG.moved(z=DISC), friction, direction=(0, -1), name="plug")])
    return fx.Scene(
        mesh=fx.mesh.sheet(fx.mesh.circle(RADIUS, part="quarter"), size=size), thickness=DISC, **options,
        supports=[fx.SimplySupported("rim"), fx.Symmetry("x0", "x"), fx.Symmetry("y0", "y")],
        contacts=[fx.Contact("bottom", fx.tools.revolved(DISC_MOULD), "stick", name="mould"),
                  fx.Contact("top", fx.tools.revolved(DISC_PLUG), friction, direction=(0, 0, -1), name="plug")])


def disc(section, size=4.0):
    """Return the temperatures of both faces at the centre, C, the wall ratios at PLACES, and the plug's force, N."""
    path = fx.Process(disc_scene(section, size)).run([
        fx.Stage("oven", duration=3.0, inactive=["plug", "mould"]),
        fx.Stage("plug", control="plug", until=fx.travel(12.0), speed=60.0, inactive=["heater"]),
        fx.Stage("blow", control="air", until=fx.pressure(0.06), duration=0.4, inactive=["heater", "plug"]),
        fx.Stage("hold", duration=1.0, inactive=["heater", "plug"])], progress=False)
    if section:
        faces = path.temperature([(0.0, 0.0), (0.0, DISC)])
        ratios = [path.profile().thickness_ratio_at(RADIUS * float(place)) for place in PLACES]
    else:
        faces, wall = path.temperature([(0.0, 0.0)] * 2, depth=[0.0, 1.0]), path.wall()
        R = np.hypot(*wall.reference_points[:, :2].T)
        ratios = []
        for at in (RADIUS * float(place) for place in PLACES):          # the wall is even in R: a line over R squared
            near = np.argsort(np.abs(R - at))[:NEIGHBOURS]
            ratios.append(np.polynomial.Polynomial.fit(R[near] ** 2, wall.at_nodes[near], 1)(at**2) / DISC)
    return {"faces": dict(zip(("bottom", "top"), map(float, faces))), "ratios": dict(zip(PLACES, map(float, ratios))),
            "force": float(np.abs(path["plug_force"]).max()), "seconds": path.counts.seconds}


def write(path, out, view):
    """Write the tray's wall, the temperatures of its faces at the end of forming, and pictures to a folder."""
    wall, state = path.wall(), formed(path)
    wall.to_csv(out / "wall.csv", UNITS)
    X = wall.reference_points[:, :2]
    faces = np.array([path.temperature(X, state, depth=depth) for depth in (0.0, 1.0)])
    np.savetxt(out / "faces.csv", np.column_stack([X, faces.T]), delimiter=",", fmt="%.6g", comments="",
               header="x [mm],y [mm],bottom,top")
    figure, (left, right) = figures.figure(2, width=4.6)
    drawn = left.tripcolor(*X.T, wall.triangles, faces[0], shading="gouraud", cmap="coolwarm")
    figure.colorbar(drawn, ax=left, label="bottom face, C")
    left.set(xlabel="x, mm", ylabel="y, mm", aspect="equal", title="when the sheet has been drawn into the mould")
    states = [s for s in path.states if s.time > 0]
    for name, depth in (("bottom", 0.0), ("middle", 0.5), ("top", 1.0)):
        right.plot([s.time for s in states], [path.temperature([(0.0, 0.0)], s, depth=depth)[0] for s in states],
                   label=name)
    right.set(xlabel="time, s", ylabel="temperature at the centre, C")
    right.legend()
    save(figure, out / "warm_tray.png")
    if view:
        path.view3d(out / "warm_tray_part.png")


def main():
    options = parser("warm_tray", __doc__)
    options.add_argument("--size", type=float, default=8.0, help="size of the triangles, mm")
    args = options.parse_args()
    size, cases = (32.0, CASES[:1]) if args.quick else (args.size, CASES)
    summary = {"base_wall_mm": {}, "corner_wall_mm": {}, "cost": {}}
    for case in cases:
        path = tray(case, size)
        found = numbers(path)
        summary["base_wall_mm"][case] = found["base_wall_mm"]
        summary["cost"][case] = {"seconds": path.counts.seconds, "iterations": path.counts.iterations}
        say(f"{case}: base {found['base_wall_mm']:.4g} mm, corner {found['corner_wall_mm']:.4g} mm, faces differ by"
            f" {found['faces_differ_C']:.3g} C; {len(path)} states, {path.counts.seconds:.0f} s")
        if case == "all":
            summary["corner_wall_mm"][case] = found["corner_wall_mm"]
            summary |= {name: found[name] for name in ("time_to_demould_s", "faces_differ_C")}
            summary["weight_g"] = path.part(density=DENSITY, units=UNITS).weight
            summary["oven"] = {"time_s": path.state("oven").time, "sag_mm": path.state("oven").measures["sag"]}
            write(path, args.out, not args.quick)
    discs = {"3d": disc(False, 12.0)} if args.quick else {"3d": disc(False), "section": disc(True)}
    summary["disc"] = {"face_temperature_C": {name: found["faces"] for name, found in discs.items()},
                       "wall_ratio": {name: found["ratios"] for name, found in discs.items()},
                       "plug_force_N": {name: found["force"] for name, found in discs.items()}}
    for name, found in discs.items():
        say(f"disc, {name}: faces {found['faces']['bottom']:.2f} and {found['faces']['top']:.2f} C, walls "
            + ", ".join(f"{value:.4f}" for value in found["ratios"].values()) + f"; plug {found['force']:.4g} N;"
            f" {found['seconds']:.0f} s")
    summarise(args.out, {**summary, "versions": files.versions()})


if __name__ == "__main__":
    main()
