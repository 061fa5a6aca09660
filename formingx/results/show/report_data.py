"""Data of a run for reports and animations, from a path or from a checkpoint without the scene."""

import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from ...contact.tooling import Tooling
from ...errors import InputError
from ...findings import Finding, percent, worst_first
from ...mesh.nodes import nearest
from ...scene.symmetry import NO_PLANES, MirrorPlanes
from ...values.temperature import DEGREES
from ...values.tolerances import LARGE_ERROR, NEGLIGIBLE, NOTICEABLE
from .. import files
from ..evaluate import volume
from ..evaluate.contact_face import ContactFace, ContactTable, tool_forces
from ..evaluate.filling import corners_of
from ..evaluate.profile import Profile, distance_to_line, refined
from ..files.description import plain
from ..files.progress import progress as shown_progress
from ..files.status import target_column
from .attempts import Attempts

FRAMES = 100
"""Approximate number of drawn states."""

CONTROLS = "pressure", "travel", "displacement"
"""Endings of the columns of controlled quantities."""


@dataclass
class ReportData:
    """Data of a run with n states for its report, without the discretised problem.

    Attributes:
        summary: {part of the scene, such as "mesh": one line of text}.
        versions: {program: version}.
        axisymmetric: False in plane strain and in three dimensions.
        kinds: kind of each state (`State.kind`).
        stages: name of the stage of each state, "" in a run without stages.
        measures: {column: values, shape (n,)}.
        histories: for each state one row per Newton iteration: relative residual, relative correction of the unknowns,
            relative work of the residual, and True for a chord iteration.
        profiles: for each state a `Profile`; None if the body is not a sheet, or if the state is not drawn (`frames`).
        counts: cost of the run: numbers of "steps", "failures" and "iterations", duration in "seconds", and "limits",
            {reason for a shorter or failed step: count}; {} if unknown.
        until: target of the run (column, value), or None.
        tooling: the `Tooling` of the scene.
        travels: for each state the travel of each tool, length; None for an inactive tool (`Tooling.travels`).
        forces: {tool: force of the body on it, shape (n,)}, positive if it resists the travel. The force on a fixed
            tool is its Z component, positive if the body pushes the tool up.
        fields: for each drawn state {name: values at the m nodes of the profile, shape (m,)}. A record from a
            checkpoint has the temperature only.
        layers: {layer: its fraction of the wall in the last state, 0 to 1, at the nodes of the profile, shape (m,)}.
        script: name of the file of the script, or "".
        findings: findings on the run (`Path.findings`); a checkpoint holds them once the run has ended.
        failure: error message that ended the run, or "".
        inadmissible_reasons: reason why each state is inadmissible, or "" (`State.inadmissible_reason`).
        heat: {tool: (conductance of the contact, temperature of the tool as text)} for tools that conduct heat.
        unit: unit of temperatures, "°C" or "K"; "" without heat transfer.
        space: True for a sheet in three dimensions.
        planes: symmetry planes at which only a half or a quarter of the part is modelled.
        drawn: approximate number of drawn states.
    """

    summary: dict[str, str]
    versions: dict[str, str]
    axisymmetric: bool
    kinds: list[str]
    stages: list[str]
    measures: dict[str, np.ndarray]
    histories: list[list]
    profiles: list[Any]
    counts: dict[str, Any]
    until: tuple[str, float] | None
    tooling: Tooling
    travels: list[list[float | None]]
    forces: dict[str, np.ndarray]
    fields: list[dict[str, np.ndarray]]
    layers: dict[str, np.ndarray]
    script: str = ""
    findings: Sequence[Finding] = ()
    failure: str = ""
    inadmissible_reasons: Sequence[str] = ()
    heat: dict[str, tuple[float, str]] = field(default_factory=dict)
    unit: str = ""
    space: bool = False
    planes: MirrorPlanes = NO_PLANES
    drawn: int = FRAMES

    @property
    def per_depth(self) -> bool:
        """True in plane strain: forces, energies, volumes and areas are per unit depth."""
        return not (self.axisymmetric or self.space)

    def control(self, state: int) -> str:
        """Return the column of the controlled quantity in the stage of a state.

        It is the first pressure, travel or displacement that changes; without one, or in time, the first column.
        """
        first, end = next(ends for ends in self.stage_ranges if state < ends[1])
        changes = [c for c, v in self.measures.items()
                   if c.endswith(CONTROLS) and np.ptp(v[first:end]) > 1e-9 * np.ptp(v)]
        return changes[0] if changes and not self.timed else next(iter(self.measures))

    @property
    def progress(self) -> np.ndarray:
        """Progress in each state by process time, or without time by motion, from 0 to 1, shape (n,)."""
        return progress(self.measures, self.profiles)

    @property
    def timed(self) -> bool:
        """True if the process time advances in the run."""
        return bool(np.ptp(self.measures.get("process_time", 0.0)) > 0)

    @property
    def stage_ranges(self) -> list[tuple[int, int]]:
        """For each stage in order, the number of its first state, and 1 + the number of its last state."""
        ends = [k for k in range(1, len(self.stages)) if self.stages[k] != self.stages[k - 1]]
        return list(zip([0, *ends], [*ends, len(self.stages)]))

    @property
    def frames(self) -> list[int]:
        """Numbers of the states that the report draws, in order."""
        return frames(self.progress, self.kinds, self.stages, self.drawn)

    @property
    def shown(self) -> list[int]:
        """Numbers of the states that the report draws and that have a profile, in order."""
        return [k for k in self.frames if self.profiles[k] is not None]

    def all_findings(self) -> list[Finding]:
        """Return all findings on the run, the worst first.

        They are the findings of its checks (`findings`), and those on the values of its columns in all states.
        """
        found = []
        if self.until is not None and self.until[0] in self.measures:
            last, (name, value) = self.measures[self.until[0]][-1], self.until
            if abs(last - value) > 1e-6 * abs(value):
                found.append(Finding("serious", "target", f"The path ended early: its target is {words(name)}"
                                     f" {value:g}; its last state has {last:.6g}."))
        if "penetration" in self.measures:
            deep, thickness = self.measures["penetration"].max(), self._smallest_thickness()
            if thickness is not None and deep > LARGE_ERROR * thickness:
                begins = self._first(self.measures["penetration"] > LARGE_ERROR * thickness)
                found.append(Finding("warning" if deep > 4 * LARGE_ERROR * thickness else "note", "penetration",
                                     f"The body penetrates a tool by {deep:.3g}, {percent(deep / thickness)} of its"
                                     f" smallest thickness{begins}: a larger contact penalty reduces it."))
        worst = np.abs(self.measures["mass_error"]).max()
        if worst > NEGLIGIBLE:
            begins = self._first(np.abs(self.measures["mass_error"]) > NEGLIGIBLE)
            found.append(Finding("warning" if worst > 10 * NEGLIGIBLE else "note", "mass",
                                 f"The mass changes by up to {percent(worst)}{begins}: use a smaller eps or a finer"
                                 f" mesh."))
        found += [*self._volume_findings(), *self._admissibility_findings()]
        subjects = {finding.about for finding in found}      # these are on all states, `self.findings` on the last one
        found += [finding for finding in self.findings if finding.about not in subjects]
        if self.counts.get("failures", 0) > len(self.kinds):
            found.append(Finding("note", "steps", f"{self.counts['failures']} attempts at a step failed and were"
                                 f" repeated with a shorter step; this does not impair the results."))
        return worst_first(found)

    @property
    def limits(self) -> dict[str, int]:
        """{reason for a shorter or failed step: count}, the most frequent first; empty if unknown."""
        return dict(sorted(self.counts.get("limits", {}).items(), key=lambda entry: -entry[1]))

    def gaps(self, states: list[int]) -> dict[str, np.ndarray]:
        """Return {"mould, corner 1": largest distance from the sheet, shape (m,), length} in m given states."""
        found = {}
        for contact in self.tooling.contacts if states else ():
            if contact.direction is not None or contact.on not in ("top", "bottom", "inner", "outer"):
                continue
            for k, (_, points) in enumerate(corners_of(contact.tool), 1):
                faces = [self.profiles[i].top if contact.on in ("top", "outer") else self.profiles[i].bottom
                         for i in states]
                found[f"{contact.name or 'tool'}, corner {k}"] = np.array(
                    [distance_to_line(points, refined(face)).max() for face in faces])
        return found

    def _first(self, where: np.ndarray) -> str:
        """Return the text ", from state ... on" of the first state in the mask, shape (n,)."""
        k = int(np.argmax(where))
        stage = f"{words(self.stages[k])!r}, " if self.stages[k] else ""
        return f", from state {k} on ({stage}{self.control_text(k)})"

    def control_text(self, state: int) -> str:
        """Return name and value of the controlled quantity in a state, as text."""
        column = self.control(state)
        return f"{words(column)} = {self.measures[column][state]:.5g}"

    def _volume_findings(self) -> list[Finding]:
        """Return a finding on the state with the largest error of the element volumes in a list; [] if it is small."""
        errors = self.measures["volume_error"]
        k = int(np.argmax(errors))
        first = int(np.argmax(errors > NOTICEABLE))
        begins = f"; more than {100 * NOTICEABLE:g} % from state {first} on" if first < k else ""
        where = f"state {k}, {self.control_text(k)}{begins}"
        clamped = [found for found in self.findings if found.about == "volume" and "clamped" in found.text]
        return clamped or volume.findings(errors[k], where)

    def _admissibility_findings(self) -> list[Finding]:
        """Return a finding on the first inadmissible state in a list; empty if all states are admissible."""
        k = next((k for k, reason in enumerate(self.inadmissible_reasons) if reason), None)
        return [] if k is None else [
            Finding("serious", "state", f"From{self._first(np.arange(len(self.kinds)) >= k)[6:]} the results must not"
                    f" be used: {self.inadmissible_reasons[k]}.")]

    def warnings(self) -> list[str]:
        """Return the texts of all findings on the run, the worst first."""
        return [finding.text for finding in self.all_findings()]

    def _smallest_thickness(self) -> float | None:
        """Return the smallest thickness of the sheet in the last state, length, or None without a sheet."""
        last = self.profiles[-1]
        return float(last.thickness.min()) if last is not None else None


def of_path(path: Any) -> ReportData:
    """Return the data of a run for its report from its `Path`; collective."""
    from ...scene.summary import summary
    problem, states, n, attempts = path.problem, path.states, len(path), Attempts()
    with shown_progress(problem.comm, f"report of {n} states") as done:
        measures = {c: path[c] for c in path.columns}
        kinds, stages = [s.kind for s in states], [s.stage for s in states]
        timed = np.ptp(measures.get("process_time", 0.0)) > 0              # then progress needs no profiles
        drawn: Any = frames(progress(measures, [None] * n), kinds, stages) if timed else range(n)
        profiles: list[Any] = [None] * n
        try:
            for k in drawn:
                profiles[k] = path.profile(states[k])
        except InputError:
            pass
        drawn = drawn if timed else frames(progress(measures, profiles), kinds, stages)
        shown: list[dict[str, np.ndarray]] = [{} for _ in states]
        if profiles[-1] is not None:
            shown = attempts.make("colours of stress, contact pressure and temperature",
                                  lambda: _fields_of(path, drawn, profiles[-1], done), shown)
        stepping: dict = next((s.stepping for s in reversed(states) if s.stepping), {})
        tooling = Tooling.of_problem(problem)
        layers: dict[str, np.ndarray] = {} if profiles[-1] is None else attempts.make(
            "the walls of the layers", lambda: dict(path.wall().layers), {})
        forces: dict[str, np.ndarray] = attempts.make("the curves of tool forces", lambda: tool_forces(path), {})
        return ReportData(summary(problem.scene), files.versions(), problem.scene.kinematics.dimension_of_volume == 3,
                      kinds, stages, measures, [list(s.history) for s in states], profiles, vars(path.counts),
                      target_column(stepping, measures), tooling,
                      [tooling.travels(s.setting, s.control) for s in states],
                      forces, shown, layers, sys.argv[0], [*path.findings(), *attempts.findings],
                      inadmissible_reasons=[s.inadmissible_reason for s in states],
                      space=problem.scene.kinematics.components == 3, planes=problem.scene.symmetry,
                      **_heat(plain(problem.scene.heat)))


def _fields_of(path: Any, drawn: Any, last: Profile, done: Callable[[float], Any]) -> list[dict[str, np.ndarray]]:
    """Return the fields of each state of a path (`ReportData.fields`); collective.

    drawn: numbers of the drawn states. last: profile in the last state. done: called with the fraction that is done.
    """
    found: list[dict[str, np.ndarray]] = [{} for _ in path.states]
    fields = {id(entry): _Fields(path._same_mesh(entry.states[0]), last) for entry in path.record.segments}
    for i, k in enumerate(drawn):
        done(i / len(drawn))
        found[k] = fields[id(path.record.segment(path.states[k]))].evaluate(path.states[k])
    return found


def of_checkpoint(about: dict, states: list[dict]) -> ReportData:
    """Return the report data of a run without its scene from `checkpoint_data.contents`."""
    stepping: dict = next((s["stepping"] for s in reversed(states) if s["stepping"]), {})
    ended = about.get("ended") or {"findings": (), "failure": ""}
    tooling = Tooling.of_description(about["scene"])
    measures = {c: np.array([s["measures"][c] for s in states]) for c in states[0]["measures"]}
    profiles = [s["profile"] and Profile(**{k: np.array(v) for k, v in s["profile"].items()}) for s in states]
    return ReportData(about["summary"], about["versions"], about["scene"]["kinematics"]["kind"] == "Axisymmetric",
                  [s["kind"] for s in states], [s["stage"] for s in states],
                  measures, [s["history"] for s in states], profiles, stepping.get("counts", {}),
                  target_column(stepping, measures), tooling,
                  [tooling.travels(s.get("setting", {}), s["control"]) for s in states],
                  {name: measures[column] for name, column in tooling.force_columns.items() if column in measures},
                  _temperatures(states, profiles[-1]), {},
                  inadmissible_reasons=[s["inadmissible_reason"] for s in states],
                  space=about["scene"]["kinematics"]["kind"] == "ThreeD",
                  planes=MirrorPlanes.of_description(about["scene"]), **ended, **_heat(about["scene"].get("heat")))


def _heat(heat: dict[str, Any] | None) -> dict[str, Any]:
    """Return the arguments "heat" and "unit" of `ReportData`; empty for a scene without heat transfer."""
    if not heat:
        return {}

    def described(tool):
        return f"{tool:g}" if isinstance(tool, int | float) else f"{tool['start']:g} at first, {tool['back']:g} behind"
    return {"heat": {name: (conductance, described(tool)) for name, (conductance, tool) in heat["tools"].items()},
            "unit": DEGREES[heat["unit"]]}


def _temperatures(states: list[dict], last: Profile | None) -> list[dict[str, np.ndarray]]:
    """Return {"temperature": values (m,) at the nodes of a sheet}, or {}, in the states of a checkpoint.

    The stored history variables in "memory" have "points" and "temperature"; `last` is the profile with m nodes.
    """
    found: list[dict[str, np.ndarray]] = [{} for _ in states]
    numbers = None
    for values, state in zip(found, states):
        stored = next((m for m in state["memory"] if "temperature" in m and "points" in m), None)
        if stored is None or last is None:
            return found
        if numbers is None:
            numbers = nearest(np.asarray(stored["points"]), np.array([last.reference_bottom, last.reference_top]))[1]
        values["temperature"] = np.asarray(stored["temperature"])[numbers].mean(0)
    return found


def frames(progressed: np.ndarray, kinds: list[str], stages: list[str], count: int = FRAMES) -> list[int]:
    """Return the numbers of about `count` states to be drawn, in order, with ends of stages and limit points.

    The others are even over the mean of progress, (n,), from 0 to 1, and number of the state.
    """
    n = len(progressed)
    marked = {k for k in range(n) if kinds[k] == "limit point" or stages[k:k + 2] != [stages[k]] * 2} | {0, n - 1}
    position = (progressed + np.linspace(0, 1, n)) / 2
    even = np.searchsorted(position, np.linspace(0, 1, max(count - len(marked), count // 2)))
    return sorted({*marked, *map(int, even.clip(0, n - 1))}) if n > count else list(range(n))


def progress(measures: dict[str, np.ndarray], profiles: list[Any]) -> np.ndarray:
    """Return the progress of a process in n states, from 0 to 1, shape (n,).

    It is proportional to process time; in stages without time, a control over its range counts a quarter of the total.
    In a run without time, a step adds the mean change of controls over their ranges, and the mean displacement of the
    middle line over the sum of all.
    """
    n = len(profiles)
    steps, clock = np.zeros(n), measures.get("process_time", np.zeros(n))
    driven = [measures[c] for c in measures if c.endswith(CONTROLS)]
    for values in driven:
        steps[1:] += np.abs(np.diff(values)) / (np.ptp(values) or 1.0)
    if np.ptp(clock) > 0:
        elapsed = np.diff(clock) / np.ptp(clock)
        steps[1:] = np.where(elapsed > 0, elapsed, steps[1:] / 4)
    else:
        steps /= len(driven) or 1
        if all(p is not None for p in profiles):
            moved = [np.hypot(*(b.middle - a.middle).T).mean() for a, b in zip(profiles, profiles[1:])]
            steps[1:] += np.array(moved) / (sum(moved) or 1.0)
    done = np.cumsum(steps)
    return done / done[-1] if done[-1] > 0 else np.linspace(0, 1, n)


def words(name: str) -> str:
    """Return the name of a column with spaces in place of underscores."""
    return name.replace("_", " ")


class _Fields:
    """Stress, contact pressure and temperature of a sheet, evaluated at the m nodes of its profile.

    At each node the stress is the largest principal Cauchy stress, the larger one of its values at both faces. The
    temperature is the mean of both faces.
    """

    def __init__(self, path: Any, profile: Profile):
        self._path, self._points = path, [profile.reference_bottom, profile.reference_top]
        self._positions = [path.problem.followed(points) for points in self._points]
        solid = path.problem.forms.domain.topology.dim == 2
        self._stressed = solid and len(path.problem.scene.mesh.layers) == 1
        self._faces = [ContactFace(path, contact) for contact in path.problem.contacts]

    def evaluate(self, state: Any) -> dict[str, np.ndarray]:
        """Return {name of a field: values at the nodes, shape (m,)} in a state; collective."""
        path, points, found = self._path, self._points, {}
        if path.problem.scene.heat is not None:
            found["temperature"] = path.temperature(np.vstack(points), state).reshape(2, -1).mean(0)
        if self._stressed:
            stress = path.stress(state).at_points(np.vstack(points))
            found["largest principal stress"] = stress.principal_stresses[:, 0].reshape(2, -1).max(0)
        if self._faces:
            found["contact pressure"] = sum(_nearest(face.evaluate(state), self._positions) for face in self._faces)
        return found


def _nearest(table: ContactTable, points: list[np.ndarray]) -> np.ndarray:
    """Return the pressure of the nearest contact point at m nodes, (m,), from points of both faces, (m, 2)."""
    distance, numbers = zip(*(nearest(table.reference_points, p) for p in points))
    nearer = np.argmin([a.mean() for a in distance])
    return table.pressure[numbers[nearer]]
