"""Checks of membranes in three dimensions."""

from collections.abc import Iterator
from types import SimpleNamespace
from typing import Any

import numpy as np

from ...contact import resultants
from ...errors import InputError
from ...findings import Finding, coordinates, percent, register
from ...mesh.nodes import nearest
from ...physics.contact import Contact
from ...physics.supports import Symmetry
from ...ranks import combined, gathered
from ...values.tolerances import NEGLIGIBLE
from .lagged_steps import LAGGED
from .passed_tools import PassedTool
from .solid_tool import Swept
from .stress import stress_of
from .surface import smaller_stress
from .wall import nearest_triangles, thinnest_triangle

_UNBALANCED = 0.02         # share of the resultant of the loads that supports and tools may miss

_UNLOADED = 1e-6           # force over shear modulus, volume and length, below which a body counts as unloaded
_LEAST_RESULTANT = 1e-3    # of loads, over the sum of the forces at all nodes, to which missed forces are compared

_SLACK = 1e-4              # pressure over its target below which a sheet carries no load yet

_LITTLE_TENSION, _NO_TENSION = 0.1, 0.01
"""Larger and smaller principal force in a slack part of a sheet, at most, over the largest one in the sheet."""

_LARGE_WALL_ERROR = 0.2
"""Estimated error of the minimum wall over this wall above which a run warns of it."""


@register("end")
def compression_without_relaxed_energy(path: Any) -> Iterator[Finding]:
    """Yield a finding if 0.1 % of a membrane without relaxed energy is in compression in the last state; collective."""
    scene = path.problem.scene
    if scene.kinematics.components != 3 or scene.model.wrinkles is not None:
        return
    wall = path.wall()
    share = float(wall.reference_area[wall.wrinkled].sum() / wall.reference_area.sum())
    if share >= NEGLIGIBLE:
        place = coordinates(wall.middle[int(np.argmin(smaller_stress(wall.stretches)))])
        yield Finding("serious", "membrane", f"{100 * share:.3g} % of the sheet is in compression in the last state,"
                      f" most at (x, y, z) = {place}: it wrinkles there, and its wall depends on the mesh: use"
                      f" Membrane(wrinkles=0.01), and look at path.wall().wrinkled.")


@register("end")
def error_of_minimum_wall(path: Any) -> Iterator[Finding]:
    """Yield a finding if finer triangles would change the minimum wall in a mould by over a fifth; collective."""
    scene = path.problem.scene
    if scene.kinematics.components != 3 or not scene.contacts:
        return
    wall = path.wall()
    k = thinnest_triangle(wall)
    error = wall.error_of(k)
    if error > _LARGE_WALL_ERROR * wall.wall[k]:
        place = coordinates(wall.middle[k])
        yield Finding("warning", "wall", f"The minimum wall, {wall.wall[k]:.3g} at (x, y, z) = {place}, is too large"
                      f" by about {error:.2g}: the triangles there are too coarse for it. Use smaller triangles, or"
                      f" trace(..., adapt_mesh={{'error': 0.1}}).")


@register("end")
def bridged_ridges(path: Any) -> Iterator[Finding]:
    """Yield a finding if a tool is beyond triangles that bridge it, by 0.4 of their edges; collective."""
    problem = path.problem
    for face in problem.contacts:
        if not (face.contact.lagged and face.contact.sticks and face.active):
            continue
        with problem.state_context(path.last):
            fields = problem.x.array_r[:problem.n_owned]
            found = PassedTool(face).deepest(fields, path.last.control, LAGGED.max_passed_ratio, 0.0)
        if found is not None and found.ratio > LAGGED.max_passed_ratio:
            place = coordinates(found.place)
            yield Finding("warning", face.contact.label, f"Triangles bridge the tool {face.contact.label!r}, which is"
                          f" {found.depth:.2g} beyond them at (x, y, z) = {place}: use smaller triangles there.")


@register("end")
def unbalanced_loads(path: Any) -> Iterator[Finding]:
    """Yield a finding if supports and tools miss the resultant of the loads by 2 % or more; collective.

    The internal forces of a sheet have no resultant, so the reactions balance the loads unless one of them is wrong.
    """
    problem = path.problem
    if path.scene.kinematics.components != 3 or not problem.contacts or not problem.scene.loads:
        return
    forms = problem.forms
    if forms.elastic_supports:
        return
    vectors, numbers = forms.space.sub(0).collapse()
    nodes = np.asarray(numbers).reshape(-1, 3)[:vectors.dofmap.index_map.size_local]
    with problem.state_context(path.last):
        control, scale = path.last.control, forms.stress * forms.volume / forms.length
        held = np.zeros(len(problem.forces(problem.x, control)))
        held[problem.constrained] = problem.forces(problem.x, control)[problem.constrained]
        works = sum(problem.assemble(forms.compile(work)) for work in forms.load_works)
        loads, supports = (combined(problem.comm, values[nodes].sum(0)) for values in (works / forms.length,
                                                                                       scale * held))
        each = combined(problem.comm, float(np.linalg.norm(works[nodes] / forms.length, axis=1).sum()))
        tools = sum(resultants.force(face, problem.x.array_r[:problem.n_owned], control)
                    for face in problem.contact.faces)
    missed, planes = tools - supports - loads, [plane.axis for plane in path.scene.symmetry.planes]
    missed[planes] = loads[planes] = 0.0                      # balanced by the mirror image
    largest = max(float(np.linalg.norm(loads)), _LEAST_RESULTANT * each)                 # in a tube they balance
    if largest < _UNLOADED * scale:
        largest = max(float(np.linalg.norm(tools)), _UNLOADED * scale)
    share = float(np.linalg.norm(missed)) / largest
    if share > _UNBALANCED:
        yield Finding("warning", "forces", f"the forces on supports and tools miss the resultant of the loads by"
                      f" {percent(share)} in the last state: do not use a force. Use smaller triangles where the sheet"
                      f" slides on fillets, or adapt_mesh=True.")


@register("start")
def sheets_pulled_along(body: Any) -> Iterator[Finding]:
    """Yield a finding for a stage in which a tool moves back with the sheet, which sticks to it and cannot separate."""
    travels: dict[int, float] = {}                           # at the end of the last stage, by number of the tool
    for step in body.plans:
        until, ends = step.stage.until, {i: table[:, 1] for i, table in step.tables}
        if step.numbers and until is not None and until.name.endswith("travel"):
            ends[step.numbers[0]] = np.array([until.value])
        for i, values in ends.items():
            tool, way = body.scene.items[i], np.append(travels.get(i, 0.0), values)
            travels[i] = float(way[-1])
            back = np.any(np.diff(np.maximum(way, 0.0)) < 0)
            if isinstance(tool, Contact) and tool.lagged and not tool.separates and back and i not in step.inactive:
                yield Finding("warning", step.stage.label, f"{tool.label!r} moves back and takes the sheet along, which"
                              f" sticks to it: leave the tool out of the stage, inactive=[{tool.label!r}], or use"
                              f" Contact(..., separates=True), if the sheet does not relax")


@register("start")
def coarse_triangles(body: Any) -> Iterator[Finding]:
    """Yield a finding for a triangle longer than half the distance from the edges held in z to the sheet's middle.

    The pressure of a blister is then off by 4 to 12 %, or more (tests/test_checks_in_space.py).
    """
    scene = body.scene
    if scene.kinematics.components != 3:
        return
    held = [scene.mesh.nodes_of(support.on) for support in scene.supports
            if not isinstance(support, Symmetry) and any(scene.kinematics.axes[c.component] == "z"
                   for c in scene.kinematics.in_axes(support, support.constraints()))]
    if not held:
        return
    reach = float(nearest(np.vstack(held), scene.mesh.whole()[0])[0].max())
    longest = float(body.edge.max())
    if 2 * longest > reach:
        yield Finding("warning", "mesh", f"edges of triangles are up to {body.format(longest, 'travel', 3)} long, and"
                      f" the middle of the sheet is {body.format(reach, 'travel', 3)} from its held edges: pressures"
                      f" will be off by several per cent. Use fx.mesh.sheet(..., size={reach / 10:.2g}), or"
                      f" adapt_mesh=True")


@register("start")
def asymmetric_across_planes(body: Any) -> Iterator[Finding]:
    """Yield a finding for each swept tool that crosses a plane of symmetry without being symmetric; collective."""
    scene = body.scene
    if scene.kinematics.components != 3:
        return
    mesh = scene.mesh
    nodes = gathered(mesh.comm, mesh.domain.geometry.x)
    size = float(np.ptp(nodes, axis=0).max())
    for support in (s for s in scene.supports if isinstance(s, Symmetry)):
        axis = scene.kinematics.in_axes(support, support.constraints())[0].component
        plane = float(mesh.nodes_of(support.on)[0, axis])
        for contact in (c for c in scene.contacts if isinstance(c.tool, Swept)):
            low, high = contact.tool.bounds
            if axis > 1 or not low[axis] + 1e-6 * size < plane < high[axis] - 1e-6 * size:
                continue
            points = np.concatenate([nodes + [0.0, 0.0, z] for z in np.linspace(low[2], high[2], 9)])
            image = points.copy()
            image[:, axis] = 2 * plane - points[:, axis]
            away = np.abs(np.subtract(*map(contact.tool.signed_distance, (points, image)))).max()
            if away > 1e-6 * size or contact.direction and contact.direction[axis]:
                yield Finding("warning", repr(contact), f"the tool is not symmetric about the plane {'xy'[axis]} ="
                              f" {plane:.4g} of {support!r}: the run forms the part of a tool that is mirrored there."
                              f" Move the tool, or model the whole sheet.")


@register("failure")
def slack_sheet(failure: Any) -> Iterator[Finding]:
    """Yield a finding if a sheet that has relaxed on a tool is slack at the start of a pressure in no time; collective.

    Only a very small stiffness then holds its positions, of which many are in equilibrium.
    """
    problem, facts, target = failure.problem, failure.facts, failure.target
    if failure.last is None or problem.scene.kinematics.components != 3 or not target:
        return
    relaxes = any(material.internal or material.integral for material in problem.scene.materials.values())
    at_start = problem.description.control_kind == "pressure" and abs(facts["control"]) < _SLACK * abs(target)
    if relaxes and at_start and not problem.setting.rate[-1] and failure.last.time:
        yield Finding("serious", "membrane", f"the sheet is slack: it has relaxed and carries no load yet, at"
                      f" {facts['what']} = {facts['control']:.3g}, and no time passes in this stage, so nothing holds"
                      f" its folds", "a duration for this stage, Stage(..., duration=...), in which the sheet resists"
                                     " by its viscosity")


@register("failure")
def slack_part(failure: Any) -> Iterator[Finding]:
    """Yield a finding if the largest out-of-balance force is at a slack part of a sheet; collective.

    With relaxed energy it has little tension in one direction, none in the other: its tangent is nearly singular.
    """
    problem, worst = failure.problem, failure.facts.get("worst")
    scene = problem.scene
    if failure.last is None or worst is None or scene.kinematics.components != 3 or scene.model.wrinkles is None:
        return
    try:
        stress = stress_of(SimpleNamespace(problem=problem, scene=scene), failure.last, None)
    except InputError:                                       # K-BKZ
        return
    wall, forces = stress.wall, stress.resultants
    larger, smaller = forces[nearest_triangles(wall, worst.position)[1]].T / max(float(forces.max()), 1e-300)
    slack = (larger < _LITTLE_TENSION) & (smaller < _NO_TENSION)
    if slack.any():
        yield Finding("serious", "membrane", f"the sheet is slack at {worst}, where the largest out-of-balance force"
                      f" is: its tension there is {percent(max(larger[slack].max(), 0.0))} of the largest one, and with"
                      f" wrinkles={scene.model.wrinkles:g} nothing else holds its folds",
                      "Membrane() without wrinkles=, which resists compression; or a support or a load that keeps this"
                      " part taut, or a mesh without it")
