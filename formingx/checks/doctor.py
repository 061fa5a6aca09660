"""Looks a scene over before it is run: what it finds is measured on the scene, and a good scene gives nothing."""

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
from mpi4py import MPI

from ..errors import instance, several
from ..extensions.heat import checks as doctor_cooling
from ..measures.targets import Target
from ..physics.models import DisplacementPenalty
from ..physics.supports import Displaced, Symmetry
from ..results.path import Path
from ..runs import doubts
from ..scene.aims import unreachable
from ..scene.scene import Scene
from ..solve.diagnose import ANOTHER_PATH
from ..solve.stage import Stage
from ..tools.shapes import Arc
from ..units import NONE, Units
from . import sizes as doctor_sizes
from .findings import Finding, Report
from .sizes import Body

_FLATTEST = 110.0          # longest edge over height: discs of aspect 100 end right in benchmarks/extremes.py
_LONGEST = 2.0             # of elements of a soft layer over its thickness: measured, hard layers around it 150 to 1000
_PER_FILLET = 2.0          # elements along a fillet
_PENETRATION = 0.01        # of the thickness


def doctor(scene: Scene | Path, *, targets: Sequence[Target] = (), stages: Sequence[Stage] = (),
           units: Units = NONE) -> Report:
    """Look a scene over before the run; collective, no form is compiled and nothing is solved.

    Elements (shape, number through a thick layer), the mesh against the edges of the tools, penalties against the
    precision that they leave, sizes that look like mixed units, pressures and blow ratios that the material does not
    bear, tools that move away or leave a way past them, a modulus that rises as the body cools. What makes every run
    impossible or wrong, such as a body that is free to move, elements that lie over each other or lock, is an
    `InputError` of `Scene` already; an "error" here is a target that `trace` refuses.

    Args:
        targets: what the run will aim at, to be looked over too.
        stages: of the process that it will be: their targets and tables.
        units: for the numbers in what is found.
        scene: or the `Path` of a run: its states are judged too, as when it ended. An "error" is then a state that a
            body cannot have (`State.verdict`).

    Raises:
        InputError: `scene` is not a Scene or a Path, a target not a target, a stage not a stage or of another scene.

    >>> print(fx.doctor(scene, targets=[fx.pole_height(12.0)]))
    no fault was found in this scene
    """
    if isinstance(scene, Path):
        of_run = list(_run(scene))
        return Report([*of_run, *doctor(scene.problem.scene, targets=targets, stages=stages, units=units).findings])
    instance("doctor: scene", scene, Scene, "a formingx.Scene, or the Path of a run")
    instance("doctor: units", units, Units, "a formingx.Units")
    targets = several("doctor: targets", targets, "targets, such as [pole_stretch(3)]")
    stages = several("doctor: stages", stages, "stages, such as [Stage('blow', drive='air', until=pressure(1))]")
    for target in targets:
        instance("doctor: targets: target", target, Target, "a target, such as pole_stretch(3)")
    for stage in stages:
        instance("doctor: stages: stage", stage, Stage, "a formingx.Stage")
    body = Body(scene, targets, stages, units)
    targets = [*targets, *(target for stage in stages for target in (*stage.through, stage.until) if target)]
    checks = (_driven, _edges, _elements, _locking, _layers, _fillets, _contact_penalties, _volume_penalty, _units)
    findings = [finding for check in checks for finding in check(scene, body, targets)]
    findings += [Finding("warning", about, text) for check in doctor_sizes.CHECKS for about, text in check(body)]
    findings += [Finding("warning", about, text) for about, text in doctor_cooling.springs_back(scene)]
    return Report([*findings, *_targets(scene, body, targets)])


def _run(path: Path) -> Iterator[Finding]:
    """What the run says of itself, and the first state that a body cannot have."""
    bad = next((state for state in path.states if state.verdict), None)
    if bad is not None:
        yield Finding("error", "run", f"from {path.describe(bad)} on: {bad.verdict}")
    for severity, text in doubts(path) if path.states else []:
        if severity == "serious":
            yield Finding("warning", "run", text)
    for left, right in path.branch_points:
        yield Finding("warning", "run", ANOTHER_PATH % (path.describe(left), path.describe(right)))


def _driven(scene: Scene, sheet: Body, targets: Any) -> Iterator[Finding]:
    if not scene.drivable:
        yield Finding("warning", "loads", "nothing is driven: only a process of stages that wait can run; give one"
                                          " load no value, as Pressure('bottom'), or add a Displaced support")


def _edges(scene: Scene, sheet: Body, targets: Any) -> Iterator[Finding]:
    """Edges of a sheet in space that nothing holds: a flat membrane has no stiffness across them."""
    if scene.kinematics.components == 3:
        for name in sorted({*scene.mesh.boundaries} - {"bottom", "top", *(support.on for support in scene.supports)}):
            yield Finding("warning", f"boundary {name!r}", f"nothing holds this edge of the sheet: a symmetry cut"
                          f" (part='quarter') needs Symmetry({name!r}, {'y' if name == 'y0' else 'x'!r})")


def _elements(scene: Scene, sheet: Body, targets: Any) -> Iterator[Finding]:
    if not scene.model.solid:
        return
    worst = int(np.argmax(sheet.slenderness))
    if sheet.slenderness[worst] > _FLATTEST:
        yield Finding("warning", "mesh", f"an element at {sheet.place(worst)} is {sheet.slenderness[worst]:.3g} times"
                                         f" longer than high (up to 100 was tried): use more elements along the sheet,"
                                         f" or Membrane() for one so thin")


def _locking(scene: Scene, sheet: Body, targets: Any) -> Iterator[Finding]:
    found = scene.model.locking(scene.mesh)
    if found is not None:
        yield Finding("warning", "mesh", str(found))


def _layers(scene: Scene, sheet: Body, targets: Any) -> Iterator[Finding]:
    """A thick layer that one element spans cannot show how strain varies through it.

    Nor can long elements how a soft one is sheared at a rim: hinged, 1000 times softer, it jumped by 66 % with elements
    of 2.5 thicknesses, by 30 % (at the corner, which is singular) with shorter ones, whatever their number through it.
    """
    if not scene.model.solid:
        return
    bends = scene.contacts or not any(isinstance(s, Symmetry | Displaced) and s.component == 1 for s in scene.supports)
    for name in scene.mesh.layers if bends else ():          # between planes that it slides on a slice stays straight
        mine = sheet.layer == name
        depth = sheet.area[mine].sum() / sheet.length
        span = np.ptp(sheet.corners[mine][:, :, 1], axis=1).max(initial=0.0)
        if depth > 0.2 * sheet.length and span > 0.99 * np.ptp(sheet.corners[mine][:, :, 1]):
            yield Finding("warning", f"layer {name!r}", f"it is {depth / sheet.length:.3g} of the body's length thick,"
                                                        f" with one element through it: use two or more")
    hard, soft = (pick(sheet.moduli, key=sheet.moduli.__getitem__) for pick in (max, min))
    ratio = sheet.moduli[hard] / sheet.moduli[soft]
    depth, edge = sheet.area[sheet.layer == soft].sum() / sheet.length, sheet.edge[sheet.layer == soft].min()
    if 100 < ratio <= 1e5 and edge > _LONGEST * depth:
        yield Finding("warning", f"layer {soft!r}",
                      f"it is {ratio:.3g} times softer than {hard!r} and {depth:.3g} thick, its elements {edge:.3g}"
                      f" long or more: near a rim its shear rises within a few thicknesses, and on such elements its"
                      f" stretch jumps by up to 70 % from one to the next; use elements no longer than it is thick, at"
                      f" least near the rim (concentrate)")
    if ratio > 1e5:
        yield Finding("warning", "materials", f"layer {hard!r} (shear modulus {sheet.moduli[hard]:.4g}) is {ratio:.2g}"
                                              f" times stiffer than {soft!r} ({sheet.moduli[soft]:.4g}): are the units"
                                              f" of stress the same (Pa and MPa)?")


def _fillets(scene: Scene, sheet: Body, targets: Any) -> Iterator[Finding]:
    """Rounded edges of a tool that the face cannot follow: fewer than two of its elements along one."""
    for contact in scene.contacts:
        if contact.tool.components == 3:
            continue
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


def _contact_penalties(scene: Scene, sheet: Body, targets: Any) -> Iterator[Finding]:
    """Penetration over thickness is traction / (penalty mu); the tangent's condition grows with the penalty."""
    stress = max(sheet.moduli.values())
    pressed = scene.driven is not None and scene.driven.quantity == "pressure"
    presses = [abs(t.value) for t in targets if t.name.endswith("pressure")] if pressed else []
    for contact in scene.contacts:
        traction = max([stress * sheet.thickness / sheet.length, *presses])
        depth = traction / (contact.penalty * stress)
        if depth > _PENETRATION:
            why = "the target pressure" if presses else "a pressure of shear modulus times thickness over length"
            yield Finding("warning", repr(contact), f"penalty = {contact.penalty:g} lets {why}, {traction:.3g}, press"
                          f" the face {100 * depth:.2g} % of the thickness into the tool: use"
                          f" {traction / (0.001 * stress):.1g} or more")
        if contact.penalty > 1e9:
            yield Finding("warning", repr(contact), f"penalty = {contact.penalty:g}: so stiff that round-off"
                          f" leaves few digits for the body; the default is 2e5")
        if contact.ramp > 0.05:
            yield Finding("warning", repr(contact), f"ramp = {contact.ramp:g}: contact forces begin at a gap of"
                          f" {100 * contact.ramp:.3g} % of the thickness; the default is 1e-5 or less")


def _volume_penalty(scene: Scene, sheet: Body, targets: Any) -> Iterator[Finding]:
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
            yield Finding("warning", "DisplacementPenalty", f"eps = {model.eps:g} with {model.points} points: steps"
                          f" become so short that runs hardly end (1285 iterations at 1e-4 with three points): use"
                          f" MixedPressure(), whose cost does not depend on eps")


def _units(scene: Scene, sheet: Body, targets: Any) -> Iterator[Finding]:
    """Sizes that belong together and differ by orders of magnitude."""
    natural = sheet.natural * sheet.length ** (scene.kinematics.dimension_of_volume - 1)
    for target in targets:
        if target.name.endswith("force") and not 1e-4 < (abs(target.value) or natural) / natural < 1e6:
            yield Finding("warning", str(target), f"it is {abs(target.value) / natural:.2g} times shear modulus x"
                          f" thickness x length = {natural:.3g}: are the units of force, length and stress the same?")
    for contact in scene.contacts:
        tool = contact.tool
        gap = float(-tool.signed_distance(scene.mesh.nodes_of(contact.on)).max())
        if gap > 20 * sheet.length:
            yield Finding("warning", repr(contact), f"the tool is {gap:.3g} away from a body of length"
                          f" {sheet.length:.3g}: are the units of length the same (mm and m)?")
            continue
        if tool.components == 3:                             # their sizes are looked at by Scene
            continue
        arcs = [p.radius for p in tool.pieces if isinstance(p, Arc) and p.radius > 0]
        shaped = len(tool.pieces) > 2 or tool.closed
        if shaped and not 0.01 < tool.size / sheet.length < 100 or arcs and min(arcs) > 1e3 * sheet.length:
            yield Finding("warning", repr(contact), f"the tool is {tool.size:.3g} large, the body {sheet.length:.3g}:"
                          f" are the units of length the same (mm and m)?")


def _targets(scene: Scene, sheet: Body, targets: Sequence[Target]) -> Iterator[Finding]:
    for target in targets:
        why = unreachable(scene, target)
        if why is not None:                                  # a stage may leave out what is in its way
            yield Finding("error" if scene.driven is not None else "warning", str(target), why)
        is_length = target.name.endswith(("pole_height", "travel")) or target.name.startswith("u_")
        if is_length and abs(target.value) > 20 * sheet.length:
            yield Finding("warning", str(target), f"that is {abs(target.value) / sheet.length:.3g} times the length of"
                                                  f" the body, {sheet.length:.4g}: are the units of length the same?")
        if target.name == "pole_stretch" and target.value < 1 and not scene.contacts:
            yield Finding("warning", str(target), "a sheet starts at 1, and its pole stretch grows as it is inflated")
