"""Form a tray of two compartments from CAD files, STEP and STL, by plug and vacuum with friction, of a relaxing sheet.

The script itself draws the mould in OpenCASCADE through gmsh: 120 mm by 80 mm at its mouth and 26 mm deep, walls at 8
degrees to the axis, a rib 14 mm high across the middle, fillets of 6 mm and a lip of 4 mm. It is written as STEP, with
exact surfaces, and as STL, in triangles. Two plugs, one for each compartment, are one tool. The sheet slides with
friction on plugs and mould. It is formed three times: on the STEP file, on the STL file with a smooth surface, and on
the flat triangles of the STL file. Meshes are adapted until the minimum wall of two in succession agrees to 3 %.

A disc that a ball pushes, with friction, compares the surface of an STL file with an exact tool. The ball is a
`fx.tools.sphere`, or a sphere of 80 triangles. Lengths in mm, stresses in MPa, times in s.
"""

import numpy as np
from common import COMM, parser, say, summarise

import formingx as fx
from formingx.io.stl import write_stl
from formingx.mesh import with_gmsh
from formingx.results import files

HALF, CORNER, DEPTH, DRAFT = np.array([60.0, 40.0]), 16.0, 26.0, np.tan(np.radians(8.0))
RIB = [(-9.0, -30.0), (9.0, -30.0), (5.0, -12.0), (-5.0, -12.0)]     # section (x, z) of the rib
FILLET, LIP, EDGE = 6.0, 4.0, 3.5                                     # radii: foot, mouth, top of the rib
SHEET, THICKNESS, DENSITY, FRICTION = (150.0, 110.0), 1.2, 1.05, 0.3
TRIM = fx.mesh.rectangle(134.0, 94.0, corner=23.0)
MATERIAL = fx.Viscoelastic(fx.NeoHookean(c10=0.05), [(0.12, 0.5)])
UNITS = fx.Units(length="mm", stress="MPa", time="s")
PLUG_TRAVEL, VACUUM, AGREE = 16.0, 0.08, 0.03
HELD = [fx.SimplySupported("rim"), fx.Symmetry("x0", "x"), fx.Symmetry("y0", "y")]


def rounded_wire(occ, half, corner, z):
    """Return the tag of a rectangle with rounded corners at a height."""
    a, b = half - corner
    ends, lines = [], []
    for k, (x, y) in enumerate([(a, b), (-a, b), (-a, -b), (a, -b)]):
        t = np.array([k, k + 1]) * np.pi / 2
        first, last = (occ.addPoint(x + corner * np.cos(s), y + corner * np.sin(s), z) for s in t)
        ends.append((first, occ.addPoint(x, y, z), last))
    for k, (first, middle, last) in enumerate(ends):
        lines += [occ.addCircleArc(first, middle, last), occ.addLine(last, ends[(k + 1) % 4][0])]
    return occ.addWire(lines)


def boxes(gmsh, solid):
    """Return {tag of an edge of a solid: its bounding box}."""
    gmsh.model.occ.synchronize()
    faces = gmsh.model.getBoundary([(3, solid)], oriented=False)
    edges = {tag for _, tag in gmsh.model.getBoundary(faces, combined=False, oriented=False)}
    return {tag: np.array(gmsh.model.getBoundingBox(1, tag)).reshape(2, 3) for tag in sorted(edges)}


def is_sharp(gmsh, edge):
    """Return True if two faces meet at an edge at an angle."""
    low, high = gmsh.model.getParametrizationBounds(1, edge)
    point = gmsh.model.getValue(1, edge, [(low[0] + high[0]) / 2])
    a, b = (np.array(gmsh.model.getNormal(face, gmsh.model.getParametrization(2, face, point)))
            for face in gmsh.model.getAdjacencies(1, edge)[0])
    return abs(abs(a @ b) - 1) > 1e-3


def draw_mould(step, stl, angle):
    """Write the mould as STEP, and as STL with triangles that turn by at most an angle, degrees."""
    options = {"General.NumThreads": 1.0, "Mesh.MeshSizeFromCurvature": 360.0 / angle, "Mesh.MeshSizeMax": 15.0}
    with with_gmsh.model("tray", options) as gmsh:
        occ, bottom = gmsh.model.occ, -DEPTH - 10
        block = occ.addBox(-80, -60, bottom, 160, 120, -bottom)
        wires = [rounded_wire(occ, HALF + z * DRAFT, CORNER + z * DRAFT, z) for z in (-DEPTH, 4.0)]
        mould = occ.cut([(3, block)], occ.addThruSections(wires, makeSolid=True, makeRuled=True))[0][0][1]
        points = [occ.addPoint(x, -50, z) for x, z in RIB]
        section = occ.addPlaneSurface([occ.addWire([occ.addLine(a, b) for a, b in zip(
            points, [*points[1:], points[0]])])])
        rib = next(tag for dim, tag in occ.extrude([(2, section)], 0, 100, 0) if dim == 3)
        top = [tag for tag, box in boxes(gmsh, rib).items()
               if np.allclose(box[:, 2], RIB[2][1], atol=1e-3) and np.ptp(box[:, 1]) > 50]
        rib = occ.fillet([rib], top, [EDGE])[0][1]
        mould = occ.fuse([(3, mould)], [(3, rib)])[0][0][1]
        inner = {tag: box for tag, box in boxes(gmsh, mould).items() if (np.abs(box[:, :2]) < HALF + 2).all()}
        foot = [tag for tag, box in inner.items() if box[1, 2] < -1 and is_sharp(gmsh, tag)]
        mould = occ.fillet([mould], foot, [FILLET])[0][1]
        lip = [tag for tag, box in boxes(gmsh, mould).items()
               if (np.abs(box[:, :2]) < HALF + 2).all() and np.allclose(box[:, 2], 0, atol=1e-3)]
        occ.fillet([mould], lip, [LIP])
        occ.synchronize()
        gmsh.write(str(step))
        gmsh.model.mesh.generate(2)
        gmsh.write(str(stl))


def plugs():
    """Return two plugs, one for each compartment, as one tool."""
    plug = fx.tools.box(half=(15.0, 24.0), depth=30.0, corner=10.0, fillet=6.0, draft=5.0, mouth=30.5, plug=True)
    return fx.tools.union(plug.moved(x=32.0), plug.moved(x=-32.0), names=["right", "left"])


def form(sheet, mould, share=1.0):
    """Return the path of plug and vacuum, or of a share of both, on the mesh of a quarter of the sheet."""
    contacts = [fx.Contact("bottom", mould, FRICTION, nodes_per_step=0.03, name="mould"),
                fx.Contact("top", plugs(), FRICTION, direction=(0, 0, -1), nodes_per_step=0.03, name="plug")]
    scene = fx.Scene(mesh=sheet, thickness=THICKNESS, materials=MATERIAL, supports=HELD, contacts=contacts,
                     loads=[fx.Pressure("top", name="vacuum")], model=fx.Membrane(wrinkles=0.01))
    stages = [fx.Stage("plug", control="plug", until=fx.travel(share * PLUG_TRAVEL), speed=80.0),
              fx.Stage("vacuum", control="vacuum", until=fx.pressure(share * VACUUM), speed=0.2)]
    return fx.Process(scene).run(stages, progress=False)


def push(tool, size):
    """Return the path of a disc that a ball pushes with friction; least wall over thickness, force on the whole disc.
    """
    sheet = fx.mesh.sheet(fx.mesh.circle(1.0, part="quarter"), size=size)
    contact = fx.Contact("top", tool, 0.3, direction=(0, 0, -1), name="ball")
    scene = fx.Scene(mesh=sheet, thickness=0.01, materials=fx.NeoHookean(c10=1.0), supports=HELD, contacts=[contact])
    path = fx.trace(scene, until=fx.travel(0.6), progress=False)
    return {"least_wall": float(path.wall().ratio.min()), "force": float(path["tool_force"][-1]),
            "states": len(path), "iterations": path.counts.iterations}


def ball_of_triangles(file, radius):
    """Write a sphere of 80 triangles: an icosahedron, each triangle divided into four."""
    g = (1 + 5 ** 0.5) / 2
    points = [np.array(p) / np.hypot(1, g) for p in (
        (-1, g, 0), (1, g, 0), (-1, -g, 0), (1, -g, 0), (0, -1, g), (0, 1, g), (0, -1, -g), (0, 1, -g), (g, 0, -1),
        (g, 0, 1), (-g, 0, -1), (-g, 0, 1))]
    faces = [(0, 11, 5), (0, 5, 1), (0, 1, 7), (0, 7, 10), (0, 10, 11), (1, 5, 9), (5, 11, 4), (11, 10, 2), (10, 7, 6),
             (7, 1, 8), (3, 9, 4), (3, 4, 2), (3, 2, 6), (3, 6, 8), (3, 8, 9), (4, 9, 5), (2, 4, 11), (6, 2, 10),
             (8, 6, 7), (9, 8, 1)]
    middles = {}
    for a, b in {tuple(sorted((f[i], f[i - 1]))) for f in faces for i in range(3)}:
        middles[a, b] = middles[b, a] = len(points)
        points.append((points[a] + points[b]) / np.linalg.norm(points[a] + points[b]))
    triangles = [t for a, b, c in faces for p, q, r in [(middles[a, b], middles[b, c], middles[c, a])]
                 for t in ((a, p, r), (b, q, p), (c, r, q), (p, q, r))]
    write_stl(radius * (np.array(points) + (0, 0, 1)), np.array(triangles), file)


def main():
    options = parser("cad_tray", __doc__)
    options.add_argument("--size", type=float, default=2.5, help="size of the triangles of the first mesh, mm")
    options.add_argument("--adapted", type=int, default=4, help="largest number of meshes that are then adapted")
    args = options.parse_args()
    size, more, disc, share = (12.0, 0, 0.25, 0.1) if args.quick else (args.size, args.adapted, 0.05, 1.0)
    angle = 30.0 if args.quick else 15.0
    if COMM.rank == 0:
        args.out.mkdir(parents=True, exist_ok=True)
        draw_mould(args.out / "mould.step", args.out / "mould.stl", angle)
        ball_of_triangles(args.out / "ball.stl", 0.35)
    COMM.Barrier()
    moulds = {"step": fx.tools.solid(args.out / "mould.step", angle=angle),
              "stl": fx.tools.solid(args.out / "mould.stl"), "flat": fx.tools.solid(args.out / "mould.stl", crease=0)}
    balls = {"analytic": fx.tools.revolved(fx.tools.sphere(radius=0.35)),
             "stl80": fx.tools.solid(args.out / "ball.stl")}
    summary: dict = {"disc": {name: push(ball, disc) for name, ball in balls.items()}}
    sheet = fx.mesh.sheet(fx.mesh.rectangle(*SHEET, corner=20.0, part="quarter"), size=size)
    walls, path = [], None
    for k in range(more + 1):
        sheet = fx.mesh.adapted(path, max_rotation=0.5, error=0.2) if path else sheet
        path = form(sheet, moulds["step"], share)
        walls.append(path.part().min_wall)
        say(f"mesh {k + 1}: {len(path.wall().wall)} triangles, least wall {walls[-1]:.4g} mm, {len(path)} states,"
            f" {path.counts.seconds:.0f} s")
        if k and abs(walls[-1] / walls[-2] - 1) < AGREE:
            break
    paths = {"step": path, **{name: form(sheet, moulds[name], share) for name in ("stl", "flat")}}
    part = path.part(density=DENSITY, trim=TRIM, units=UNITS)
    say(str(part), *path.findings())
    summary |= {"least_wall_mm": {name: each.part(trim=TRIM).min_wall for name, each in paths.items()},
                "least_at_mm": dict(zip("xyz", part.min_wall_at)), "weight_g": part.weight,
                "draw_ratio": part.draw_ratio, "states": len(path), "iterations": path.counts.iterations,
                "failures": path.counts.failures, "triangles": len(path.wall().wall), "meshes_least_wall_mm": walls,
                "file_triangles": {name: mould.triangles for name, mould in moulds.items()},
                "seconds": {name: each.counts.seconds for name, each in paths.items()}}
    path.wall().to_csv(args.out / "wall.csv", UNITS)
    path.to_csv(args.out / "cad_tray.csv")
    path.to_stl(args.out / "part.stl")
    if not args.quick:
        path.view3d(args.out / "cad_tray.png")
        path.report(args.out / "report.html", "Tray from CAD files", units=UNITS, density=DENSITY, trim=TRIM)
    summarise(args.out, {**summary, "versions": files.versions()})


if __name__ == "__main__":
    main()
