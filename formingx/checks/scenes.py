"""Checks of a scene before a run: mesh, penalties, orders of magnitude, targets."""

from collections.abc import Iterator
from typing import Any

import numpy as np
from mpi4py import MPI

from ..findings import Finding, coordinates, percent, register
from ..mesh.nodes import SAME_PLACE
from ..physics.models import DisplacementPenalty
from ..physics.supports import NAMES, PrescribedDisplacement, SimplySupported, Symmetry
from ..scene.scene import Scene
from ..scene.target_checks import unreachable
from ..tools.shapes import Arc
from ..values.tolerances import MEASURED_ACCURACY, ROUND_OFF
from .sizes import SizedBody

_ASPECT_RATIO = 110.0       # longest edge over height; discs with 100 give correct results in benchmarks/extremes.py
_ELEMENTS_PER_FILLET = 2.0  # smallest number of elements along a fillet


@register("scene")
def _driven(body: SizedBody) -> Iterator[Finding]:
    """Report a scene in which no load, support or tool can be controlled."""
    if not body.scene.drivable:
        yield Finding("warning", "loads", "nothing is driven: only a process of stages with a duration can run; give"
                                          " one load no value, as Pressure('bottom'), or add a"
                                          " PrescribedDisplacement support")


@register("scene")
def _edges(body: SizedBody) -> Iterator[Finding]:
    """Report edges without a support of a sheet in three dimensions: a flat membrane has no stiffness normal to it."""
    if body.scene.kinematics.components == 3:
        mesh: Any = body.scene.mesh
        supported = {support.on for support in body.scene.supports}
        for name in sorted({*mesh.boundaries} - {*mesh.faces} - supported):
            yield Finding("warning", f"boundary {name!r}", f"nothing holds this edge of the sheet: a symmetry cut"
                          f" (part='quarter') needs Symmetry({name!r}, {'y' if name == 'y0' else 'x'!r})")


@register("scene")
def _symmetry(body: SizedBody) -> Iterator[Finding]:
    """Report symmetries of boundaries that are curved or inclined: they lie in no plane of symmetry."""
    near = SAME_PLACE * float(max(body.scene.extent))
    for support in body.scene.supports:
        if isinstance(support, Symmetry) and body.scene.model.solid and not support.guide:
            nodes = body.scene.mesh.nodes_of(str(support.on))
            low, high = nodes[:, support.component].min(), nodes[:, support.component].max()
            if (np.ptp(nodes, axis=0) > near).all():
                axis = NAMES[support.component]
                yield Finding("warning", repr(support), f"{support.on!r} is curved or inclined, and lies in no plane of"
                              f" symmetry: along it {axis} goes from {body.format(low, 'travel')} to"
                              f" {body.format(high, 'travel')}. Is another boundary meant, or Clamped?")


@register("scene")
def _hinged_edges(body: SizedBody) -> Iterator[Finding]:
    """Report sharp edges of tools with friction at the edge of a hinged face.

    The face rotates, so its edge leaves the tool, unless it sticks. The direction of the contact is round-off there.
    """
    hinged = [body.scene.mesh.nodes_of(support.on) for support in body.scene.supports
              if isinstance(support, SimplySupported)]
    for contact in body.scene.contacts if hinged else ():
        if contact.tool.components == 3 or contact.symmetric:
            continue
        nodes, pieces = np.concatenate(hinged), contact.tool.pieces
        for a, b in zip(pieces, pieces[1:]):
            corner = a.ends[1]
            turns = abs(np.sin(b.angles[0] - a.angles[1])) > ROUND_OFF
            if turns and (np.linalg.norm(nodes - corner, axis=1) < ROUND_OFF * body.length).any():
                yield Finding("warning", repr(contact), f"its sharp edge at (R, Z) = {coordinates(corner)}"
                              f" touches the edge of a hinged face: round-off decides whether both stick together,"
                              f" which changed walls by 0.4 %. Give the tool a lip, move it by a millionth of the"
                              f" thickness, or use Clamped")


@register("scene")
def _elements(body: SizedBody) -> Iterator[Finding]:
    """Report triangles whose longest edge is more than 110 times their height on that edge."""
    if not body.scene.model.solid:
        return
    worst = int(np.argmax(body.slenderness))
    if body.slenderness[worst] > _ASPECT_RATIO:
        yield Finding("warning", "mesh", f"an element at {body.place(worst)} is {body.slenderness[worst]:.3g} times"
                                         f" longer than high (up to 100 was tried): use more elements along the sheet,"
                                         f" or Membrane() for so thin a sheet")


@register("scene")
def _locking(body: SizedBody) -> Iterator[Finding]:
    """Report elements of a shape with which the finite elements of the scene's model lock."""
    found = body.scene.model.locking(body.scene.mesh)
    if found is not None:
        yield Finding("warning", "mesh", str(found))


@register("scene")
def _layers(body: SizedBody) -> Iterator[Finding]:
    """Report a thick layer with one element through it, which cannot bend, and layers of very different shear modulus.

    Long elements of a soft layer misrepresent its shear at a rim: with a layer 1000 times softer the stretch jumped by
    66 % between elements of 2.5 thicknesses, by 30 % between shorter ones, however many lie through the layer.
    """
    if not body.scene.model.solid:
        return
    scene = body.scene
    bends = scene.contacts or not any(isinstance(s, Symmetry | PrescribedDisplacement) and s.component == 1
                                      for s in scene.supports)
    for name in scene.mesh.layers if bends else ():          # a slice between symmetry planes does not bend
        in_layer = body.layer == name
        depth = body.area[in_layer].sum() / body.length
        span = np.ptp(body.corners[in_layer][:, :, 1], axis=1).max(initial=0.0)
        if depth > 0.2 * body.length and span > 0.99 * np.ptp(body.corners[in_layer][:, :, 1]):
            yield Finding("warning", f"layer {name!r}", f"it is {depth / body.length:.3g} of the body's length thick,"
                                                        f" with one element through it: use two or more")
    hard, soft = (pick(body.moduli, key=body.moduli.__getitem__) for pick in (max, min))
    ratio = body.moduli[hard] / body.moduli[soft]
    depth, edge = body.area[body.layer == soft].sum() / body.length, body.edge[body.layer == soft].min()
    if 100 < ratio <= 1e5 and edge / 2 > depth:                     # nodes are half an edge apart
        yield Finding("warning", f"layer {soft!r}",
                      f"it is {ratio:.3g} times softer than {hard!r} and {body.format(depth, 'travel', 3)} thick, its"
                      f" elements {body.format(edge, 'travel', 3)} long or more: near a rim its shear rises within a"
                      f" few thicknesses, and on such elements its stretch jumps by up to 70 % from one to the next;"
                      f" use elements no longer than it is thick, at least near the rim (concentrate)")
    if ratio > 1e5:
        yield Finding("warning", "materials",
                      f"layer {hard!r} (shear modulus {body.format(body.moduli[hard], 'stress')}) is {ratio:.2g} times"
                      f" stiffer than {soft!r} ({body.format(body.moduli[soft], 'stress')}): are the units of stress"
                      f" the same (Pa and MPa)?")


@register("scene")
def _fillets(body: SizedBody) -> Iterator[Finding]:
    """Report fillets of a tool whose arc is shorter than two elements of the face that touches it."""
    for contact in body.scene.contacts:
        if contact.tool.components == 3:
            continue
        nodes = body.scene.mesh.nodes_of(contact.on)
        facets = body.scene.mesh.facets_of(contact.on)
        total = body.scene.mesh.comm.allreduce(_n_owned(body.scene, facets), MPI.SUM)
        edge = np.hypot(*np.ptp(nodes, axis=0)) / max(total, 1)
        arcs = [p for p in contact.tool.pieces if isinstance(p, Arc) and p.radius > 0]
        if not arcs:
            continue
        smallest = min(arcs, key=lambda p: p.radius * abs(p.sweep))
        length = smallest.radius * abs(smallest.sweep)
        if length < _ELEMENTS_PER_FILLET * edge:
            need = int(np.ceil(total * _ELEMENTS_PER_FILLET * edge / length))
            middle = smallest.centre + smallest.radius * np.array([np.cos(smallest.start + smallest.sweep / 2),
                                                                   np.sin(smallest.start + smallest.sweep / 2)])
            yield Finding("warning", repr(contact),
                          f"its fillet of radius {body.format(smallest.radius, 'travel')} at (R, Z) = ({middle[0]:.4g},"
                          f" {middle[1]:.4g}) is {body.format(length, 'travel', 3)} long, {length / edge:.2g} elements"
                          f" of the face ({body.format(edge, 'travel', 3)} each): use {need} or more elements along it,"
                          f" or a larger fillet")


def _n_owned(scene: Scene, facets: np.ndarray) -> int:
    """Return the number of facets that this rank owns among given ones (local numbers, shape (n,))."""
    return int(np.sum(facets < scene.mesh.domain.topology.index_map(1).size_local))


@register("scene")
def _contact_penalties(body: SizedBody) -> Iterator[Finding]:
    """Report contact penalties with which faces penetrate or round-off grows, and wide ramps.

    The penetration over the thickness is about p / (k mu), with the traction p, the shear modulus mu and the penalty k
    of the `Contact`. A ramp is wide above 0.05 times the thickness.
    """
    stress = max(body.moduli.values())
    pressed = body.scene.driven is not None and body.scene.driven.quantity == "pressure"
    presses = [abs(t.value) for t in body.targets if t.name.endswith("pressure")] if pressed else []
    for contact in body.scene.contacts:
        traction = max([stress * body.thickness / body.length, *presses])
        scale = contact.reference_length(body.thickness, body.length) / body.thickness
        depth = scale * traction / (contact.penalty * stress)
        if depth > MEASURED_ACCURACY:
            cause = "the target pressure" if presses else "a pressure of shear modulus times thickness over length"
            yield Finding("warning", repr(contact), f"penalty = {contact.penalty:g} lets {cause},"
                          f" {body.format(traction, 'stress', 3)}, press the face {percent(depth)} of"
                          f" {'the thickness' if scale == 1 else 'a hundredth of the extent'} into the tool: use"
                          f" {scale * traction / (0.001 * stress):.1g} or more")
        if contact.penalty > 1e9:
            yield Finding("warning", repr(contact), f"penalty = {contact.penalty:g}: so stiff that round-off"
                          f" leaves few digits for the body; the default is 2e5")
        if contact.ramp > 0.05:
            yield Finding("warning", repr(contact), f"ramp = {contact.ramp:g}: contact forces begin at a gap of"
                          f" {100 * contact.ramp:.3g} % of the thickness; the default is 1e-5 or less")


@register("scene")
def _volume_penalty(body: SizedBody) -> Iterator[Finding]:
    """Report a volume penalty eps with a volume change above 1 %, or with a tangent that is known to fail.

    At a stretch l the pressure is about mu l^2 and the bulk modulus 8 mu/eps, so the volume changes by about eps l^2/8.
    """
    model = body.scene.model
    if not model.solid:
        return
    stretch = max([t.value for t in body.targets if t.name == "pole_stretch"], default=1.0)
    change = model.eps * stretch**2 / 8
    if change > 0.01:
        yield Finding("warning", repr(type(model).__name__), f"eps = {model.eps:g} lets the volume change by about"
                      f" {percent(change)} at a stretch of {stretch:g}: use {0.008 / stretch**2:.1g} or less")
    if isinstance(model, DisplacementPenalty):
        if model.points == 4 and model.eps <= 1e-3:
            yield Finding("warning", "DisplacementPenalty", f"points = 4 with eps = {model.eps:g}: the tangent becomes"
                          f" indefinite in bending at eps <= 1e-3: use points=3, or MixedPressure()")
        elif model.eps < 1e-4 or model.points == 7 and model.eps < 1e-3:
            yield Finding("warning", "DisplacementPenalty", f"eps = {model.eps:g} with {model.points} points: steps"
                          f" become so short that runs hardly end (1285 iterations at 1e-4 with three points): use"
                          f" MixedPressure(), whose cost does not depend on eps")


@register("start")
def _units(body: SizedBody) -> Iterator[Finding]:
    """Report target forces, distances of tools, and sizes of tools whose magnitudes do not fit the body."""
    natural = body.pressure_scale * body.length ** (body.scene.kinematics.dimension_of_volume - 1)
    for target in body.targets:
        if target.name.endswith("force") and not 1e-4 < (abs(target.value) or natural) / natural < 1e6:
            product = "shear modulus x thickness" + " x length" * (body.scene.kinematics.dimension_of_volume == 3)
            yield Finding("warning", str(target), f"it is {abs(target.value) / natural:.2g} times {product} ="
                          f" {body.format(natural, 'force', 3)}: do the units of force, length and stress belong to one"
                          f" system?")
    for contact in body.scene.contacts:
        tool = contact.tool
        gap = float(-tool.signed_distance(body.scene.mesh.nodes_of(contact.on)).max())
        if gap > 20 * body.length:
            yield Finding("warning", repr(contact), f"the tool is {body.format(gap, 'travel', 3)} away from a body of"
                          f" length {body.format(body.length, 'travel', 3)}: are the units of length the same (mm and"
                          f" m)?")
            continue
        if tool.components == 3:                             # checked by Scene
            continue
        arcs = [p.radius for p in tool.pieces if isinstance(p, Arc) and p.radius > 0]
        shaped = len(tool.pieces) > 2 or tool.closed
        if shaped and not 0.01 < tool.size / body.length < 100 or arcs and min(arcs) > 1e3 * body.length:
            yield Finding("warning", repr(contact), f"the tool is {body.format(tool.size, 'travel', 3)} large, the body"
                          f" {body.format(body.length, 'travel', 3)}: are the units of length the same (mm and m)?")


@register("scene")
def _targets(body: SizedBody) -> Iterator[Finding]:
    """Report targets that the body cannot reach, or whose magnitude does not fit it."""
    for target in body.targets:
        reason = unreachable(body.scene, target)
        if reason is not None:                                  # a stage may have made an obstacle inactive
            yield Finding("serious" if body.scene.driven is not None else "warning", str(target), reason)
        is_length = target.name.endswith(("pole_height", "travel")) or target.name.startswith("u_")
        if is_length and abs(target.value) > 20 * body.length:
            yield Finding("warning", str(target), f"it is {abs(target.value) / body.length:.3g} times the length of"
                                                  f" the body, {body.format(body.length, 'travel')}: are the units of"
                                                  f" length the same?")
        if target.name == "pole_stretch" and target.value < 1 and not body.scene.contacts:
            yield Finding("warning", str(target), "a sheet starts at 1, and its pole stretch grows as it is inflated")
