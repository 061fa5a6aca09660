"""Checks of pressures, blow ratios and tool travels against the size and the strength of the body."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from mpi4py import MPI

from ..errors import InputError
from ..findings import Finding, coordinates, register
from ..materials.inflation import FreeInflation, Peak, first_peak
from ..measures.targets import Target
from ..mesh.triangles import Triangles
from ..physics.contact import Contact
from ..ranks import combined
from ..scene.contact_checks import OTHER_UNIT
from ..scene.scene import Scene
from ..solve.stage import Plan, Stage, plan
from ..tools.shapes import Tool
from ..units import Units
from .mould_side import free_distance, outward_directions

Found = Iterator[Finding]

LARGEST_LOAD = 100.0
"""Pressure, or weight over area, divided by the shear modulus, that fills every corner and tears every body apart."""

_SMALLEST_PRESSURE = 1e-4  # pressure over shear modulus x thickness / length that has no effect
_ABOVE_PEAK = 1.1          # pressure over the maximum of a spherical cap, which is 3 % below the maximum of a disc
_REMAINING_PRESSURE = 0.8  # lowest pressure beyond the limit point of a tube over its maximum (tests/test_check.py)
_BLOW_RATIO = 8.0          # largest blow ratio of bottles
_MOULD_DEPTH = 0.5         # height of a wall over the opening: a mould is higher, a grip lower
_CORNER_ANGLE = 10.0       # degrees by which a profile turns at a sharp corner
_STIFFENS = "a material that stiffens (Gent, ArrudaBoyce, Yeoh, Ogden with an exponent above 2) does"


class PrescribedValue(NamedTuple):
    """Pressure or travel that a user gives: as a target of the run, in a table of a stage, or as a constant load.

    Attributes:
        item: the load, support or tool of the scene that has the pressure or travel; None if it is not known.
        quantity: "pressure" or "travel".
        value: the pressure, stress, or the travel, length.
        text: text that names the target, load or table in findings.
    """

    item: Any
    quantity: str
    value: float
    text: str


class SizedBody(Triangles):
    """Body before its run, with the targets of the run: the argument of the checks before a run ("scene", "start").

    Attributes:
        scene: the scene.
        moduli: {layer: shear modulus}, stress.
        pressure_scale: largest shear modulus x thickness / length, the order of pressures that deform a sheet, stress.
        prescribed: list of `PrescribedValue`: target pressures and travels, and the value of largest magnitude of each
            table of a load, support or tool.
        has_targets: True if there are targets or stages.
        stages: stages of the process, as given.
        targets: all targets of the run and of its stages.
        table_maxima: for each stage in which an output quantity follows a table, the largest value of the table as a
            `Target` (`Stage.highest`).
    """

    def __init__(self, scene: Scene, targets: Sequence[Target], stages: Sequence[Stage], units: Units):
        super().__init__(scene.mesh)
        self.scene = scene
        self._units = units.per_depth() if scene.kinematics.dimension_of_volume == 2 else units
        self.moduli = {name: scene.shear_modulus(name) for name in scene.materials}
        thickness = self.thickness
        if scene.kinematics.components == 3:
            x = np.asarray(scene.mesh.domain.geometry.x).T
            sums = np.array([sum(float(np.sum(h(*x))) for h in scene.thickness.values()), x.shape[1]])
            total, nodes = combined(scene.mesh.comm, sums, MPI.SUM)
            thickness = float(total / nodes)
        self.pressure_scale = max(self.moduli.values()) * thickness / self.length
        self.prescribed = [entry for target in targets for entry in self._prescribed_values(target, scene.driven)]
        self.has_targets, self.stages = bool(targets or stages), stages
        self.targets = [*targets, *(t for stage in stages for t in (*stage.intermediate, stage.until) if t)]
        self.table_maxima = [stage.highest for stage in stages if stage.highest]
        for stage in stages:
            control = None if stage.control is None else scene.items[scene.number(stage.label, stage.control)]
            for target in (*stage.intermediate, stage.until):
                self.prescribed += [] if target is None else self._prescribed_values(target, control)
            for name, table in stage.tables:
                item = scene.items[scene.number(stage.label, name)]
                value = float(table[np.argmax(np.abs(table[:, 1])), 1])
                self.prescribed.append(
                    PrescribedValue(item, str(item.quantity), value, f"the table of {name!r} in {stage.label}"))

    @cached_property
    def plans(self) -> list[Plan]:
        """Stages with the numbers of their loads, supports and tools; [] if a stage is refused, which `check` says."""
        try:
            return [plan(self.scene, stage) for stage in self.stages]
        except InputError:
            return []

    def format(self, value: float, kind: str, digits: int = 4) -> str:
        """Return a number with its unit, such as "0.25 MPa", for a "pressure", "travel", "force" or "stress"."""
        return f"{value:.{digits}g} {self._units.unit_of(kind)}".rstrip()

    def _prescribed_values(self, target: Target, control: Any) -> list[PrescribedValue]:
        """Return [pressure or travel of a target], or []; without a name it is that of the `control` of the run."""
        name, _, quantity = str(target.name).rpartition("_")
        if quantity not in ("pressure", "travel"):
            return []
        items = [t for t in self.scene.items if t.driven and t.quantity == quantity]
        item = next((t for t in items if name and t.name == name), control if not name and control in items else None)
        return [PrescribedValue(item, quantity, target.value, str(target))]

    def pressures(self) -> list[PrescribedValue]:
        """Return all pressures of the run: constants, targets, and values of largest magnitude of tables."""
        fixed = [PrescribedValue(load, "pressure", load.value, repr(load)) for load in self.scene.loads
                 if load.quantity == "pressure" and not load.driven]
        return [*fixed, *(entry for entry in self.prescribed if entry.quantity == "pressure")]

    @cached_property
    def pressurised_faces(self) -> list[PressurisedFace]:
        """Faces of the sheet on which a pressure acts, one for each `Pressure`; empty if the body is not a sheet."""
        found = []
        for load in (load for load in self.scene.loads if load.quantity == "pressure"):
            try:
                line = self.scene.mesh.line_of(load.on)
            except InputError:                               # several lines: the section is not a sheet
                continue
            tools = [c for c in self.scene.contacts if c.direction is None and c.on != load.on]
            found.append(PressurisedFace(self, load, line, tools))
        return found


class PressurisedFace:
    """Face of a sheet on which a pressure acts, with the fixed tools on the other side of the sheet.

    Attributes:
        load: the `Pressure` on the face.
        tools: contacts of the opposite face with fixed tools.
        line: nodes (R, Z) of the face in order, shape (n, 2), length.
        length: arc length of the face in the section, length.
        axisymmetric: True for an axisymmetric body.
        tall: True for a tube: the face is higher than twice its largest R.
        flat: True for a flat sheet: the face is lower than 0.05 times its largest R.
        radius: mean radius of a tube, or outer radius of another body, length.
    """

    def __init__(self, body: SizedBody, load: Any, line: np.ndarray, tools: list[Contact]):
        self.load, self.tools, self._body = load, tools, body
        self.length = float(np.hypot(*np.diff(line, axis=0).T).sum())
        high, wide = float(np.ptp(line[:, 1])), float(line[:, 0].max())
        self.axisymmetric = body.scene.kinematics.axisymmetric
        self.tall, self.flat = high > 2 * wide, high < 0.05 * wide
        self.radius = float(np.median(line[:, 0])) + body.thickness / 2 if self.tall else wide
        self.line = line

    @cached_property
    def mould_points(self) -> tuple[np.ndarray, np.ndarray]:
        """Points of the opposite face, and where their normals meet the tools or inf, shape (n, 2) each, length."""
        points = np.unique(np.vstack([self._body.scene.mesh.nodes_of(c.on) for c in self.tools]), axis=0)
        points, directions = outward_directions(points, self.line)
        limit = 100 * self._body.length
        distance = np.min([free_distance(c.tool, points, directions, limit) for c in self.tools], axis=0)[:, None]
        found = np.isfinite(distance)
        return points, np.where(found, points + np.where(found, distance, 0.0) * directions, np.inf)

    def peak(self) -> Peak | None:
        """Return the first pressure maximum in the inflation of the flat sheet or tube without tools.

        It has the pole or hoop stretch; None without a maximum, in plane strain or for variable materials.
        """
        materials = self._body.scene.materials
        if not self.axisymmetric or not (self.tall or self.flat) or any(m.varies for m in materials.values()):
            return None
        blown = FreeInflation(self._layers(), self.radius)
        return first_peak(blown.tube if self.tall else blown.disc)

    def remaining_pressure(self, blow_ratio: float) -> tuple[float, Peak] | None:
        """Return the lowest pressure of a free tube from its maximum to the blow ratio, over it, and this maximum.

        The blow ratio is the radius of mould over parison. None without a maximum below it.
        """
        peak = self.peak()
        if peak is None or peak.stretch >= blow_ratio:
            return None
        pressures = FreeInflation(self._layers(), self.radius).tube(np.linspace(peak.stretch, blow_ratio, 200))
        return float(pressures.min()) / peak.pressure, peak

    def _layers(self) -> list[tuple[Any, float]]:
        """Return for each layer a pair (material, mean thickness as a length)."""
        body = self._body
        return [(material, float(body.area[body.layer == name].sum()) / self.length)
                for name, material in body.scene.materials.items()]


@register("start")
def _pressures(body: SizedBody) -> Found:
    """Report pressures that are too small to deform a sheet, or larger than any sheet can bear."""
    stiff = max(body.moduli.values())
    for _, _, value, name in body.pressures():
        if 0 < abs(value) < _SMALLEST_PRESSURE * body.pressure_scale:
            yield Finding("warning", name,
                          f"it is {abs(value) / body.pressure_scale:.2g} times shear modulus x thickness / length ="
                          f" {body.format(body.pressure_scale, 'pressure')} (shear modulus"
                          f" {body.format(stiff, 'stress')}), and moves nothing: are the units of stress the same (Pa,"
                          f" kPa, MPa)?")
        free = not body.scene.contacts and abs(value) > 1e3 * body.pressure_scale
        if free or abs(value) > LARGEST_LOAD * stiff:
            size, what = stiff, "shear modulus"
            usual = "about ten times the shear modulus fills a corner as small as the wall"
            if free:
                size, what = body.pressure_scale, "shear modulus x thickness / length"
                usual = "a free sheet bears about as much"
            yield Finding("warning", name,
                          f"it is {abs(value) / size:.2g} times {what} = {body.format(size, 'pressure')}; {usual}: are"
                          f" the units of stress the same (Pa, kPa, MPa)?")


@register("scene")
def _limit_pressures(body: SizedBody) -> Found:
    """Report pressures above the maximum of a sheet or tube without tools; materials that stiffen enough have none."""
    for face in body.pressurised_faces:
        if body.scene.contacts or (peak := face.peak()) is None:
            continue
        for _, _, value, name in body.pressures():
            if _ABOVE_PEAK * peak.pressure < abs(value) <= 1e3 * body.pressure_scale:
                yield Finding("warning", name,
                              f"a free {'tube' if face.tall else 'sheet'} of {_names(body)} bears at most about"
                              f" {body.format(peak.pressure, 'pressure')} (at a stretch of {peak.stretch:.3g}). Give a"
                              f" pole height, a pole stretch or a volume as the target: these grow past that maximum;"
                              f" {_STIFFENS} bear more")


@register("scene")
def _blow_ratio(body: SizedBody) -> Found:
    """Report a tube blown over 8-fold, or past where a uniform tube's pressure is 0.8 times its peak: it bulges."""
    for face in body.pressurised_faces:
        if not (face.tools and face.tall and face.axisymmetric):
            continue
        points, ends = face.mould_points
        outer = points[:, 0].max()
        cylindrical = np.isfinite(ends[:, 0]) & (points[:, 0] > 0.95 * outer)     # without its round end
        ratio = float(ends[cylindrical, 0].max(initial=outer) / outer)
        if ratio > _BLOW_RATIO:
            yield Finding("warning", repr(face.tools[0]),
                          f"the parison of radius {body.format(face.radius, 'travel')} is blown up"
                          f" {ratio:.3g}-fold in this mould: are the units of length the same (mm and"
                          f" cm)?")
        elif (found := face.remaining_pressure(ratio)) is not None and found[0] < _REMAINING_PRESSURE:
            yield Finding("warning", "materials",
                          f"a tube of {_names(body)} has its largest pressure,"
                          f" {body.format(found[1].pressure, 'pressure')}, at a blow ratio of"
                          f" {found[1].stretch:.3g}, and only {100 * found[0]:.0f} % of it on the way to this"
                          f" mould's ratio of {ratio:.3g}: it bulges at one place, snaps, and may find no"
                          f" equilibrium before the mould. Use a larger parison; {_STIFFENS} not bulge")


@register("scene")
def _open_moulds(body: SizedBody) -> Found:
    """Report an open mould: parts of the sheet meet no tool along their normal, and would be blown past its end.

    A pressure of the run is larger than a free sheet bears, or the mould is deep and no target ends the run.
    """
    for face in body.pressurised_faces:
        if not face.tools:
            continue
        points, ends = face.mould_points
        open_at = points[~np.isfinite(ends[:, 0])]
        peak = face.peak()
        if not len(open_at) or len(open_at) == len(points):  # a closed mould, or a tool beside the sheet
            continue
        tool = face.tools[0].tool
        depth = float((tool.surface()[0] - open_at.mean(0)).dot(_pressure_direction(face, open_at)).max())
        excessive = [entry for entry in body.pressures()
                     if peak is not None and abs(entry.value) > _ABOVE_PEAK * peak.pressure]
        deep = not body.has_targets and depth > _MOULD_DEPTH * np.ptp(points, axis=0).max()
        if excessive or deep:
            reason = "a sheet bears little alone"
            if excessive and peak:
                limit = body.format(peak.pressure, "pressure")
                reason = f"{excessive[0].text} is more than the {limit} that the sheet bears alone"
            yield Finding("warning", repr(face.tools[0]),
                          f"the mould is open: straight ahead of (R, Z) = ({open_at[0, 0]:.4g},"
                          f" {open_at[0, 1]:.4g}) it has no surface, and {reason}: the body would be"
                          f" blown past its end. Give the profile a floor to R = 0, or a pole height"
                          f" or a volume as the target")


def _pressure_direction(face: PressurisedFace, points: np.ndarray) -> np.ndarray:
    """Return the unit vector (r, z) of a pressure on opposite points (n, 2): radial for a tube, else axial."""
    offset = points.mean(0) - face.line.mean(0)
    return np.array([0.0, np.sign(offset[1])]) if not face.tall else np.array([1.0, 0.0])


@register("start")
def _mould_sizes(body: SizedBody) -> Found:
    """Report a flat sheet that is more than 4 times wider or narrower than its mould."""
    for contact in body.scene.contacts:
        if contact.tool.components == 3:
            continue
        face, outline = body.scene.mesh.nodes_of(contact.on), contact.tool.surface()[0]
        radius, reach = float(np.abs(face[:, 0]).max()), np.abs(outline[:, 0])
        if contact.direction is not None or np.ptp(face[:, 1]) > 0.1 * radius:
            continue
        bottom, flange = outline[[np.argmin(reach), np.argmax(reach)], 1] - face[:, 1].mean()
        gap = float(-contact.tool.signed_distance(face).max())
        narrow = reach.max() < radius / OTHER_UNIT
        if abs(bottom) > abs(flange) and (narrow or reach.max() > OTHER_UNIT * radius and radius < gap < 20 * radius):
            what = "reaches to" if narrow else f"is {body.format(gap, 'travel')} away, and reaches to"
            yield Finding("warning", repr(contact),
                          f"the mould {what} R = {body.format(float(reach.max()), 'travel')}, the sheet to"
                          f" {body.format(radius, 'travel')}: are the units of length the same (mm and cm)?")


@register("start")
def _tool_paths(body: SizedBody) -> Found:
    """Report a moving tool that moves away from the body or never reaches it."""
    for i, tool in enumerate(body.scene.items):
        if not isinstance(tool, Contact) or tool.direction is None or not (tool.separates or tool.tool.components == 3):
            continue
        if body.scene.same_tool(i)[0] != i:
            continue
        contacts = [c for c in (body.scene.items[k] for k in body.scene.same_tool(i)) if isinstance(c, Contact)]
        travels = [entry.value for entry in body.prescribed if entry.item is tool]
        if any(value < 0 for value in travels):              # the tool is retracted, or pulls
            if travels[0] < 0 and tool.separates and tool is not body.scene.driven:     # otherwise refused by `trace`
                yield Finding("warning", repr(tool),
                              f"its first travel is {body.format(travels[0], 'travel')}: below 0 it moves away from"
                              f" {tool.on!r}. A tool comes in along direction ="
                              f" ({', '.join(f'{m:g}' for m in tool.direction)}) with a travel above 0")
            continue
        others = bool(body.scene.loads) or len(body.scene.drivable) > 1
        size = float(max(body.scene.extent))
        faces = [(c.tool, body.scene.mesh.nodes_of(c.on)) for c in contacts]
        start = _gap(faces, tool.direction, 0.0)
        travel_range = max([*travels, 0.0]) or 3 * size + 2 * max(start, 0.0)
        tolerance = 0.5 * min(body.edge.min(), body.thickness)
        gaps = _gaps(faces, tool.direction, start, travel_range, tolerance)
        if gaps.min() <= tolerance and (start > tolerance or gaps[1] <= gaps[0]) or not travel_range > 0:
            continue
        if gaps[1] > gaps[0] and gaps[-1] > gaps[0] and (start <= tolerance or not others or not travels):
            yield Finding("warning", repr(tool),
                          f"it moves away from the body: over a travel of {body.format(travel_range, 'travel')} its gap"
                          f" to {tool.on!r} grows from {body.format(max(0.0, start), 'travel')} to"
                          f" {body.format(gaps[-1], 'travel')}: must it be direction ="
                          f" ({', '.join(f'{0 - m:g}' for m in tool.direction)})?")
        elif not others and gaps.min() > tolerance:
            yield Finding("warning", repr(tool),
                          f"it touches nothing on its way: over a travel of {body.format(travel_range, 'travel')} it"
                          f" comes no nearer to {tool.on!r} than {body.format(gaps.min(), 'travel')}: place it nearer"
                          f" (moved), change its direction, or let it travel farther")


def _gaps(faces: list[tuple[Tool, np.ndarray]], direction: Any, start: float, travel_range: float,
          tolerance: float) -> np.ndarray:
    """Return the smallest gap between tools and undeformed faces at n increasing travels, shape (n,), length.

    The travel grows by half the gap, or `tolerance`, to the first touch or the range. Faces: (tool, nodes (n, c)).
    """
    travel, gaps, speed = 0.0, [start], float(np.linalg.norm(direction))
    while travel < travel_range and (len(gaps) == 1 or gaps[-1] > min(tolerance, start)):
        travel = min(travel + max(gaps[-1] / 2, tolerance) / speed, travel_range)
        gaps.append(_gap(faces, direction, travel))
    return np.array(gaps)


def _gap(faces: list[tuple[Tool, np.ndarray]], direction: Any, travel: float) -> float:
    """Return the least gap of (tool, nodes (n, c)) after a travel, length; negative with a tool in the body."""
    return min(float(-tool.signed_distance(nodes - travel * np.array(direction)).max()) for tool, nodes in faces)


@register("scene")
def _sharp_edges(body: SizedBody) -> Found:
    """Report sharp convex edges of moving tools over which a body with two or more rows of elements may slide.

    The tool force then depends on the positions of the nodes (tests/test_check.py).
    """
    for contact in body.scene.contacts:
        if contact.tool.components == 3:
            continue
        facets = (len(body.scene.mesh.nodes_of(contact.on)) - 1) // 2
        rows = len(body.edge) / max(2 * facets, 1)
        if contact.direction is None or contact.sticks or rows < 1.5:
            continue
        pieces = contact.tool.pieces
        for a, b in zip(pieces, pieces[1:] + (pieces[:1] if contact.tool.closed else ())):
            turn = np.degrees((b.angles[0] - a.angles[1] + np.pi) % (2 * np.pi) - np.pi)
            if turn > _CORNER_ANGLE:                             # the solid is to the left: convex
                yield Finding("warning", repr(contact),
                              f"its edge at (R, Z) = {coordinates(a.ends[1])} is sharp: forces"
                              f" there are off by 1 to 3 %, depending on where nodes lie, and more elements"
                              f" through the thickness ({rows:.2g} here) do not help: give it a fillet that"
                              f" spans some elements along the sheet")
                break


def _names(body: SizedBody) -> str:
    """Return the names of the materials of a body as text, separated by commas."""
    return ", ".join(dict.fromkeys(str(m) for m in body.scene.materials.values()))
