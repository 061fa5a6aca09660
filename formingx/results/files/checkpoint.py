"""Checkpoints: a folder that holds every accepted state of a run, from which the run goes on, on any number of ranks.

    run/scene.json        description of the scene, and versions
    run/0000/state.json   the state's numbers, and checksums
    run/0000/arrays.bin   its arrays (`arrays.pack`): unknowns and tangent of the path, history variables
    run/end.json          how the run ended, and its findings; not there while it runs, or if it was killed

A state is written beside its place and then renamed: a state with its final name is complete, even if the run is
killed. Fields are kept by the order of the cells in the script's mesh, which does not depend on the number of ranks;
history variables, by node or by cell, likewise. The first state on a mesh that was made on the way holds that mesh,
and the data transferred to it ("mesh").
"""

import errno
import json
import logging
import os
import shutil
import time
import zlib
from collections.abc import Callable, Sequence
from dataclasses import asdict, fields
from pathlib import Path as FilePath
from typing import Any

import numpy as np
from dolfinx import fem
from mpi4py import MPI

from ...errors import InputError, instance, place
from ...findings import SEVERITIES, Finding
from ...forms.schedule import Setting
from ...measures.targets import Target
from ...problem.problem import Problem
from ...scene.scene import Scene
from ...scene.summary import summary
from ...solve.arc_length import Curve
from ...solve.newton import Iteration, Tolerances
from ...solve.record import Counts, Record, Segment
from ...solve.state import State
from .. import files
from .arrays import pack, unpack
from .description import describe, differences
from .progress import progress

FORMAT = 5                 # of the files
_FIELDS = ("x", "direction")
_ARRAYS = "arrays.bin"
_END = "end.json"
log = logging.getLogger("formingx")


class Checkpoint:
    """The folder of one run, for writing.

    Args:
        folder: made if it does not exist, else its content is checked.
        path: the `Path` of the run; the states in the folder must be its beginning.

    Raises (collective):
        InputError: the folder holds another run, or something else.
        OSError: it cannot be written.
    """

    def __init__(self, folder: Any, path: Any):
        self.folder, self._path, self._comm = place("checkpoint", folder), path, path.problem.comm
        self._there = self._begin()                         # states in the folder

    def write(self) -> None:
        """Write the states of the path that are not in the folder yet; collective.

        Raises:
            OSError: it cannot be written, or the disk is full; all states before are kept.
        """
        path, first = self._path, self._there
        with progress(self._comm, f"{self.folder}: {len(path) - first} states") as done:
            for number in range(first, len(path)):
                self._write_state(number, path.states[number])
                self._there = number + 1
                done((self._there - first) / (len(path) - first))

    def end(self, failure: str, findings: Sequence[Finding]) -> None:
        """Write the end of the run: the failure, or "", and the findings (`Path.findings`)."""
        about = {"failure": failure, "findings": findings}
        files.on_root(self._comm, lambda: _plainly(
            lambda: files.replace(self.folder / _END, lambda stream: json.dump(about, stream, indent=1)),
            self.folder, f"{_END} could not be written; its states are kept"))

    def _begin(self) -> int:
        """Make the folder, or check its content; return the number of states in it."""
        problem, folder, path = self._path.segments[0].problem, self.folder, self._path
        scene = describe(problem)
        about = {"formingx": FORMAT, "versions": files.versions(), "scene": scene, "summary": summary(problem.scene)}

        def begin():
            if not (folder / "scene.json").exists():
                if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
                    raise InputError(f"checkpoint {str(folder)!r} exists already and is not a checkpoint")
                folder.mkdir(parents=True, exist_ok=True)
                files.replace(folder / "scene.json", lambda stream: json.dump(about, stream, indent=1))
                return 0
            kept = _read_json(folder / "scene.json")
            _check_scene(folder, kept, scene)
            there = _states(folder)
            held = [_read_data(folder, k, checksums=False) for k in range(len(there))]
            settled = max((k + 1 for k, data in enumerate(held) if data["stepping"]), default=len(held))
            whole = held[:max(settled, len(path))]          # later states belong to an unfinished step
            if len(whole) > len(path) or any((h["control"], h["slope"]) != (s.control, s.slope)
                                             for h, s in zip(whole, path.states)):
                raise InputError(f"checkpoint {str(folder)!r} holds {len(held)} states of another run: go on from it"
                                 f" with start=fx.load({str(folder)!r}, scene), give another folder, or remove it")
            for left in there[len(whole):]:
                shutil.rmtree(left)
            return len(whole)
        return files.on_root(problem.comm, lambda: _plainly(begin, folder, "cannot be begun"))

    def _write_state(self, number: int, state: State) -> None:
        segment = self._path.segment(state)
        problem = segment.problem
        final = self.folder / _name(number)
        part = final.with_name(final.name + ".part")
        memory = [history.save(kept) for history, kept in zip(problem.histories, state.memory, strict=True)]
        space = problem.forms.space
        data = _plain_state(state) | {"number": number, "memory": memory, "profile": _profile(self._path, state)}
        if state is segment.states[0] and segment is not self._path.segments[0]:
            data["mesh"] = problem.scene.preformed.save(problem)
        for name in _FIELDS:
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
            (part / _ARRAYS).write_bytes(content)
            text = json.dumps(plain | {"checksums": _checksums(plain, content)})
            (part / "state.json").write_text(text, encoding="utf-8")
            try:
                os.rename(part, final)
            except OSError as error:
                if not final.exists():
                    raise
                raise FileExistsError(errno.EEXIST, "another run wrote it: each needs a folder of its own") from error
            (self.folder / _END).unlink(missing_ok=True)    # it goes on

        def act():
            what = f"state {number} could not be written"
            _plainly(look, self.folder, what)
            _plainly(put, self.folder, f"{what}; the states before it are kept")
        files.on_root(problem.comm, act)


def read(folder: Any, scene: Scene, state: int | None = None) -> Record:
    """Return the record of the run in a checkpoint; see `formingx.load`."""
    folder, problem = place("load: folder", folder), Problem(instance("load: scene", scene, Scene, "a formingx.Scene"))
    about = describe(problem)

    def look():
        _check_scene(folder, _read_json(folder / "scene.json"), about)
        there = _states(folder)
        if not there:
            raise InputError(f"checkpoint {str(folder)!r} holds no state")
        if state is not None and not (isinstance(state, int) and 0 <= state < len(there)):
            raise InputError(f"load: state = {state!r}: the checkpoint holds states 0 to {len(there) - 1}")
        found = _read_states(folder, len(there) if state is None else state + 1, problem.comm)
        settled = [k for k, data in enumerate(found) if data["stepping"]]
        return found[:settled[-1] + 1] if state is None and settled else found
    found = files.on_root(problem.comm, look)
    record = Record(problem, Curve(problem, Tolerances()))
    for data in found:
        if "mesh" in data:
            problem = _on_next_mesh(problem, record.last, data["mesh"])
            record.segments.append(Segment(problem, Curve(problem, Tolerances())))
        record.segments[-1].states.append(_read_state(data, problem))
    kept = next((s.stepping for s in reversed(record.states) if s.stepping), None)
    record.counts = Counts(**kept["counts"]) if kept else Counts()
    record.counts.steps = sum(s.kind != "start" for s in record.states)
    problem.restore(record.last)
    return record


_mesh_loaders: list[Callable[[Problem, State, dict[str, Any]], Problem]] = []


def register_mesh_loader(loader: Callable[[Problem, State, dict[str, Any]], Problem]) -> None:
    """Provide the loader of remeshed runs: (problem, last state, data of the mesh) -> problem on the new mesh."""
    _mesh_loaders[:] = [loader]


def _on_next_mesh(problem: Problem, last: State, data: dict[str, Any]) -> Problem:
    if not _mesh_loaders:
        raise InputError("load: the checkpoint is of a remeshed run: the extension 'remeshing' of formingx is not"
                         " installed")
    return _mesh_loaders[0](problem, last, data)


def holds_states(folder: Any, comm: Any) -> bool:
    """Return True if a folder is a checkpoint with a state in it; collective."""
    folder = place("checkpoint", folder)
    return files.on_root(comm, lambda: (folder / "scene.json").exists() and bool(_states(folder)))


def begun(folder: Any) -> bool:
    """Return False while a run may still begin to write to a folder: it is not there, is empty, or holds no state.

    Raises:
        InputError: it holds something else.
    """
    folder = place("checkpoint", folder)
    if not folder.exists() or folder.is_dir() and all(entry.suffix == ".part" for entry in folder.iterdir()):
        return False
    _read_json(folder / "scene.json")
    return bool(_states(folder))


def latest(folder: Any, count: int) -> tuple[int, list[dict[str, Any]], float]:
    """(number of states in a checkpoint, data of state.json of the last ones, seconds since it was written).

    A run may be writing to it.

    Raises:
        InputError: there is no checkpoint, it holds no state, or it is damaged.
    """
    folder = place("checkpoint", folder)
    _check_format(folder, _read_json(folder / "scene.json"))
    n = len(_states(folder))
    if not n:
        raise InputError(f"checkpoint {str(folder)!r} holds no state")
    age = max(time.time() - (folder / _name(n - 1) / "state.json").stat().st_mtime, 0.0)
    return n, [_read_data(folder, k, checksums=False) for k in range(max(n - count, 0), n)], age


def ended(folder: Any) -> dict[str, Any] | None:
    """{"failure": words, or "", "findings": [Finding]} of a run that has ended; None: it did not, or is older."""
    file = place("checkpoint", folder) / _END
    if not file.exists():
        return None
    found = _read_json(file)
    rows = found.get("findings")
    if not (isinstance(found.get("failure"), str) and isinstance(rows, list) and all(
            isinstance(row, list) and list(map(type, row)) == [str] * 4 and row[0] in SEVERITIES for row in rows)):
        raise InputError(f"checkpoint: {str(file)!r} is damaged: it does not say how the run ended")
    return {"failure": found["failure"], "findings": [Finding(*entry) for entry in rows]}


def contents(folder: Any) -> tuple[dict[str, Any], list[dict[str, Any]]]:
    """Return the data of scene.json, with its end, and of each state.json of a checkpoint, without a scene.

    Raises:
        InputError: there is no checkpoint, it holds no state, or it is damaged.
    """
    folder = place("checkpoint", folder)
    about = _read_json(folder / "scene.json")
    _check_format(folder, about)
    states = _read_states(folder, len(_states(folder)), MPI.COMM_WORLD)
    if not states:
        raise InputError(f"checkpoint {str(folder)!r} holds no state")
    return about | {"ended": ended(folder)}, states


def _read_states(folder: FilePath, count: int, comm: Any) -> list[dict]:
    """Return the data of the first states; a bar on rank 0 of `comm`, not collective."""
    found = []
    with progress(comm, f"{folder}: {count} states") as done:
        for k in range(count):
            found.append(_read_data(folder, k))
            done((k + 1) / count)
    return found


def _check_format(folder: FilePath, about: dict) -> None:
    if about.get("formingx") != FORMAT:
        raise InputError(f"checkpoint {str(folder)!r} has the format {about.get('formingx')!r}; this version of"
                         f" formingx reads {FORMAT}")


def _check_scene(folder: FilePath, about: dict, scene: dict) -> None:
    _check_format(folder, about)
    if not isinstance(about.get("scene"), dict):
        raise InputError(f"checkpoint {str(folder)!r} is damaged: scene.json does not say what the scene is")
    found = list(differences(about["scene"], json.loads(json.dumps(scene))))
    if found:
        shown = "; ".join(f"{where}: {a!r} there, {b!r} here" for where, a, b in found[:4])
        more = f"; and {len(found) - 4} more" if len(found) > 4 else ""
        raise InputError(f"checkpoint {str(folder)!r} is of another scene: {shown}{more}")


def _read_state(data: dict, problem: Any) -> State:
    data, space = dict(data), problem.forms.space
    last = problem.comm.rank == problem.comm.size - 1
    arrays = {name: np.concatenate([_of_cells(space, data[name]), data[f"{name}_tail"] if last else []])
              for name in _FIELDS}
    met, setting = data.pop("met"), data["setting"]
    data["setting"] = setting and asdict(Setting(**setting))             # older files do without some of it
    return State(**arrays, met=Target(met[0], met[1], None, met[2]) if met else None,
                 history=[Iteration(*row) for row in data.pop("history")],
                 memory=_read_memory(problem, data.pop("memory")),
                 **{f.name: data[f.name] for f in fields(State) if f.name in data and f.name not in _FIELDS})


def _by_cell(space: Any, own: np.ndarray) -> np.ndarray:
    """Values of the cells in the order of the script's mesh, shape (cells, unknowns of one), on rank 0; collective."""
    topology, w = space.mesh.topology, fem.Function(space)
    cells, n = topology.index_map(topology.dim).size_local, space.dofmap.index_map.size_local
    w.x.array[:n] = own[:n]
    w.x.scatter_forward()
    parts = space.mesh.comm.gather((topology.original_cell_index[:cells], w.x.array[space.dofmap.list[:cells]]))
    numbers, values = (np.concatenate(column) for column in zip(*parts or [(np.zeros(0, int), np.zeros((0, 0)))]))
    return values[np.argsort(numbers)]


def _of_cells(space: Any, values: np.ndarray) -> np.ndarray:
    """Locally owned unknowns of cells, of the result of `_by_cell`."""
    numbers = space.mesh.topology.original_cell_index
    found = np.zeros(len(space.dofmap.list) and space.dofmap.list.max() + 1)
    found[space.dofmap.list] = values[numbers[:len(space.dofmap.list)]]
    return found[:space.dofmap.index_map.size_local]


def _tail(space: Any, own: np.ndarray) -> list[float]:
    """Unknowns that belong to no cell: the last rank has them; collective."""
    return space.mesh.comm.allgather(own[space.dofmap.index_map.size_local:].tolist())[-1]


def _plain_state(state: State) -> dict[str, Any]:
    """Everything in a state that JSON can hold as it is."""
    left = (*_FIELDS, "memory", "met", "history")
    data = {f.name: getattr(state, f.name) for f in fields(State) if f.name not in left}
    return data | {"met": state.met and [state.met.name, state.met.value, state.met.signed],
                   "history": [list(i) for i in state.history]}


def _read_memory(problem: Any, memory: list[dict[str, Any]]) -> list[Any]:
    if len(memory) != len(problem.histories):
        raise InputError("checkpoint: its states have other histories (friction, relaxation, heat) than this scene: it"
                         " belongs to another scene")
    return [history.load(data) for history, data in zip(problem.histories, memory, strict=True)]


def _profile(path: Any, state: State) -> dict[str, np.ndarray] | None:
    """Return outline and thickness of a sheet for a report without the scene; None: there is no sheet."""
    try:
        profile = path.profile(state)
    except InputError:
        return None
    return {f.name: getattr(profile, f.name) for f in fields(profile)}


def _name(number: int) -> str:
    return f"{number:04d}"


def _states(folder: FilePath) -> list[FilePath]:
    """Return the complete states in order."""
    names = (entry for entry in folder.iterdir() if entry.name.isascii() and entry.name.isdigit())
    found = sorted(names, key=lambda entry: int(entry.name))
    for k, entry in enumerate(found):
        if int(entry.name) != k:
            raise InputError(f"checkpoint {str(folder)!r} is damaged: state {k} is missing")
    return found


def _read_data(folder: FilePath, number: int, checksums: bool = True) -> dict:
    """Return the data of a state's state.json; raise an InputError unless they are complete and unchanged."""
    state_folder = folder / _name(number)
    data = _read_json(state_folder / "state.json")
    try:
        content = (state_folder / _ARRAYS).read_bytes()
        missing = [f.name for f in fields(State) if f.name not in (*_FIELDS, "memory") and f.name not in data]
        whole = not missing and data.get("number") == number and (
            not checksums or _checksums(data, content) == data.get("checksums"))
        found = unpack(data, content) if whole else data
    except (OSError, ValueError, TypeError):
        whole, found = False, data
    if not whole:
        raise InputError(f"checkpoint {str(state_folder)!r} is damaged: its files are not those that were written"
                         f" (load's state= picks an earlier one)")
    return found


def _read_json(file: FilePath) -> Any:
    try:
        with open(file, encoding="utf-8") as stream:
            found = json.load(stream)
        if not isinstance(found, dict):
            raise ValueError("it holds no table")
        return found
    except FileNotFoundError:
        raise InputError(f"checkpoint: {_instead(file)}") from None
    except NotADirectoryError:
        raise InputError(f"checkpoint: {str(file.parent)!r} is not a folder") from None
    except (ValueError, OSError, RecursionError) as error:
        raise InputError(f"checkpoint: {str(file)!r} is damaged or cannot be read: {error}") from None


def _instead(file: FilePath) -> str:
    """Return a text on the files found in place of a missing one."""
    folder = file.parent
    if file.name != "scene.json":
        return f"{str(file)!r} is not there"
    if not folder.exists():
        return f"there is no folder {str(folder)!r}"
    if not any(folder.iterdir()):
        return f"the folder {str(folder)!r} is empty"
    if (folder / "study.json").exists():
        return (f"{str(folder)!r} is the folder of a study: it keeps numbers of runs, not their states; the same"
                f" fx.study(..., folder=...) reads them, and its report() shows them")
    inside = sorted(entry.parent.name for entry in folder.glob("*/scene.json"))
    return f"{str(folder)!r} holds no run" + (f", but folders that do: {', '.join(inside[:5])}"
                                              f"{', ...' * (len(inside) > 5)}" if inside else "")


def _checksums(data: dict, content: bytes) -> dict[str, int]:
    """{file: CRC-32} of the data of state.json and of the arrays of a state."""
    rest = {key: value for key, value in data.items() if key != "checksums"}
    return {"state.json": zlib.crc32(json.dumps(rest, sort_keys=True).encode()), _ARRAYS: zlib.crc32(content)}


def _plainly(action: Callable[[], Any], folder: FilePath, what: str) -> Any:
    """Return the action's result; its OSError says which checkpoint and what."""
    try:
        return action()
    except OSError as error:
        raise OSError(error.errno, f"checkpoint {str(folder)!r}: {what}: {error.strerror}") from None
