"""A run as plain data, made from a path or from a checkpoint alone: what reports and pictures are made of."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ...discrete.admissible import Least
from ...discrete.tooling import Tooling
from ...errors import InputError
from .. import files
from ..evaluate import edges, snaps, tension, volume
from ..evaluate.contact_face import ContactFace, ContactTable, tool_forces
from ..evaluate.profile import Profile

PENETRATION = 0.05
"""Penetration over the smallest thickness above which a report warns."""

MASS = 1e-3
"""Relative error of the mass above which a report warns."""


@dataclass
class Record:
    """A run as plain data.

    Attributes:
        summary: {part of the scene: one line}; versions: {program: version}; axisymmetric: else plane strain.
        kinds: of the states; stages: their names, "" in a run without; measures: {column: shape (n,)}.
        histories: of the n states, rows (residual, correction, work) of Newton's iterations.
        profiles: of the n states, each a `Profile`, or None.
        counts: what the run cost; until: (measure, value) that it aimed at, or None.
        tooling: the `Tooling` of the scene; travels: of the n states, `Tooling.travels`.
        forces: {tool: the force that it takes, shape (n,)}, positive when it resists its travel; of a tool that stays,
            along Z.
        fields: of the n states, {name: values at the nodes of the bottom face, or of both faces, shape (m,)}; more than
            the profiles say; empty of a checkpoint.
        layers: of the last state, as in `Wall`; script: the file that ran; or "".
        furthest: where J is furthest from 1 in the last state, or None: not known of a checkpoint or a membrane.
        edge: `edges.coarsest` in the last state, or None; compression: `tension.first_compression`, or None; snap:
            `snaps.largest`, or None.
        verdicts: of the n states, `State.verdict`.
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
    furthest: Least | None = None
    edge: edges.Edge | None = None
    compression: tuple[int, tension.Resultant] | None = None
    verdicts: Sequence[str] = ()
    snap: snaps.Snap | None = None

    @property
    def control(self) -> str:
        """The column of what is driven."""
        return next(iter(self.measures))

    @property
    def progress(self) -> np.ndarray:
        """How far the process has come in each state, see `progress`, shape (n,)."""
        return progress(self.measures, self.profiles)

    def findings(self) -> list[tuple[str, str]]:
        """(how bad: "serious", "minor" or "note"; what) a reader should know before trusting the numbers."""
        found = []
        if self.until is not None and self.until[0] in self.measures:
            last, (name, value) = self.measures[self.until[0]][-1], self.until
            if abs(last - value) > 1e-6 * abs(value):
                found.append(("serious", f"The path ended early: it aimed at {words(name)} {value:g}; its last state"
                                         f" has {last:.6g}."))
        if "penetration" in self.measures:
            deep, thickness = self.measures["penetration"].max(), self._smallest_thickness()
            if thickness is not None and deep > PENETRATION * thickness:
                found.append(("serious" if deep > 4 * PENETRATION * thickness else "minor",
                              f"The body penetrates a tool by {deep:.3g}, {100 * deep / thickness:.2g} % of its"
                              f" smallest thickness: a larger contact penalty makes that less."))
        worst = np.abs(self.measures["mass_error"]).max()
        if worst > MASS:
            found.append(("serious" if worst > 10 * MASS else "minor",
                          f"The mass changes by up to {100 * worst:.2g} %: a smaller eps, or a finer mesh, keeps it."))
        found += self._of_volume() + self._of_verdict() + edges.doubts(self.edge)
        found += tension.doubts(self.compression) + snaps.doubts(self.snap)
        if self.counts.get("failures", 0) > len(self.kinds):
            found.append(("note", f"{self.counts['failures']} attempts at a step failed and were repeated with half its"
                                  f" length; the results do not suffer."))
        return found

    def _of_volume(self) -> list[tuple[str, str]]:
        errors = self.measures["volume_error"]
        k = int(np.argmax(errors))
        return volume.doubts(errors[k], f"state {k}, {words(self.control)} = {self.measures[self.control][k]:.5g}",
                             self.furthest)

    def _of_verdict(self) -> list[tuple[str, str]]:
        k = next((k for k, verdict in enumerate(self.verdicts) if verdict), None)
        return [] if k is None else [
            ("serious", f"From state {k} on ({words(self.control)} = {self.measures[self.control][k]:.5g}) the run is"
                        f" not to be used: {self.verdicts[k]}.")]

    def warnings(self) -> list[str]:
        """What a reader should know before trusting the numbers, without how bad it is."""
        return [text for _, text in self.findings()]

    def _smallest_thickness(self) -> float | None:
        last = self.profiles[-1]
        return float(last.thickness.min()) if last is not None else None


def of_path(path: Any) -> Record:
    """The record of a `Path`; collective."""
    from ...scene.summary import summary
    try:
        profiles = [path.profile(state) for state in path.states]
    except InputError:
        profiles = [None] * len(path)
    problem = path.problem
    stepping: dict = next((s.stepping for s in reversed(path.states) if s.stepping), {})
    tooling = Tooling.of_problem(problem)
    wall = path.wall() if profiles[-1] is not None else None
    return Record(summary(problem.scene), files.versions(), problem.scene.kinematics.dimension_of_volume == 3,
                  [s.kind for s in path.states], [s.stage for s in path.states], {c: path[c] for c in path.columns},
                  [list(s.history) for s in path.states], profiles, vars(path.counts), stepping.get("until"), tooling,
                  [tooling.travels(s.setting, s.control) for s in path.states], tool_forces(path),
                  _fields(path, profiles), dict(wall.layers) if wall else {}, sys.argv[0],
                  problem.furthest_volume_ratio(path.last), edges.coarsest(path, path.last),
                  tension.first_compression(path), [s.verdict for s in path.states], snaps.largest(path))


def of_checkpoint(about: dict, states: list[dict]) -> Record:
    """The record of what `formingx.checkpoint.contents` gives."""
    stepping: dict = next((s["stepping"] for s in reversed(states) if s["stepping"]), {})
    tooling = Tooling.of_description(about["scene"])
    measures = {c: np.array([s["measures"][c] for s in states]) for c in states[0]["measures"]}
    profiles = [s["profile"] and Profile(**{k: np.array(v) for k, v in s["profile"].items()}) for s in states]
    return Record(about["summary"], about["versions"], about["scene"]["kinematics"]["kind"] == "Axisymmetric",
                  [s["kind"] for s in states], [s["stage"] for s in states],
                  measures, [s["history"] for s in states], profiles, stepping.get("counts", {}),
                  stepping.get("until"), tooling,
                  [tooling.travels(s.get("setting", {}), s["control"]) for s in states],
                  {name: measures[column] for name, column in tooling.force_columns.items() if column in measures},
                  [{} for _ in states], {}, verdicts=[s["verdict"] for s in states])


def progress(measures: dict[str, np.ndarray], profiles: list[Any]) -> np.ndarray:
    """How far a process has come in each of n states, from 0 to 1, shape (n,).

    By process time where it runs; else by what is driven, over its range, and how far the sheet moves, over the whole
    way that it moves, in equal parts.
    """
    n = len(profiles)
    way, clock = np.zeros(n), measures.get("process_time", np.zeros(n))
    driven = [c for c in measures if c.endswith(("pressure", "travel", "displacement"))]
    for column in ["process_time"] if np.ptp(clock) > 0 else driven:
        values = measures[column]
        way[1:] += np.abs(np.diff(values)) / (np.ptp(values) or 1.0) / len(driven)
    if not np.ptp(clock) > 0 and all(p is not None for p in profiles):
        moved = [np.hypot(*(b.middle - a.middle).T).mean() for a, b in zip(profiles, profiles[1:])]
        way[1:] += np.array(moved) / (sum(moved) or 1.0)
    done = np.cumsum(way)
    return done / done[-1] if done[-1] > 0 else np.linspace(0, 1, n)


def words(name: str) -> str:
    """A column's name for people."""
    return name.replace("_", " ")


def _fields(path: Any, profiles: list) -> list[dict[str, np.ndarray]]:
    """Stress and contact pressure at the nodes of both faces of a sheet, state by state."""
    if profiles[-1] is None:
        return [{} for _ in path.states]
    points = [profiles[-1].rest_bottom, profiles[-1].rest_top]
    solid = path.problem.forms.domain.topology.dim == 2
    layers = list(path.problem.scene.mesh.layers)
    faces = [ContactFace(path, contact) for contact in path.problem.contacts]
    found = []
    for state in path.states:
        here = {}
        if solid and len(layers) == 1:
            stress = path.stress(state).at(np.vstack(points))
            here["largest principal stress"] = stress.principal_stresses[:, 0].reshape(2, -1).max(0)
        if faces:
            here["contact pressure"] = sum(_nearest(face.of(state), points) for face in faces)
        found.append(here)
    return found


def _nearest(table: ContactTable, points: list[np.ndarray]) -> np.ndarray:
    """Contact pressure at the stations of a profile, of the nodes of a face near either of its faces at rest, (m,)."""
    from scipy.spatial import cKDTree
    tree = cKDTree(table.rest)
    away, at = zip(*(tree.query(p) for p in points))
    nearer = np.argmin([a.mean() for a in away])
    return table.pressure[at[nearer]]
