"""Looks a scene over before it is run: what it finds is measured on the scene, and a good scene gives nothing."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np
from mpi4py import MPI

from . import _compat
from .discrete.elements import place, shape_quality
from .errors import instance, several
from .physics.models import DisplacementPenalty
from .physics.supports import Held
from .physics.tools import Arc
from .scene.scene import Scene
from .solve.targets import Target

_FLATTEST = 110.0          # longest edge over height: discs of aspect 100 end right in benchmarks/extremes.py
_SLIM, _TOO_STIFF, _WRONG = 3.0, 0.003, 0.02      # height over width; expected error that is worth a word, or not a run
_PER_FILLET = 2.0          # elements along a fillet
_PENETRATION = 0.01        # of the thickness


class Finding(NamedTuple):
    """One thing found: severity ("error": the run will fail; "warning": it may), what it is about, text."""

    severity: str
    about: str
    text: str

    def __str__(self) -> str:
        return f"{self.severity}: {self.about}: {self.text}"


class Report:
    """What `doctor` found, worst first; prints in plain words.

    Attributes:
        findings: list of `Finding`; empty for a good scene.
    """

    def __init__(self, findings: Sequence[Finding]):
        self.findings = sorted(findings, key=lambda f: f.severity)

    @property
    def healthy(self) -> bool:
        """True if nothing was found."""
        return not self.findings

    def __str__(self) -> str:
        return "\n".join(map(str, self.findings)) or "nothing was found that stands against this scene"


def doctor(scene: Scene, *, targets: Sequence[Target] = ()) -> Report:
    """Look a scene over before the run; collective, no form is compiled and nothing is solved.

    Elements (shape, number through a thick layer), the mesh against the fillets of the tools, penalties against the
    precision that they leave, and sizes that look like mixed units. (What makes a run impossible, such as a body that
    is free to move or elements that lie over each other, is an `InputError` of `Scene` already.)

    Args:
        targets: what the run will aim at, to be looked over too.

    Raises:
        InputError: `scene` is not a Scene, or a target not a target.
    """
    instance("doctor: scene", scene, Scene, "a formingx.Scene")
    for target in several("doctor: targets", targets, "targets, such as [pole_stretch(3)]"):
        instance("doctor: targets: target", target, Target, "a target, such as pole_stretch(3)")
    sheet = _Sheet(scene)
    checks = (_driven, _elements, _locking, _layers, _fillets, _contact_penalties, _volume_penalty, _units)
    findings = [finding for check in checks for finding in check(scene, sheet, targets)]
    return Report([*findings, *_targets(scene, sheet, targets)])


class _Sheet:
    """Sizes of the body, all ranks.

    corners: of all elements, shape (m, 3, 2); layer: their names; thickness: area of the section over its length;
    length: largest extent; moduli: {layer: shear modulus}.
    """

    def __init__(self, scene: Scene):
        mesh, comm = scene.mesh, scene.mesh.comm
        n = mesh.domain.topology.index_map(2).size_local
        names = np.full(n, "", dtype=object)
        for name, tag in mesh.layers.items():
            found = mesh.cells.find(tag)
            names[found[found < n]] = name
        corners = mesh.domain.geometry.x[_compat.cell_nodes(mesh.domain)[:n, :3], :2]
        parts = comm.allgather((corners, names.tolist()))
        self.corners = np.concatenate([c for c, _ in parts])
        self.layer = np.array([name for _, part in parts for name in part])
        self.edges = np.stack([np.hypot(*(self.corners[:, i] - self.corners[:, j]).T)
                               for i, j in ((0, 1), (1, 2), (2, 0))], 1)
        self.quality = np.abs(shape_quality(self.corners))
        self.area = self.quality * (self.edges**2).sum(1) / (4 * np.sqrt(3))
        self.length = float(max(scene.extent))
        self.thickness = float(self.area.sum()) / self.length
        self.moduli = {name: scene.shear_modulus(name) for name in scene.materials}


def _driven(scene: Scene, sheet: _Sheet, targets: Any) -> Iterator[Finding]:
    if not scene.drivable:
        yield Finding("error", "loads", "nothing is driven, so there is no run: give one load no value, as"
                                        " Pressure('bottom'), or add a Displaced support")


def _elements(scene: Scene, sheet: _Sheet, targets: Any) -> Iterator[Finding]:
    if not scene.model.solid:
        return
    slender = sheet.edges.max(1) ** 2 / (2 * np.maximum(sheet.area, 1e-300))
    worst = int(np.argmax(slender))
    if slender[worst] > _FLATTEST:
        at = place(scene.mesh, sheet.corners[worst].mean(0), str(sheet.layer[worst]))
        yield Finding("warning", "mesh", f"an element at {at} is {slender[worst]:.3g} times longer than high (up to"
                                         f" 100 was tried): use more elements along the sheet, or Membrane()"
                                         f" for one so thin")


def _locking(scene: Scene, sheet: _Sheet, targets: Any) -> Iterator[Finding]:
    """Triangles that are slim across a thick sheet, for whose element its bending is too stiff.

    Its inf-sup constant falls as 2 width/height. Hinged sheets 2 to 15 times wider than thick came out wrong by up to
    0.3 (height/width) (height/length of the body)^2.5, at most (benchmarks/thickness.py); along a thin sheet slim
    triangles do no harm, and where one of them spans the sheet every pressure space is as wrong (see `_layers`).
    """
    pressure = getattr(scene.model, "pressure", None)
    if pressure is None or not pressure.bubble:
        return
    height = sheet.edges.max(1)
    slim = height**2 / (2 * np.maximum(sheet.area, 1e-300))
    error = np.where((height < sheet.thickness) & (slim > _SLIM), 0.3 * slim * (height / sheet.length) ** 2.5, 0.0)
    mean = float((error * sheet.area).sum() / sheet.area.sum())
    if mean > _TOO_STIFF:
        worst = int(np.argmax(error))
        at = place(scene.mesh, sheet.corners[worst].mean(0), str(sheet.layer[worst]))
        severity, by = ("error", "several") if mean > _WRONG else ("warning", "about one")
        yield Finding(severity, "mesh",
                      f"triangles are up to {slim[worst]:.3g} times taller than wide across the thickness (at {at}):"
                      f" the default element locks in them, and bending comes out too stiff, by {by} per cent: use"
                      f" more elements through the thickness (at most 1.5 times taller than wide), fewer"
                      f" along the sheet, or MixedPressure(space='P1')")


def _layers(scene: Scene, sheet: _Sheet, targets: Any) -> Iterator[Finding]:
    """A thick layer that one element spans cannot show how strain varies through it."""
    if not scene.model.solid:
        return
    for name in scene.mesh.layers:
        mine = sheet.layer == name
        depth = sheet.area[mine].sum() / sheet.length
        span = np.ptp(sheet.corners[mine][:, :, 1], axis=1).max(initial=0.0)
        if depth > 0.2 * sheet.length and span > 0.99 * np.ptp(sheet.corners[mine][:, :, 1]):
            yield Finding("warning", f"layer {name!r}", f"it is {depth / sheet.length:.3g} of the body's length thick,"
                                                        f" and one element spans it: use two or more through it")
    hard, soft = (pick(sheet.moduli, key=sheet.moduli.__getitem__) for pick in (max, min))
    ratio = sheet.moduli[hard] / sheet.moduli[soft]
    heights = np.ptp(sheet.corners[sheet.layer == soft][:, :, 1], axis=1)
    if 100 < ratio <= 1e5 and heights.max() > 0.99 * sheet.area[sheet.layer == soft].sum() / sheet.length:
        yield Finding("warning", f"layer {soft!r}", f"it is {ratio:.3g} times softer than {hard!r} and one element"
                                                    f" spans it: its shear would jump from element to element; use two"
                                                    f" or more through it")
    if ratio > 1e5:
        yield Finding("warning", "materials", f"layer {hard!r} (shear modulus {sheet.moduli[hard]:.4g}) is {ratio:.2g}"
                                              f" times stiffer than {soft!r} ({sheet.moduli[soft]:.4g}): are the units"
                                              f" of stress the same (Pa and MPa)?")


def _fillets(scene: Scene, sheet: _Sheet, targets: Any) -> Iterator[Finding]:
    """Rounded edges of a tool that the face cannot follow: fewer than two of its elements along one."""
    for contact in scene.contacts:
        nodes = scene.mesh.nodes_of(contact.on)
        facets = scene.mesh.facets_of(contact.on)
        total = scene.mesh.comm.allreduce(_own(scene, facets), MPI.SUM)
        edge = np.hypot(*np.ptp(nodes, axis=0)) / max(total, 1)
        arcs = [p for p in contact.tool.pieces if isinstance(p, Arc) and p.radius > 0]
        if not arcs:
            continue
        least = min(arcs, key=lambda p: p.radius * abs(p.sweep))
        along = least.radius * abs(least.sweep)
        if along < _PER_FILLET * edge:
            need = int(np.ceil(total * _PER_FILLET * edge / along))
            middle = least.centre + least.radius * np.array([np.cos(least.start + least.sweep / 2),
                                                             np.sin(least.start + least.sweep / 2)])
            yield Finding("warning", repr(contact), f"its fillet of radius {least.radius:.4g} at (R, Z) ="
                          f" ({middle[0]:.4g}, {middle[1]:.4g}) is {along:.3g} long, {along / edge:.2g} elements of the"
                          f" face ({edge:.3g} each): use {need} or more elements along it, or a larger fillet")


def _own(scene: Scene, facets: np.ndarray) -> int:
    return int(np.sum(facets < scene.mesh.domain.topology.index_map(1).size_local))


def _contact_penalties(scene: Scene, sheet: _Sheet, targets: Any) -> Iterator[Finding]:
    """Penetration over thickness is traction / (penalty mu); the tangent's condition grows with the penalty."""
    stress = max(sheet.moduli.values())
    pressed = scene.driven is not None and scene.driven.quantity == "pressure"
    presses = [abs(t.value) for t in targets if t.name == "pressure"] if pressed else []
    for contact in scene.contacts:
        traction = max([stress * sheet.thickness / sheet.length, *presses])
        depth = traction / (contact.penalty * stress)
        if depth > _PENETRATION:
            why = "the target pressure" if presses else "a pressure of shear modulus times thickness over length"
            yield Finding("warning", repr(contact), f"penalty = {contact.penalty:g} lets {why}, {traction:.3g}, press"
                          f" the face {100 * depth:.2g} % of the thickness into the tool: use"
                          f" {traction / (0.001 * stress):.1g} or more")
        if contact.penalty > 1e9:
            yield Finding("warning", repr(contact), f"penalty = {contact.penalty:g}: few of 16 digits are left"
                          f" for the body; 2e4 is the default with friction, 2e5 without")
        if contact.ramp > 0.05:
            yield Finding("warning", repr(contact), f"ramp = {contact.ramp:g}: the face feels the tool already"
                          f" {100 * contact.ramp:.3g} % of the thickness before it; 1e-5 is the default")


def _volume_penalty(scene: Scene, sheet: _Sheet, targets: Any) -> Iterator[Finding]:
    """The volume changes by about eps stretch^2 / 8: pressure near mu stretch^2 over a bulk modulus 8 mu/eps."""
    model = scene.model
    if not model.solid:
        return
    stretch = max([t.value for t in targets if t.name == "pole_stretch"], default=1.0)
    change = model.eps * stretch**2 / 8
    if change > 0.01:
        yield Finding("warning", repr(type(model).__name__), f"eps = {model.eps:g} lets the volume change by about"
                      f" {100 * change:.2g} % at a stretch of {stretch:g}: use {0.008 / stretch**2:.1g} or less")
    if isinstance(model, DisplacementPenalty):
        if model.points == 4 and model.eps <= 1e-3:
            yield Finding("warning", "DisplacementPenalty", f"points = 4 with eps = {model.eps:g}: the tangent becomes"
                          f" indefinite in bending at eps <= 1e-3: use points=3, or MixedPressure()")
        elif model.eps < 1e-4 or model.points == 7 and model.eps < 1e-3:
            yield Finding("warning", "DisplacementPenalty", f"eps = {model.eps:g} with {model.points} points: the steps"
                          f" become so short that runs do not end (1285 iterations at 1e-4 with three points): use"
                          f" MixedPressure(), whose cost does not depend on eps")


def _units(scene: Scene, sheet: _Sheet, targets: Any) -> Iterator[Finding]:
    """Sizes that belong together and differ by orders of magnitude."""
    natural = max(sheet.moduli.values()) * sheet.thickness / sheet.length
    fixed = [(repr(load), load.value) for load in scene.loads if load.quantity == "pressure" and not load.driven]
    aimed = [(str(t), t.value) for t in targets if t.name == "pressure"]
    for name, value in (*fixed, *aimed):
        large = abs(value) > 1e3 * natural and not (scene.contacts and (name, value) in aimed)   # a mould holds more
        if large or 0 < abs(value) < 1e-4 * natural:
            yield Finding("warning", name, f"it is {abs(value) / natural:.2g} times shear modulus x thickness"
                          f" / length = {natural:.3g}: are the units of stress the same (Pa, kPa, MPa)?")
    for contact in scene.contacts:
        tool = contact.tool
        gap = float(-tool.signed_distance(scene.mesh.nodes_of(contact.on)).max())
        if gap > 20 * sheet.length:
            yield Finding("warning", repr(contact), f"the tool is {gap:.3g} away from a body of length"
                          f" {sheet.length:.3g}: are the units of length the same (mm and m)?")
            continue
        arcs = [p.radius for p in tool.pieces if isinstance(p, Arc) and p.radius > 0]
        shaped = len(tool.pieces) > 2 or tool.closed
        if shaped and not 0.01 < tool.size / sheet.length < 100 or arcs and min(arcs) > 1e3 * sheet.length:
            yield Finding("warning", repr(contact), f"the tool is {tool.size:.3g} large, the body {sheet.length:.3g}:"
                          f" are the units of length the same (mm and m)?")


def _targets(scene: Scene, sheet: _Sheet, targets: Sequence[Target]) -> Iterator[Finding]:
    for target in targets:
        if target.name == "pole_stretch" and scene.kinematics.axisymmetric:
            largest = max(m.largest_stretch("equibiaxial") for m in scene.materials.values())
            if target.value >= largest:
                yield Finding("error", str(target), f"no material of the scene can be stretched that far: the limit is"
                                                    f" {largest:.6g}")
        is_length = target.name in ("pole_height", "travel") or target.name.startswith("u_")
        if is_length and abs(target.value) > 20 * sheet.length:
            yield Finding("warning", str(target), f"that is {abs(target.value) / sheet.length:.3g} times the length of"
                                                  f" the body, {sheet.length:.4g}: are the units of length the same?")
        driven = scene.driven
        if driven is not None and target.name in ("pressure", "travel") and target.name != driven.quantity:
            yield Finding("error", str(target), f"the run drives {scene.driven!r}, which has no {target.name}")
        if target.name == "travel" and target.value < 0 and driven in scene.contacts:
            yield Finding("error", str(target), f"it lies behind the start: {driven!r} would move away from the body")
        if target.name == "pole_stretch" and target.value < 1 and not scene.contacts:
            yield Finding("warning", str(target), "a sheet starts at 1, and is stretched where it is inflated")
        for support in _holders(scene, target, 1e-5 * sheet.length):
            yield Finding("error", str(target), f"{support!r} holds that displacement")
        inside = [c for c in scene.contacts if target.name == "pole_height" and _beyond(c, sheet, target.value, scene)]
        for contact in inside:
            yield Finding("error", str(target), f"it lies inside the tool of {contact!r}")


def _holders(scene: Scene, target: Target, near: float) -> Iterator[Any]:
    """The supports that hold what a `displacement` target (u_r_at_R_Z) wants to move."""
    words = target.name.split("_at_")
    if len(words) != 2 or not target.name.startswith("u_") or target.value == 0:
        return
    point = np.array([float(x) for x in words[1].split("_")])
    for support in scene.supports:
        for held in support.constraints():
            if isinstance(held, Held) and not held.driven and "rz"[held.component] == words[0][2]:
                nodes = np.array([held.point]) if held.on is None else scene.mesh.nodes_of(held.on)
                if np.hypot(*(nodes - point).T).min() < near:
                    yield support


def _beyond(contact: Any, sheet: _Sheet, height: float, scene: Scene) -> bool:
    """True if the contact's face, moved to a pole height, has its pole deeper in a tool at rest than its thickness."""
    if contact.driven:
        return False
    nodes = scene.mesh.nodes_of(contact.on)
    pole = nodes[np.argmin(nodes[:, 0])]
    if pole[0] > 1e-9 * sheet.length:
        return False
    return float(contact.tool.signed_distance((pole + [0.0, height])[None])[0]) > sheet.thickness
