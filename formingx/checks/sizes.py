"""Checks of pressures, blow ratios and travels of tools against the size and the strength of the body."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from ..errors import InputError
from ..findings import Finding, register
from ..materials.inflation import Inflated, Peak, first_peak
from ..measures.targets import Target
from ..mesh.triangles import Triangles
from ..physics.contact import Contact
from ..scene.scene import Scene
from ..solve.stage import Stage
from ..tools.shapes import Tool
from ..units import Units
from .towards import free_way, through

Found = Iterator[Finding]

_PRESSED = 100.0           # of the shear modulus: more presses no wall further into any corner
_SLIGHT = 1e-4             # of shear modulus x thickness / length: as good as no pressure
_BEYOND = 1.1              # of the largest pressure of a cap, 3 % below the pressure of a disc
_LEFT = 0.8                # of a tube's largest pressure, at the mould: see tests/test_check.py
_BLOWN = 8.0               # blow ratio that no bottle has
_DEEP = 0.5                # of the opening: a wall beyond it that high is a mould's, not a grip's
_WIDER = 4.0               # times wider than the other: of a sheet and its mould one is in another unit
_SHARP = 10.0              # degrees that a profile turns at a corner
_LOOKS = 400               # places of a tool on its way
_STIFFENS = "a material that stiffens (Gent, ArrudaBoyce, Yeoh, Ogden with an exponent above 2) does"


class Aim(NamedTuple):
    """Target of a run: a pressure or a travel.

    Attributes:
        item: the load, support or tool; None: not known.
        quantity: "pressure" or "travel".
        value: stress or length.
        text: its name in findings.
    """

    item: Any
    quantity: str
    value: float
    text: str


class Body(Triangles):
    """A body before its run, and the targets of the run.

    Attributes:
        scene: the scene.
        moduli: {layer: shear modulus}, stress.
        natural: shear modulus x thickness / length, the size of pressures that deform a sheet, stress.
        aims: target pressures and travels, and the largest values of tables (`Aim`).
        goals: True if there are targets or stages.
        targets: all targets of the run and of its stages.
        highest: targets that its stages must not exceed.
    """

    def __init__(self, scene: Scene, targets: Sequence[Target], stages: Sequence[Stage], units: Units):
        super().__init__(scene.mesh)
        self.scene, self._units = scene, units
        self.moduli = {name: scene.shear_modulus(name) for name in scene.materials}
        self.natural = max(self.moduli.values()) * self.thickness / self.length
        self.aims = [aim for target in targets for aim in self._aim(target, scene.driven)]
        self.goals = bool(targets or stages)
        self.targets = [*targets, *(t for stage in stages for t in (*stage.intermediate, stage.until) if t)]
        self.highest = [stage.highest for stage in stages if stage.highest]
        for stage in stages:
            drive = None if stage.control is None else scene.items[scene.number(stage.who, stage.control)]
            for target in (*stage.intermediate, stage.until):
                self.aims += [] if target is None else self._aim(target, drive)
            for name, table in stage.tables:
                of = scene.items[scene.number(stage.who, name)]
                most = float(table[np.argmax(np.abs(table[:, 1])), 1])
                self.aims.append(Aim(of, str(of.quantity), most, f"the table of {name!r} in {stage.who}"))

    def say(self, value: float, kind: str) -> str:
        """Return a number as text, with its unit: of a "pressure", a "travel" (a length) or a "force"."""
        unit = self._units.of(kind)
        return f"{value:.4g}" + (f" {unit}" if unit else "")

    def _aim(self, target: Target, drive: Any) -> list[Aim]:
        name, _, quantity = str(target.name).rpartition("_")
        if quantity not in ("pressure", "travel"):
            return []
        items = [t for t in self.scene.items if t.driven and t.quantity == quantity]
        of = next((t for t in items if name and t.name == name), drive if not name and drive in items else None)
        return [Aim(of, quantity, target.value, str(target))]

    def pressures(self) -> list[Aim]:
        """Return all pressures that act or are targets."""
        fixed = [Aim(load, "pressure", load.value, repr(load)) for load in self.scene.loads
                 if load.quantity == "pressure" and not load.driven]
        return [*fixed, *(aim for aim in self.aims if aim.quantity == "pressure")]

    @cached_property
    def pushed(self) -> list[Pushed]:
        """Faces under pressure: towards fixed tools, or of a free sheet that is inflated."""
        found = []
        for load in (load for load in self.scene.loads if load.quantity == "pressure"):
            try:
                line = self.scene.mesh.line_of(load.on)
            except InputError:                               # not one line: a section that is no sheet
                continue
            tools = [c for c in self.scene.contacts if c.direction is None and c.on != load.on]
            found.append(Pushed(self, load, line, tools))
        return found


class Pushed:
    """The face of a sheet that a pressure pushes.

    Attributes:
        tools: contacts with tools that stay on its other face. tall: a tube, not a disc.
        radius: of the tube's middle, or the reach of the disc, length.
    """

    def __init__(self, body: Body, load: Any, line: np.ndarray, tools: list[Contact]):
        self.load, self.tools, self._body = load, tools, body
        self.length = float(np.hypot(*np.diff(line, axis=0).T).sum())
        high, wide = float(np.ptp(line[:, 1])), float(line[:, 0].max())
        self.round = body.scene.kinematics.axisymmetric
        self.tall, self.flat = high > 2 * wide, high < 0.05 * wide
        self.radius = float(np.median(line[:, 0])) + body.thickness / 2 if self.tall else wide
        self._line = line

    @cached_property
    def ways(self) -> tuple[np.ndarray, np.ndarray]:
        """Points of the other face, and where each meets a tool straight on (or infinity), shape (n, 2) each."""
        points = np.unique(np.vstack([self._body.scene.mesh.nodes_of(c.on) for c in self.tools]), axis=0)
        points, way = through(points, self._line)
        far = 100 * self._body.length
        gone = np.min([free_way(c.tool, points, way, far) for c in self.tools], axis=0)[:, None]
        return points, np.where(np.isfinite(gone), points + np.where(np.isfinite(gone), gone, 0.0) * way, np.inf)

    def peak(self) -> Peak | None:
        """Return the state of the free sheet at its maximum pressure; None: there is none, or it is not known."""
        materials = self._body.scene.materials
        if not self.round or not (self.tall or self.flat) or any(m.varies for m in materials.values()):
            return None
        blown = Inflated(self._layers(), self.radius)
        return first_peak(blown.tube if self.tall else blown.disc)

    def left(self, blow_ratio: float) -> tuple[float, Peak] | None:
        """Return (ratio, peak), or None if the peak is not known or not passed.

        The ratio is the smallest pressure of the free tube between its peak and a blow ratio, over the peak pressure.
        """
        peak = self.peak()
        if peak is None or peak.stretch >= blow_ratio:
            return None
        behind = Inflated(self._layers(), self.radius).tube(np.linspace(peak.stretch, blow_ratio, 200))
        return float(behind.min()) / peak.pressure, peak

    def _layers(self) -> list[tuple[Any, float]]:
        body = self._body
        return [(material, float(body.area[body.layer == name].sum()) / self.length)
                for name, material in body.scene.materials.items()]


@register("start")
def _pressures(body: Body) -> Found:
    """Pressures that no sheet of this stiffness feels, or that none bears: free, or in a mould."""
    stiff = max(body.moduli.values())
    for _, _, value, name in body.pressures():
        if 0 < abs(value) < _SLIGHT * body.natural:
            yield Finding("warning", name,
                          f"it is {abs(value) / body.natural:.2g} times shear modulus x thickness / length ="
                          f" {body.say(body.natural, 'pressure')} (shear modulus {body.say(stiff, 'stress')}), and"
                          f" moves nothing: are the units of stress the same (Pa, kPa, MPa)?")
        free = not body.scene.contacts and abs(value) > 1e3 * body.natural
        if free or abs(value) > _PRESSED * stiff:
            size, what, enough = (stiff, "shear modulus", "some ten times that fill a corner as small as the wall")
            if free:
                size, what, enough = body.natural, "shear modulus x thickness / length", "a free sheet bears about that"
            yield Finding("warning", name,
                          f"it is {abs(value) / size:.2g} times {what} = {body.say(size, 'pressure')}: {enough}: are"
                          f" the units of stress the same (Pa, kPa, MPa)?")


@register("scene")
def _bears(body: Body) -> Found:
    """Warn of pressures above the maximum of a free sheet whose energy does not stiffen."""
    for pushed in body.pushed:
        if body.scene.contacts or (peak := pushed.peak()) is None:
            continue
        for _, _, value, name in body.pressures():
            if _BEYOND * peak.pressure < abs(value) <= 1e3 * body.natural:
                yield Finding("warning", name,
                              f"a free {'tube' if pushed.tall else 'sheet'} of {_names(body)} bears at most about"
                              f" {body.say(peak.pressure, 'pressure')} (at a stretch of {peak.stretch:.3g}). Give a"
                              f" pole height, a pole stretch or a volume as the target: these grow past that maximum;"
                              f" {_STIFFENS} bear more")


@register("scene")
def _blow_ratio(body: Body) -> Found:
    """Warn of a tube whose pressure falls far behind its peak: it bulges at one place, which ends thin."""
    for pushed in body.pushed:
        if not (pushed.tools and pushed.tall and pushed.round):
            continue
        points, ends = pushed.ways
        outer = points[:, 0].max()
        beside = np.isfinite(ends[:, 0]) & (points[:, 0] > 0.95 * outer)     # not its round end
        ratio = float(ends[beside, 0].max(initial=outer) / outer)
        if ratio > _BLOWN:
            yield Finding("warning", repr(pushed.tools[0]),
                          f"the parison of radius {body.say(pushed.radius, 'travel')} is blown up"
                          f" {ratio:.3g}-fold in this mould: are the units of length the same (mm and"
                          f" cm)?")
        elif (found := pushed.left(ratio)) is not None and found[0] < _LEFT:
            yield Finding("warning", "materials",
                          f"a tube of {_names(body)} has its largest pressure,"
                          f" {body.say(found[1].pressure, 'pressure')}, at a blow ratio of"
                          f" {found[1].stretch:.3g}, and only {100 * found[0]:.0f} % of it on the way to this"
                          f" mould's ratio of {ratio:.3g}: it bulges at one place, snaps, and may find no"
                          f" equilibrium before the mould. Use a larger parison; {_STIFFENS} not bulge")


@register("scene")
def _closing(body: Body) -> Found:
    """Warn of an open mould: a sheet that misses it bears no more than the pressure of a free sheet."""
    for pushed in body.pushed:
        if not pushed.tools:
            continue
        points, ends = pushed.ways
        open_at = points[~np.isfinite(ends[:, 0])]
        peak = pushed.peak()
        if not len(open_at) or len(open_at) == len(points):  # closed; or a tool beside what is blown up
            continue
        tool = pushed.tools[0].tool
        wall = float((tool.surface()[0] - open_at.mean(0)).dot(_across(pushed, open_at)).max())
        aims = [aim for aim in body.pressures() if peak is not None and abs(aim.value) > _BEYOND * peak.pressure]
        deep = not body.goals and wall > _DEEP * np.ptp(points, axis=0).max()
        if aims or deep:
            why = f"{aims[0].text} is more than the {body.say(peak.pressure, 'pressure')} that the sheet bears alone" \
                if aims and peak else "a sheet bears little alone"
            yield Finding("warning", repr(pushed.tools[0]),
                          f"the mould is open: straight ahead of (R, Z) = ({open_at[0, 0]:.4g},"
                          f" {open_at[0, 1]:.4g}) it has no surface, and {why}: the body would be"
                          f" blown past its end. Give the profile a floor to R = 0, or a pole height"
                          f" or a volume as the target")


def _across(pushed: Pushed, points: np.ndarray) -> np.ndarray:
    """Return the direction in which the pressure pushes points, on the mean."""
    away = points.mean(0) - pushed._line.mean(0)
    return np.array([0.0, np.sign(away[1])]) if not pushed.tall else np.array([1.0, 0.0])


@register("start")
def _mould_sizes(body: Body) -> Found:
    """Warn of a sheet many times wider or narrower than its mould."""
    for contact in body.scene.contacts:
        if contact.tool.components == 3:
            continue
        face, outline = body.scene.mesh.nodes_of(contact.on), contact.tool.surface()[0]
        wide, reach = float(np.abs(face[:, 0]).max()), np.abs(outline[:, 0])
        if contact.direction is not None or np.ptp(face[:, 1]) > 0.1 * wide:
            continue
        bottom, flange = outline[[np.argmin(reach), np.argmax(reach)], 1] - face[:, 1].mean()
        gap = float(-contact.tool.signed_distance(face).max())
        narrow = reach.max() < wide / _WIDER
        if abs(bottom) > abs(flange) and (narrow or reach.max() > _WIDER * wide and wide < gap < 20 * wide):
            what = "reaches to" if narrow else f"is {body.say(gap, 'travel')} away, and reaches to"
            yield Finding("warning", repr(contact),
                          f"the mould {what} R = {body.say(float(reach.max()), 'travel')}, the sheet to"
                          f" {body.say(wide, 'travel')}: are the units of length the same (mm and cm)?")


@register("start")
def _ways(body: Body) -> Found:
    """Warn of a tool that moves away from its face, or past it."""
    for i, tool in enumerate(body.scene.items):
        if not isinstance(tool, Contact) or tool.direction is None or not (tool.separates or tool.tool.components == 3):
            continue
        if body.scene.together(i)[0] != i:
            continue
        meets = [c for c in (body.scene.items[k] for k in body.scene.together(i)) if isinstance(c, Contact)]
        aims = [aim.value for aim in body.aims if aim.item is tool]
        if any(value < 0 for value in aims):                 # it is taken back, or pulls
            if aims[0] < 0 and tool.separates and tool is not body.scene.driven:       # else the aim is refused
                yield Finding("warning", repr(tool),
                              f"its first travel is {body.say(aims[0], 'travel')}: below 0 it moves away from"
                              f" {tool.on!r}. A tool comes in along direction ="
                              f" ({', '.join(f'{m:g}' for m in tool.direction)}) with a travel above 0")
            continue
        others = bool(body.scene.loads) or len(body.scene.drivable) > 1
        size = float(max(body.scene.extent))
        faces = [(c.tool, body.scene.mesh.nodes_of(c.on)) for c in meets]
        start = _gap(faces, tool.direction, 0.0)
        far = max([*aims, 0.0]) or 3 * size + 2 * max(start, 0.0)
        gaps = np.array([_gap(faces, tool.direction, travel) for travel in np.linspace(0, far, _LOOKS)])
        near = 0.5 * min(body.edge.min(), body.thickness)
        if gaps.min() <= near and (start > near or gaps[1] <= gaps[0]) or not far > 0:
            continue
        if gaps[1] > gaps[0] and gaps[-1] > gaps[0] and (start <= near or not others or not aims):
            yield Finding("warning", repr(tool),
                          f"it moves away from the body: over a travel of {body.say(far, 'travel')} its gap to"
                          f" {tool.on!r} grows from {body.say(max(0.0, start), 'travel')} to"
                          f" {body.say(gaps[-1], 'travel')}: must it be direction ="
                          f" ({', '.join(f'{0 - m:g}' for m in tool.direction)})?")
        elif not others and gaps.min() > near:
            yield Finding("warning", repr(tool),
                          f"it touches nothing on its way: over a travel of {body.say(far, 'travel')} it comes no"
                          f" nearer to {tool.on!r} than {body.say(gaps.min(), 'travel')}: place it nearer (moved),"
                          f" turn its way, or let it travel farther")


def _gap(faces: list[tuple[Tool, np.ndarray]], moves: Any, travel: float) -> float:
    return min(float(-tool.signed_distance(nodes - travel * np.array(moves)).max()) for tool, nodes in faces)


@register("scene")
def _sharp_edges(body: Body) -> Found:
    """Warn of sharp edges of sliding tools: the force depends on the positions of nodes (tests/test_check.py)."""
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
            if turn > _SHARP:                                # the solid is to the left: convex
                yield Finding("warning", repr(contact),
                              f"its edge at (R, Z) = ({a.ends[1][0]:.4g}, {a.ends[1][1]:.4g}) is sharp: forces"
                              f" there are off by 1 to 3 %, depending on where nodes lie, and more elements"
                              f" through the thickness ({rows:.2g} here) do not help: give it a fillet that"
                              f" spans some elements along the sheet")
                break


def _names(body: Body) -> str:
    return ", ".join(dict.fromkeys(str(m) for m in body.scene.materials.values()))
