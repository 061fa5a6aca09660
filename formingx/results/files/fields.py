"""Fields of states on the whole body, for ParaView: VTX (through ADIOS2) or XDMF.

Every triangle gets six nodes of its own, so that nothing is smeared over an interface. The fields:

    displacement            (u_r, u_z), in three dimensions (u_x, u_y, u_z), length
    stretches               the larger and the smaller in the plane, and the hoop stretch (`Stress.principal_stretches`)
    principal_stresses      of the Cauchy stress, from the largest to the smallest, stress
    cauchy_rr, _zz, _rz, _hoop  its components; hydrostatic_pressure: minus a third of its trace, stress
    stress_error            its estimated error, one value in each triangle (`StressError.mean`), stress
    elastic_stretch_1, _2   of each relaxing branch: the larger root of the eigenvalues of F Cv^-1 F^T (F A F^T of a
                            `TransientNetwork`), without change of volume: 1 when it has relaxed, the largest stretch
                            when nothing has; linear in each triangle; nan in layers without such a branch
    contact_pressure        normal traction per deformed area at the face, stress, of all tools; where there are any
                            (the first two nodes from the axis share their areas: there it is less accurate)
    thickness, thickness_ratio  of the sheet there, where the mesh has two faces that face each other

A membrane has displacement and thickness only. Rank 0 writes.
"""

import os
import shutil
from collections.abc import Callable
from pathlib import Path as FilePath
from typing import Any
from xml.etree import ElementTree

import basix.ufl
import numpy as np
import ufl
from dolfinx import fem, has_adios2, io
from dolfinx import mesh as dolfinx_mesh
from mpi4py import MPI

from ... import _compat
from ...errors import InputError
from ...measures.relaxed import ElasticStretches
from ...mesh.nodes import own_cells
from .. import files
from ..evaluate.contact_face import ContactFace

_NODES = {1: np.array([[0.0], [1.0], [0.5]]), 2: np.array([[0, 0], [1, 0], [0, 1], [0.5, 0.5], [0, 0.5], [0.5, 0]])}
"""Places of the nodes in the reference cell, in DOLFINx order, by dimension."""


class Fields:
    """Evaluates the fields of a path's states at the nodes of all cells.

    Attributes:
        points: reference positions of the nodes of this rank's cells, shape (cells, nodes, components), length.
    """

    def __init__(self, path: Any):
        self._path, self._problem = path, path.problem
        forms, domain = self._problem.forms, self._problem.forms.domain
        self.dimension = domain.topology.dim
        self._cells = own_cells(domain)
        self._components = domain.geometry.dim
        self._where, self._u = (_compat.compile_expression(ufl.as_vector([v[i] for i in range(self._components)]),
                                                            _NODES[self.dimension]) for v in (forms.X, forms.u))
        self.points = self._eval(self._where)
        self._elastic = ElasticStretches(self._problem, _NODES[self.dimension])
        self._between: tuple[np.ndarray, np.ndarray] | None = None
        self._faces: dict[int, tuple[ContactFace, np.ndarray, np.ndarray]] = {}

    def of(self, state: Any) -> dict[str, np.ndarray]:
        """{name: values, shape (cells, nodes, components)} of a state; collective."""
        problem, forms, shape = self._problem, self._problem.forms, self.points.shape[:2]
        with problem.state_context(state):
            found = {"displacement": self._eval(self._u)}
        if self._components == 3:
            ratio, rest = forms.F[2, 2], sum(forms.thicknesses.values())
            wall = _compat.compile_expression(ufl.as_vector([rest * ratio, ratio, 0.0]), _NODES[2])
            with problem.state_context(state):
                h = self._eval(wall)
            found |= {"thickness": h[..., 0], "thickness_ratio": h[..., 1]}
        elif self.dimension == 2:
            field = self._path.stress(state)
            stress = field.in_cells(_NODES[2])
            sigma = stress.cauchy
            found |= {"stretches": stress.principal_stretches, "principal_stresses": stress.principal_stresses,
                      "cauchy_rr": sigma[:, 0, 0], "cauchy_zz": sigma[:, 1, 1], "cauchy_rz": sigma[:, 0, 1],
                      "cauchy_hoop": sigma[:, 2, 2], "hydrostatic_pressure": stress.hydrostatic_pressure,
                      "stress_error": np.repeat(field.error_in_cells(), len(_NODES[2]))}
            with problem.state_context(state):
                elastic = self._elastic.now(len(self._cells))
            found |= {f"elastic_stretch_{k + 1}": elastic[..., k] for k in range(self._elastic.count)}
            if problem.contacts:
                found["contact_pressure"] = self._contact_pressure(state)
        try:
            profile = self._path.profile(state)
        except InputError:
            profile = None                                  # not a sheet
        if profile is not None:
            if self._between is None:  # a point stays on its line across the sheet
                points = self.points.reshape(-1, self.points.shape[-1])
                self._between = _across(points, profile.rest_bottom, profile.rest_top)
            k, part = self._between
            for name, values in (("thickness", profile.thickness), ("thickness_ratio", profile.thickness_ratio)):
                found[name] = (1 - part) * values[k] + part * values[k + 1]
        return {name: np.asarray(values).reshape(*shape, -1) for name, values in found.items()}

    def _eval(self, expression: Any) -> np.ndarray:
        if not len(self._cells):
            return np.zeros((0, len(_NODES[self.dimension]), self._components))
        return expression.eval(self._problem.forms.domain, self._cells).reshape(len(self._cells), -1, self._components)

    def _contact_pressure(self, state: Any) -> np.ndarray:
        """Return the normal traction per deformed area at the faces that tools meet, zero elsewhere, shape (cells,
        nodes)."""
        from scipy.spatial import cKDTree
        pressure = np.zeros(self.points.shape[:2])
        for k, contact in enumerate(self._problem.contacts):
            if k not in self._faces:
                face = ContactFace(self._path, contact)
                away, at = cKDTree(face.nodes).query(self.points.reshape(-1, self.points.shape[-1]))
                self._faces[k] = face, face.nearest[at], away < 1e-9 * self._problem.forms.length
            face, at, there = self._faces[k]
            pressure += np.where(there, face.of(state).pressure[at], 0.0).reshape(pressure.shape)
        return pressure


def to_vtx(path: Any, folder: Any, states: Any = None) -> None:
    """Write a VTX folder (name ends in .bp): P2 fields on P2 triangles, time is the number of the state.

    Raises:
        InputError: this DOLFINx has no ADIOS2, the name does not end in .bp, or a state is not of the path.
    """
    if not has_adios2:
        raise InputError("to_vtx: this DOLFINx was built without ADIOS2: use to_xdmf")
    _write(path, folder, states, ".bp", _vtx)


def to_xdmf(path: Any, file: Any, states: Any = None) -> None:
    """Write an XDMF file (name ends in .xdmf) and its HDF5 file beside it; else as `to_vtx`."""
    _write(path, file, states, ".xdmf", _xdmf)


def _write(path: Any, file: Any, states: Any, suffix: str, write: Callable) -> None:
    file, comm = files.named("to_vtx" if suffix == ".bp" else "to_xdmf", file, suffix), path.problem.comm
    chosen = _chosen(path, states)
    if len({id(path.segment(state)) for _, state in chosen}) > 1:
        raise InputError(f"{'to_vtx' if suffix == '.bp' else 'to_xdmf'}: states: the run was remeshed, and a file"
                         f" holds one mesh: give states of one, such as path.segments[0].states")
    fields = Fields(path.alone(chosen[0][1]))
    points = _gather(fields.points, comm)
    steps = []
    for number, state in chosen:
        values = fields.of(state)
        steps.append((float(number), {name: _gather(v, comm) for name, v in values.items()}))

    def write_all():
        for target in (file, file.with_suffix(".h5")) if suffix == ".xdmf" else (file,):
            _check_replaceable(target)
        size = 2**17 + sum(8 * (array.size + points.size) for _, values in steps for array in values.values())
        part = file.with_name(f"part-{file.name}")
        try:
            file.parent.mkdir(parents=True, exist_ok=True)
            files.reserve(part, size)
            write(part, file, _Body(points, fields.dimension), steps)
        except OSError as error:
            _remove(part)
            raise OSError(error.errno, f"{str(file)!r} could not be written: {error.strerror}") from None
        except RuntimeError as error:                       # errors of the libraries, such as a full disk
            _remove(part)
            raise OSError(f"{str(file)!r} could not be written: {error}") from None
    files.on_root(comm, write_all)


def _chosen(path: Any, states: Any) -> list[tuple[int, Any]]:
    """Return [(number, state)]; a state that is not on the path (of `Path.at`) gets the next number."""
    if isinstance(states, str):
        if states != "all":
            raise InputError(f"states = {states!r}: must be states of the path, or 'all'")
        states = path.states
    states = [path.last] if states is None else [states] if hasattr(states, "control") else list(states)
    if not states or not all(hasattr(state, "control") for state in states):
        raise InputError(f"states = {states!r}: must be one or more states of the path, or 'all'")
    numbers = {id(state): k for k, state in enumerate(path.states)}
    found = [numbers.get(id(state), k) for k, state in enumerate(states)]
    if any(b <= a for a, b in zip(found, found[1:])):
        found = list(range(len(states)))
    return list(zip(found, states))


class _Body:
    """A mesh on this rank alone in which no two cells share a node, and functions on it."""

    def __init__(self, points: np.ndarray, dimension: int):
        cells, nodes = points.shape[:2]
        shape = {1: "interval", 2: "triangle"}[dimension]
        element = basix.ufl.element("Lagrange", shape, 2, shape=points.shape[2:])
        self.mesh = dolfinx_mesh.create_mesh(
            MPI.COMM_SELF, cells=np.arange(cells * nodes, dtype=np.int64).reshape(cells, nodes),
            x=points.reshape(-1, points.shape[2]), e=element)
        self._order = self.mesh.topology.original_cell_index
        self._spaces: dict[int, fem.FunctionSpace] = {}
        self._functions: dict[str, fem.Function] = {}

    def functions(self, values: dict[str, np.ndarray]) -> list[fem.Function]:
        """P2 functions with these values, shape (cells, nodes, components) each."""
        for name, array in values.items():
            n = array.shape[-1]
            if n not in self._spaces:
                shape: dict[str, Any] = {} if n == 1 else {"shape": (n,)}
                element = basix.ufl.element("Lagrange", self.mesh.topology.cell_name(), 2, **shape)
                self._spaces[n] = fem.functionspace(self.mesh, element)
            if name not in self._functions:
                self._functions[name] = fem.Function(self._spaces[n], name=name)
            f = self._functions[name]
            f.x.array.reshape(-1, n)[f.function_space.dofmap.list] = array[self._order]
        return [self._functions[name] for name in values]


def _vtx(part: FilePath, file: FilePath, body: _Body, steps: list) -> None:
    _remove(part)
    with io.VTXWriter(MPI.COMM_SELF, part, body.functions(steps[0][1]), engine="BP4") as writer:
        for time, values in steps:
            body.functions(values)
            writer.write(time)
    _remove(file)
    os.rename(part, file)


def _xdmf(part: FilePath, file: FilePath, body: _Body, steps: list) -> None:
    data = part.with_suffix(".h5")
    with io.XDMFFile(MPI.COMM_SELF, part, "w") as writer:
        writer.write_mesh(body.mesh)
        for time, values in steps:
            for function in body.functions(values):
                writer.write_function(function, time)
    text = _together(part.read_text()).replace(data.name, file.with_suffix(".h5").name)
    os.replace(data, file.with_suffix(".h5"))
    part.unlink()
    files.replace(file, lambda stream: stream.write(text))


def _check_replaceable(file: FilePath) -> None:
    """Raise an InputError unless there is nothing of this name, a regular file, or a folder that an earlier run
    wrote."""
    ours = file.suffix.lower() == ".bp" and file.is_dir() and (not any(file.iterdir()) or (file / "md.idx").exists())
    if file.is_symlink() or file.exists() and not (file.is_file() or ours):
        raise InputError(f"file {str(file)!r} is there already, a link, a device or a folder of something else: give"
                         f" another name, or remove it")


def _together(text: str) -> str:
    """XDMF with one grid to a time step that holds all functions; DOLFINx gives each function its own."""
    root = ElementTree.fromstring(text)
    domain = root[0]
    first, *others = [grid for grid in domain if grid.get("GridType") == "Collection"]
    first.set("Name", "states")
    for other in others:
        for step, theirs in zip(first, other, strict=True):
            step.extend(theirs.findall("Attribute"))
        domain.remove(other)
    return '<?xml version="1.0"?>\n' + ElementTree.tostring(root, encoding="unicode")


def _remove(file: FilePath) -> None:
    if file.is_dir():
        shutil.rmtree(file)
    else:
        file.unlink(missing_ok=True)


def _gather(values: np.ndarray, comm: Any) -> Any:
    parts = comm.gather(values, root=0)
    return np.concatenate(parts) if parts else None


def _across(points: np.ndarray, bottom: np.ndarray, top: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Between which lines from bottom to top, k and k + 1, points (m, 2) are, and how far, 0 to 1: shape (m,) each."""
    k, part = np.zeros(len(points), dtype=int), np.zeros(len(points))
    along = top - bottom
    for i, x in enumerate(points):
        side = along[:, 0] * (x - bottom)[:, 1] - along[:, 1] * (x - bottom)[:, 0]
        s = np.clip(((x - bottom) * along).sum(1) / (along**2).sum(1), 0, 1)
        away = np.hypot(*(bottom + s[:, None] * along - x).T)
        between = np.flatnonzero(side[:-1] * side[1:] <= 0)
        if not len(between):                                    # beyond the first line, or the last
            k[i], part[i] = (0, 0.0) if np.argmin(away) == 0 else (max(np.argmin(away) - 1, 0), 1.0)
            continue
        k[i] = between[np.argmin(away[between] + away[between + 1])]
        a, b = away[k[i]], away[k[i] + 1]
        part[i] = a / (a + b) if a + b > 0 else 0.0
    return k, part
