"""Checkpoints: a folder with every accepted state of a run, from which the run can continue on any number of ranks.

    run/scene.json        description of the scene, and versions of programs.
    run/0000/state.json   numbers of state 0, and checksums.
    run/0000/arrays.bin   arrays of state 0 (`arrays.pack`): unknowns, tangent of the path, history variables.
    run/pilot/            checkpoint of the first run with `adapt_mesh=`, to which the mesh was adapted.
    run/end.json          error message and findings at the end of the run; missing while it runs, or if it was killed.

A state is written under a temporary name and then renamed. So a state with its final name is complete, even if the run
is killed. Fields and history variables are stored in the order of the cells in the script's mesh. This order does not
depend on the number of ranks. The first state after remeshing also stores the new mesh and the data transferred to it
("mesh").
"""

import errno
import json
import os
import shutil
from collections.abc import Callable, Sequence
from dataclasses import fields
from typing import Any

import numpy as np
from dolfinx import fem

from ...errors import InputError, check_type, file_path
from ...findings import Finding
from ...measures.targets import Target
from ...problem.problem import Problem
from ...ranks import original
from ...scene.scene import Scene
from ...scene.summary import summary
from ...solve.arc_length import Curve
from ...solve.newton import Iteration, Tolerances
from ...solve.record import Counts, Record, Segment
from ...solve.state import State
from .. import files
from .arrays import pack
from .checkpoint_data import (
    ARRAYS,
    END,
    FIELDS,
    FORMAT,
    HISTORIES,
    PILOT,
    check_scene,
    complete_states,
    crc_sums,
    named_os_errors,
    read_data,
    read_json,
    read_states,
    state_name,
)
from .description import describe, incomparable
from .progress import progress


class Checkpoint:
    """Writer of the checkpoint folder of one run, a `pathlib.Path`; creating it is collective.

    A folder of another run, or with other files, is an InputError; one that cannot be written an OSError.
    """

    def __init__(self, folder: Any, path: Any):
        self.folder, self._path, self._comm = file_path("checkpoint", folder), path, path.problem.comm
        self._n_written = self._begin()                         # states in the folder

    def write(self) -> None:
        """Write new states of the path; an OSError, as of a full disk, keeps all earlier states; collective."""
        path, first = self._path, self._n_written
        with progress(self._comm, f"{self.folder}: {len(path) - first} states") as done:
            for number in range(first, len(path)):
                self._write_state(number, path.states[number])
                self._n_written = number + 1
                done((self._n_written - first) / (len(path) - first))

    def end(self, failure: str, findings: Sequence[Finding]) -> None:
        """Write end.json with the error message, or "", and the findings of a run; collective. Raises OSError."""
        about = {"failure": failure, "findings": findings}
        files.on_root(self._comm, lambda: named_os_errors(
            lambda: files.replace(self.folder / END, lambda stream: json.dump(about, stream, indent=1)),
            self.folder, f"{END} could not be written; its states are kept"))

    def _begin(self) -> int:
        """Create the folder, or check that its states belong to this run, and return their number; collective.

        States of an unfinished last step are removed. Another run or other files are an InputError.
        """
        problem, folder, path = self._path.record.segments[0].problem, self.folder, self._path
        scene = describe(problem)
        about = {"formingx": FORMAT, "versions": files.versions(), "scene": scene, "summary": summary(problem.scene)}

        def begin():
            if not (folder / "scene.json").exists():
                if folder.exists() and (not folder.is_dir() or {entry.name for entry in folder.iterdir()} - {PILOT}):
                    raise InputError(f"checkpoint {str(folder)!r} exists already and is not a checkpoint")
                folder.mkdir(parents=True, exist_ok=True)
                files.replace(folder / "scene.json", lambda stream: json.dump(about, stream, indent=1))
                return 0
            about_stored = read_json(folder / "scene.json")
            check_scene(folder, about_stored, scene)
            folders = complete_states(folder)
            stored = [read_data(folder, k, checksums=False) for k in range(len(folders))]
            settled = max((k + 1 for k, data in enumerate(stored) if data["stepping"]), default=len(stored))
            complete = stored[:max(settled, len(path))]        # later states belong to an unfinished step
            if len(complete) > len(path) or any((h["control"], h["slope"]) != (s.control, s.slope)
                                             for h, s in zip(complete, path.states)):
                raise InputError(f"checkpoint {str(folder)!r} holds {len(stored)} states of another run: go on from it"
                                 f" with start=fx.load({str(folder)!r}, scene), give another folder, or remove it")
            for unfinished in folders[len(complete):]:
                shutil.rmtree(unfinished)
            return len(complete)
        return files.on_root(problem.comm, lambda: named_os_errors(begin, folder, "cannot be begun"))

    def _write_state(self, number: int, state: State) -> None:
        """Write a state of the path; collective. A state that exists or cannot be written raises an OSError."""
        segment = self._path.record.segment(state)
        problem = segment.problem
        final = self.folder / state_name(number)
        part = final.with_name(final.name + ".part")
        variables = [history.save(values)
                     for history, values in zip(problem.history.parts, state.history_variables, strict=True)]
        space = problem.forms.space
        data = _plain_state(state) | {"number": number, "memory": variables, "profile": _profile(self._path, state)}
        if state is segment.states[0] and segment is not self._path.record.segments[0]:
            data["mesh"] = problem.scene.state_transfer.save(problem)
        for name in FIELDS:
            data |= {name: _by_cell(space, getattr(state, name)), f"{name}_tail": _tail(space, getattr(state, name))}

        def look():
            if not self.folder.is_dir():
                raise FileNotFoundError(errno.ENOENT, "the folder is gone, and the states in it")
            if final.exists():
                raise FileExistsError(errno.EEXIST, "it is there already: does another run write to this folder?")

        def put():
            plain, content = pack(data)
            shutil.rmtree(part, ignore_errors=True)
            part.mkdir()
            (part / ARRAYS).write_bytes(content)
            text = json.dumps(plain | {"checksums": crc_sums(plain, content)})
            (part / "state.json").write_text(text, encoding="utf-8")
            try:
                os.rename(part, final)
            except OSError as error:
                if not final.exists():
                    raise
                raise FileExistsError(errno.EEXIST, "another run wrote it: each needs a folder of its own") from error
            (self.folder / END).unlink(missing_ok=True)    # the run continues

        def act():
            what = f"state {number} could not be written"
            named_os_errors(look, self.folder, what)
            named_os_errors(put, self.folder, f"{what}; the states before it are kept")
        files.on_root(problem.comm, act)


def read(folder: Any, scene: Scene, state: int | None = None, resumes: bool = False) -> Record:
    """Return the solver's record of the run in a checkpoint up to a state (`formingx.load`); collective.

    Default is the last state of the last completed step. A damaged checkpoint, another scene or state is an InputError,
    with `resumes` also an object that cannot be compared.
    """
    folder = file_path("load: folder", folder)
    problem = Problem(check_type("load: scene", scene, Scene, "a formingx.Scene"))
    about = describe(problem)
    if resumes and (unknown := next(incomparable(about), None)):
        raise InputError(f"checkpoint {str(folder)!r}: {unknown[0]} of the scene, {unknown[1]}, cannot be compared with"
                         f" the one of the checkpoint: if they are equal, go on with"
                         f" start=fx.load({str(folder)!r}, scene)")

    def look():
        check_scene(folder, read_json(folder / "scene.json"), about)
        folders = complete_states(folder)
        if not folders:
            raise InputError(f"checkpoint {str(folder)!r} holds no state")
        if state is not None and not (isinstance(state, int) and 0 <= state < len(folders)):
            raise InputError(f"load: state = {state!r}: the checkpoint holds states 0 to {len(folders) - 1}")
        found = read_states(folder, len(folders) if state is None else state + 1, problem.comm)
        settled = [k for k, data in enumerate(found) if data["stepping"]]
        return found[:settled[-1] + 1] if state is None and settled else found
    found = files.on_root(problem.comm, look)
    record = Record(problem, Curve(problem, Tolerances()))
    for data in found:
        if "mesh" in data:
            problem = _on_next_mesh(problem, record.last, data["mesh"])
            record.segments.append(Segment(problem, Curve(problem, Tolerances())))
        record.segments[-1].states.append(_read_state(data, problem))
    last_stepping = next((s.stepping for s in reversed(record.states) if s.stepping), None)
    record.counts = Counts(**last_stepping["counts"]) if last_stepping else Counts()
    record.counts.steps = sum(s.kind != "start" for s in record.states)
    problem.restore(record.last)
    return record


_mesh_loaders: list[Callable[[Problem, State, dict[str, Any]], Problem]] = []


def register_mesh_loader(loader: Callable[[Problem, State, dict[str, Any]], Problem]) -> None:
    """Register the loader of a new mesh, (problem, last state, data) to problem, of a remeshed run."""
    _mesh_loaders[:] = [loader]


def _on_next_mesh(problem: Problem, last: State, data: dict[str, Any]) -> Problem:
    """Return the problem on the next mesh of a remeshed run; InputError without the extension `remeshing`."""
    if not _mesh_loaders:
        raise InputError("load: the checkpoint is of a remeshed run: the extension 'remeshing' of formingx is not"
                         " installed")
    return _mesh_loaders[0](problem, last, data)


def holds_states(folder: Any, comm: Any) -> bool:
    """Return True if a folder is a checkpoint with a state; InputError if states are missing; collective."""
    folder = file_path("checkpoint", folder)
    return files.on_root(comm, lambda: (folder / "scene.json").exists() and bool(complete_states(folder)))


def _read_state(data: dict, problem: Any) -> State:
    """Return the `State` of a problem from its data in a checkpoint, with arrays; collective."""
    data, space = dict(data), problem.forms.space
    last = problem.comm.rank == problem.comm.size - 1
    arrays = {name: np.concatenate([_of_cells(space, data[name]), data[f"{name}_tail"] if last else []])
              for name in FIELDS}
    target, stored = data.pop("target"), (f.name for f in fields(State) if f.name not in (*FIELDS, *HISTORIES))
    return State(**arrays, target=Target(target[0], target[1], None, target[2]) if target else None,
                 history=[Iteration(*row) for row in data.pop("history")],
                 history_variables=_read_history_variables(problem, data.pop("memory")),
                 **{name: data[name] for name in stored if name in data})


def _by_cell(space: Any, owned: np.ndarray) -> np.ndarray:
    """Return cells' unknowns (cells, k) in the order of the script on rank 0, from owned ones; collective."""
    topology, w = space.mesh.topology, fem.Function(space)
    cells, n = topology.index_map(topology.dim).size_local, space.dofmap.index_map.size_local
    w.x.array[:n] = owned[:n]
    w.x.scatter_forward()
    own = topology.original_cell_index[:cells], w.x.array[space.dofmap.list[:cells]]
    parts = original(space.mesh.comm).gather(own)
    numbers, values = (np.concatenate(column) for column in zip(*parts or [(np.zeros(0, int), np.zeros((0, 0)))]))
    return values[np.argsort(numbers)]


def _of_cells(space: Any, values: np.ndarray) -> np.ndarray:
    """Return the n owned unknowns, shape (n,), from those of all cells, (cells, unknowns per cell)."""
    numbers = space.mesh.topology.original_cell_index
    found = np.zeros(len(space.dofmap.list) and space.dofmap.list.max() + 1)
    found[space.dofmap.list] = values[numbers[:len(space.dofmap.list)]]
    return found[:space.dofmap.index_map.size_local]


def _tail(space: Any, owned: np.ndarray) -> list[float]:
    """Return the owned unknowns that belong to no cell, as Lagrange multipliers, on all ranks; collective."""
    return original(space.mesh.comm).allgather(owned[space.dofmap.index_map.size_local:].tolist())[-1]


def _plain_state(state: State) -> dict[str, Any]:
    """Return the attributes of a state as JSON data, without its unknowns and history variables."""
    excluded = (*FIELDS, *HISTORIES, "target", "history")
    data = {f.name: getattr(state, f.name) for f in fields(State) if f.name not in excluded}
    return data | {"target": state.target and [state.target.name, state.target.value, state.target.signed],
                   "history": [list(i) for i in state.history]}


def _read_history_variables(problem: Any, variables: list[dict[str, Any]]) -> list[Any]:
    """Return the history variables of a state from the dictionaries of its arrays, one per set; or an InputError."""
    if len(variables) != len(problem.history.parts):
        raise InputError("checkpoint: its states have other histories (friction, relaxation, heat) than this scene: it"
                         " belongs to another scene")
    return [history.load(data) for history, data in zip(problem.history.parts, variables, strict=True)]


def _profile(path: Any, state: State) -> dict[str, np.ndarray] | None:
    """Return the `Profile` of a state, for reports without the `Scene`, as {attribute: value}; no sheet: None."""
    try:
        profile = path.profile(state)
    except InputError:
        return None
    return {f.name: getattr(profile, f.name) for f in fields(profile)}
