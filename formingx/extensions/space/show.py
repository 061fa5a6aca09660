"""Pictures, closed surfaces, shell models and reports of parts in three dimensions."""

from __future__ import annotations

import html
from functools import partial
from pathlib import Path as FilePath
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from ... import figures
from ...errors import InputError
from ...mesh.edges import edges_of
from ...results import files
from ...results.show import interactive, page
from ...results.show.attempts import Attempts
from ...results.show.interactive import rounded
from ...results.show.report import PROCESS, finding_element, introduction, jumps, scripts, versions
from ...results.show.report_data import of_path, words
from ...results.show.views import camera_direction, look, plotted, shading
from ...scene.summary import summary
from ...units import Units
from .wall import thinnest_triangle, wall_of

_DRAWN, _FRAMES = 200_000, (10, 100)
"""Largest number of nodes of all drawn states of a report together; smallest and largest number of drawn states."""

_DRAWN_AREA = 0.99
"""Share of the area whose wall is within the range of colours; a pinch is thicker."""

_LARGEST_TOOL = _DRAWN // _FRAMES[0]
"""Largest number of triangles of a tool that a report draws, as many as nodes of the body."""


def view(path: Any, state: Any, file: Any, grid: float | None = None, camera: Any = None,
         values: np.ndarray | None = None, name: str = "") -> None:
    """Draw the whole part as PNG, completed by mirror images (rank 0 draws).

    grid: size of the squares of a grid printed on the flat sheet, length. camera: see `Path.view3d`. values: values of
    the triangles for the colours, shape (m,), and their `name`; None: wall over reference thickness. Raise `InputError`
    without screen and Xvfb.
    """
    file, wall = files.named("view3d", file, ".png"), wall_of(path, state)
    low, high = wall.deformed_points[:, 2].min(), wall.deformed_points[:, 2].max()
    default = (1.4, -2.6, 0.9) if not wall.flat else (0.8, -2.0, 3.6) if low < -high else (1.7, -2.4, 1.7)     # look in
    away = camera_direction(camera, default)
    shown = wall.ratio if values is None else values         # of each triangle: means at nodes hide the thinnest
    lines = wall.printed(grid) if grid else []
    images = path.scene.symmetry.images(3)

    def draw():
        """Draw the part and the lines of the grid into the file, on rank 0."""
        pyvista = figures.pyvista()
        size = np.ptp(wall.deformed_points, axis=0).max()
        lift = 0.004 * size * away / np.linalg.norm(away)           # else lines flicker
        order = np.argsort(shown)
        largest = shown[order][np.searchsorted(np.cumsum(wall.area[order]), _DRAWN_AREA * wall.area.sum())]
        with plotted(file) as plotter:
            add_part(plotter, wall, shown, images, **shading(np.minimum(shown, largest), name), specular=0.2,
                     split_sharp_edges=False)
            for scale, shift in images:
                for line in lines:
                    plotter.add_mesh(pyvista.lines_from_points(line * scale + shift + lift), color="black",
                                     line_width=1.5)
            look(plotter, away, np.vstack([wall.deformed_points * scale + shift for scale, shift in images]))
    files.on_root(path.problem.comm, draw)


def add_part(plotter: Any, wall: Any, values: np.ndarray, images: Any, **style: Any) -> None:
    """Add a wall and its images to a pyvista plotter, coloured by values of the triangles, shape (m,).

    images: pairs (scale, shift) of positions; style: arguments of `add_mesh`, with the colours by "ratio".
    """
    faces = np.column_stack([np.full(len(wall.triangles), 3), wall.triangles]).ravel()
    for scale, shift in images:
        surface = figures.pyvista().PolyData(wall.deformed_points * scale + shift, faces)
        surface.cell_data["ratio"] = values
        plotter.add_mesh(surface, **style)


_LARGEST_MITRE = 3.0
"""Largest distance of a node from the mid-surface over half of the wall, at a sharp fold."""


def solid(path: Any, state: Any) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the closed surface of the whole part in a state, completed by mirror images.

    Points, shape (n, 3), length; triangles, outward, shape (m, 3); wall over reference wall there, shape (n,). Half of
    the wall lies on each side of the mid-surface: nodes move along their normals, farther at folds, to the volume of
    the walls.
    """
    wall, planes = wall_of(path, state), path.scene.symmetry
    on = [np.abs(wall.reference_points[:, plane.axis] - plane.position) < planes.near for plane in planes.planes]
    corners = wall.deformed_points[wall.triangles]
    normal, n = np.zeros_like(wall.deformed_points), len(wall.deformed_points)
    each = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    np.add.at(normal, wall.triangles.ravel(), np.repeat(each, 3, axis=0))
    for plane, mask in zip(planes.planes, on):
        normal[mask, plane.axis] = 0.0
    area = np.zeros(n)
    np.add.at(area, wall.triangles.ravel(), np.repeat(np.linalg.norm(each, axis=1), 3))
    size = np.linalg.norm(normal, axis=1)
    normal *= (wall.at_nodes / 2 / size * np.minimum(area / size, _LARGEST_MITRE))[:, None]
    directed, _, numbers, times = edges_of(wall.triangles)
    rim = directed[(times[numbers] == 1) & ~np.any([mask[directed].all(1) for mask in on] or [False], axis=0)]
    side = np.concatenate([np.column_stack([rim[:, 1], rim[:, 0], rim[:, 0] + n]),
                           np.column_stack([rim[:, 1], rim[:, 0] + n, rim[:, 1] + n])])
    triangles = np.concatenate([wall.triangles[:, ::-1], wall.triangles + n, side[:, ::-1]])
    points = np.vstack([wall.deformed_points - normal, wall.deformed_points + normal])
    ratio = np.tile(wall.to_nodes(wall.ratio), 2)
    kept = [np.tile(mask, 2) for mask in on]
    for k, plane in enumerate(planes.planes):                # the image, which shares the nodes in the plane
        image, away = np.arange(len(points)), ~kept[k]
        image[away] = len(points) + np.arange(away.sum())
        unit = np.eye(3)[plane.axis]
        points = np.vstack([points, points[away] * (1 - 2 * unit) + 2 * plane.position * unit])
        triangles = np.vstack([triangles, image[triangles][:, ::-1]])
        ratio, kept = np.append(ratio, ratio[away]), [np.append(mask, mask[away]) for mask in kept]
    return points, triangles, ratio


def shell_model(path: Any, file: Any, state: Any = None) -> None:
    """Write the modelled part as shell elements in an input file for Abaqus or CalculiX (rank 0 writes).

    Each triangle is an S3 element whose section thickness is its deformed wall thickness. The user adds the material
    POLYMER, and constrains a half or a quarter at its planes of symmetry.
    """
    file, wall = files.named("shell_model", file, ".inp"), wall_of(path, state or path.last)

    def write(stream):
        """Write nodes, elements and shell sections of the part to an open text file."""
        stream.write("** formed part: shells with the wall of each element\n*NODE\n")
        stream.writelines(f"{k}, {x:.9g}, {y:.9g}, {z:.9g}\n" for k, (x, y, z) in enumerate(wall.deformed_points, 1))
        stream.write("*ELEMENT, TYPE=S3, ELSET=PART\n")
        stream.writelines(f"{k}, {a}, {b}, {c}\n" for k, (a, b, c) in enumerate(wall.triangles + 1, 1))
        for k, h in enumerate(wall.wall, 1):
            stream.write(f"*ELSET, ELSET=E{k}\n{k}\n*SHELL SECTION, ELSET=E{k}, MATERIAL=POLYMER\n{h:.9g}\n")
    files.on_root(path.problem.comm, lambda: files.replace(file, write))


def report(path: Any, file: Any, title: str, failure: Any, units: Units, density: float | None, trim: Any) -> FilePath:
    """Write the HTML report of a run in three dimensions on rank 0, and return its path; see `Reader.report`."""
    from .part import part
    wall, last, comm = path.wall(), path.last, path.problem.comm
    planes, record = path.scene.symmetry, of_path(path)
    found, attempts = part(wall, density, trim, (), units, planes), Attempts(InputError, ImportError)
    record.drawn = int(np.clip(_DRAWN // len(wall.reference_points), *_FRAMES))
    surfaces = attempts.make("the drawing of the body", lambda: {"mesh": _mesh(path, record, units)}, {})
    cut: list[dict[str, Any]] = attempts.make("the cut", lambda: _cut(wall, units), [])
    drawn = interactive.data([record], [title or "run"], units, attempts, surfaces, cut)
    size = np.ptp(wall.reference_points, axis=0).max() / 12
    pictures: list[str] = []
    with TemporaryDirectory() as folder:
        for caption, grid in (("The wall over the original thickness.", None),
                              ("Squares that were printed on the body.", size)):
            target = FilePath(folder) / "picture.png"
            try:
                attempts.make(f"the picture {caption[:-1]!r}", partial(view, path, last, target, grid), None)
            except (InputError, ImportError) as error:
                pictures = [f"<p class=note>No pictures: {html.escape(str(error))}.</p>"]
                break
            if comm.rank == 0 and target.exists():
                pictures.append(page.picture(target.read_bytes(), caption, "wide"))
                target.unlink()
    body = [f"<h1>{html.escape(title or 'Report of a run')}</h1>", f"<p class=lead>{introduction(record, units)}</p>"]
    if failure is not None:
        body.append(f"<div class='note bad'><h2>The run could not go on</h2><p>{page.lines(str(failure))}</p></div>")
    body += map(finding_element, [*record.findings, *attempts.findings])
    body += [PROCESS, "<div class=grid>", *pictures, "</div><h2>Key numbers</h2>",
             page.table(["", ""], [list(row) for row in found.rows]), "<h2>Curves</h2><div id=charts class=grid></div>"]
    names = list(dict.fromkeys(state.stage for state in path.states))
    columns = [c for c in path.columns if not c.endswith("error")]
    ends = [next(s for s in reversed(path.states) if s.stage == name) for name in names]
    body += ["<h2>Stages</h2>", page.table(["stage", *(units.label(c) for c in columns)], [
        [state.stage or "run", *(page.number(state.measures[c]) for c in columns)] for state in ends])]
    body += [attempts.make("the table of parts of tools", lambda: _parts_of_tools(path, ends, units), ""),
             jumps(record), "<h2>Inputs</h2>",
             page.table(["", ""], [[k, v] for k, v in summary(path.problem.scene).items()]),
             "<h2>Made with</h2>", page.table(["", ""], versions([record]))]

    def make() -> None:
        """Write the HTML page of the report, on rank 0."""
        text = page.page(title or "Report of a run", body, scripts(drawn))
        files.replace(file, lambda stream: stream.write(text))
    files.on_root(comm, make)
    return FilePath(file)


def _parts_of_tools(path: Any, states: list[Any], units: Units) -> str:
    """Return an HTML table of the parts of unions in some states, with their share of the contact; "" without unions.

    Forces are those of the whole part, along the travel of the tool, or along z if it is fixed.
    """
    from .part import filling
    rows, factor = [], path.scene.symmetry_factor
    for face in path.problem.contacts:
        contact = face.contact
        way = contact.travel_vector if contact.direction is not None else np.array([0.0, 0.0, -1.0])
        found = filling(path, face, states) if hasattr(contact.tool, "names") else None
        for name, (touching, force) in found.parts.items() if found else ():
            rows += [[contact.label, name, words(state.stage) or "run", f"{share:.1%}", page.number(value)]
                     for state, share, value in zip(states, touching, -factor * force @ way)]
    head = ["tool", "part", "end of", "share of the body that touches it", units.label("force", "force on it")]
    note = "<p class=lead>A part counts together with its images in the planes of symmetry.</p>" if factor > 1 else ""
    return f"<h2>Parts of tools</h2>{note}{page.table(head, rows)}" if rows else ""


def _cut(wall: Any, units: Units) -> list[dict[str, Any]]:
    """Return two charts, shape and wall, of the cut through the thinnest triangle along the longer side of the part."""
    thinnest = wall.middle[thinnest_triangle(wall)]
    axis = int(np.argmax(np.ptp(wall.deformed_points[:, :2], axis=0)))
    normal = np.eye(3)[1 - axis]
    cut = wall.section(tuple(thinnest), tuple(normal))
    along, across = "xy"[axis], "xy"[1 - axis]
    place = f"{across} = {thinnest[1 - axis]:.4g}{f' {units.length}' if units.length else ''}"
    shape = {"x": rounded(cut[along]), "y": rounded(cut["z"]), "name": "cut", "mode": "lines"}
    mark = {"x": [float(thinnest[axis])], "y": [float(thinnest[2])], "name": "thinnest place", "mode": "markers",
            "marker": {"size": 9, "color": "#d03030", "symbol": "diamond"}}
    line = {"x": rounded(cut["arc_length"]), "y": rounded(cut["wall"]), "name": "wall", "mode": "lines"}
    charts = (interactive.chart(f"Cut at {place}, through the thinnest place", units.label("arc_length", along),
                                units.label("arc_length", "z"), [shape, mark], equal=True),
              interactive.chart(f"Wall along the cut at {place}, means at nodes", units.label("arc_length"),
                                units.label("wall"), [line], zero="y"))
    return [chart for chart in charts if chart]


def _mesh(path: Any, record: Any, units: Units) -> dict[str, Any]:
    """Return what `report.js` draws: the sheet in drawn states, and the tools, whose travels `record` has."""
    walls = [wall_of(path, path.states[k]) for k in record.frames]
    ratio = [wall.to_nodes(wall.ratio) for wall in walls]
    shown = {units.label("wall"): [wall.at_nodes for wall in walls], "wall / original": ratio}
    if not any(material.integral for material in path.scene.materials.values()):
        stresses = [path.stress(path.states[k]).principal[:, 0] for k in record.frames]
        shown[units.label("stress", "larger stress")] = [wall.to_nodes(s) for wall, s in zip(walls, stresses)]
    if path.scene.heat is not None:
        for depth, face in ((0.0, "bottom"), (1.0, "top")):
            points = walls[0].reference_points[:, :2 if walls[0].flat else 3]
            shown[f"temperature, {face}"] = [path.temperature(points, path.states[k], depth=depth)
                                             for k in record.frames]
    tools = []
    for k, (contact, name) in enumerate(zip(record.tooling.contacts, record.tooling.names)):
        points, triangles = contact.tool.surface()
        if len(triangles) > _LARGEST_TOOL:
            continue
        images = [[*scale, *shift] for scale, shift in record.planes.images(3, contact.tool.bounds)]
        tools.append({"name": name, "points": rounded(points.T), "triangles": triangles.T.tolist(), "images": images,
                      "moves": contact.travel_vector.tolist(), "travel": [record.travels[i][k] for i in record.frames]})
    thinnest = [thinnest_triangle(wall) for wall in walls]
    return {"thinnest": [rounded([*wall.middle[k], wall.wall[k]], each=True) for wall, k in zip(walls, thinnest)],
            "triangles": walls[0].triangles.T.tolist(), "points": [rounded(wall.deformed_points.T) for wall in walls],
            "fields": {name: [rounded(values) for values in each] for name, each in shown.items()}, "tools": tools}
