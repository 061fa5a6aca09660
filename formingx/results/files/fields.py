"""Fields of states on the whole body, as VTK's XML files for ParaView. Rank 0 writes.

Every triangle has six nodes of its own, so nothing is averaged over an interface. The fields are:

    displacement            (u_r, u_z), in three dimensions (u_x, u_y, u_z), length.
    stretches               larger and smaller stretch in the section, hoop stretch (`Stress.principal_stretches`).
    principal_stresses      principal Cauchy stresses in descending order, stress.
    cauchy_rr, _zz, _rz, _hoop  components of the Cauchy stress, stress.
    hydrostatic_pressure    minus a third of the trace of the Cauchy stress, stress.
    stress_error            estimated error of the stress, constant in each triangle (`StressError.mean`), stress.
    elastic_stretch_1, _2   larger principal stretch of the elastic part of F in each relaxing branch, see below.
    contact_pressure        normal traction per deformed area of all tools, stress.
    thickness, thickness_ratio  thickness of the sheet at each point, length, and its ratio to the original thickness.
    temperature_bottom, _middle, _top  temperatures of a sheet in three dimensions that conducts heat.

F is the deformation gradient, Cv or A the internal variable of a branch (`Viscoelastic`, `TransientNetwork`). The
square of the elastic stretch is the larger eigenvalue of F Cv^-1 F^T or F A F^T in the section, without volume change.
The elastic stretch is 1 if the branch has relaxed, and the largest stretch if it has not relaxed at all. It is linear
in each triangle, and nan in layers without such a branch.

The contact pressure is less accurate at the two nodes nearest the axis, which share their areas. A membrane in a
section has displacement and thickness only. A sheet in three dimensions has these, the temperatures, and two principal
stresses in its surface, the means over its thickness, constant in each triangle.
"""

from functools import partial
from typing import Any
from xml.sax.saxutils import quoteattr

import numpy as np
import ufl

from ... import _compat, figures
from ...errors import InputError
from ...measures.relaxed import ElasticStretches
from ...mesh.nodes import nearest, own_cells
from ...solve.state import State
from .. import files
from ..evaluate.contact_face import ContactFace

_NODES = {1: np.array([[0.0], [1.0], [0.5]]), 2: np.array([[0, 0], [1, 0], [0, 1], [0.5, 0], [0.5, 0.5], [0, 0.5]])}
"""{dimension of the elements: positions of the nodes in the reference cell, in the order of VTK}."""


class Fields:
    """Computes fields such as displacement and stress, at the nodes of the cells that this rank owns.

    Each cell has six nodes of its own: its corners, and the middles of its edges. A membrane in a section has three.

    Attributes:
        points: reference positions of the nodes of each cell, shape (cells, nodes, components), length.
        dimension: dimension of the elements: 1 for an axisymmetric membrane, else 2.
    """

    def __init__(self, path: Any):
        self._path, self._problem = path, path.problem
        forms, domain = self._problem.forms, self._problem.forms.domain
        self.dimension = domain.topology.dim
        self._cells = own_cells(domain)
        self._components = domain.geometry.dim
        self._where, self._u = (_compat.compile_expression(ufl.as_vector([v[i] for i in range(self._components)]),
                                                            _NODES[self.dimension]) for v in (forms.X, forms.u))
        if self._components == 3:
            ratio, reference = forms.F[2, 2], sum(forms.thicknesses.values())
            self._wall = _compat.compile_expression(ufl.as_vector([reference * ratio, ratio, 0.0]), _NODES[2])
        self.points = self._eval(self._where)
        self._elastic = ElasticStretches(self._problem, _NODES[self.dimension])
        self._between: tuple[np.ndarray, np.ndarray] | None = None
        self._faces: dict[int, tuple[ContactFace, np.ndarray, np.ndarray]] = {}

    def evaluate(self, state: Any) -> dict[str, np.ndarray]:
        """Return {field: values at the nodes of each cell, (cells, nodes, components)} of a state; collective."""
        problem, shape = self._problem, self.points.shape[:2]
        with problem.state_context(state):
            found = {"displacement": self._eval(self._u)}
        if self._components == 3:
            with problem.state_context(state):
                h = self._eval(self._wall)
            found |= {"thickness": h[..., 0], "thickness_ratio": h[..., 1]}
            found |= problem.scene.kinematics.reader(self._path).fields(state, _NODES[2])
        elif self.dimension == 2:
            field = self._path.stress(state)
            stress = field.in_cells(_NODES[2])
            sigma = stress.cauchy
            found |= {"stretches": stress.principal_stretches, "principal_stresses": stress.principal_stresses,
                      "cauchy_rr": sigma[:, 0, 0], "cauchy_zz": sigma[:, 1, 1], "cauchy_rz": sigma[:, 0, 1],
                      "cauchy_hoop": sigma[:, 2, 2], "hydrostatic_pressure": stress.hydrostatic_pressure,
                      "stress_error": np.repeat(field.error_in_cells(), len(_NODES[2]))}
            with problem.state_context(state):
                elastic = self._elastic.evaluate(len(self._cells))
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
                self._between = _position_across(points, profile.reference_bottom, profile.reference_top)
            k, part = self._between
            for name, values in (("thickness", profile.thickness), ("thickness_ratio", profile.thickness_ratio)):
                found[name] = (1 - part) * values[k] + part * values[k + 1]
        return {name: np.asarray(values).reshape(*shape, -1) for name, values in found.items()}

    def _eval(self, expression: Any) -> np.ndarray:
        """Return the values of a compiled vector expression at the nodes of cells, shape (cells, nodes, components)."""
        if not len(self._cells):
            return np.zeros((0, len(_NODES[self.dimension]), self._components))
        return expression.eval(self._problem.forms.domain, self._cells).reshape(len(self._cells), -1, self._components)

    def _contact_pressure(self, state: Any) -> np.ndarray:
        """Return pressure at the nodes of cells, (cells, nodes), stress, 0 away from tools; collective."""
        pressure = np.zeros(self.points.shape[:2])
        for k, contact in enumerate(self._problem.contacts):
            if k not in self._faces:
                face = ContactFace(self._path, contact)
                distance, numbers = nearest(face.nodes, self.points.reshape(-1, self.points.shape[-1]))
                self._faces[k] = face, face.nearest[numbers], distance < 1e-9 * self._problem.forms.length
            face, numbers, on_face = self._faces[k]
            pressure += np.where(on_face, face.evaluate(state).pressure[numbers], 0.0).reshape(pressure.shape)
        return pressure


def to_vtk(path: Any, file: Any, states: Any = None) -> None:
    """Write fields of states as VTU files, NAME-3.vtu for state 3, and a PVD file (`Path.to_vtk`).

    `states`: one, a sequence, "all", None: the last. Wrong types are an InputError, a failed file an OSError.
    """
    file, comm = files.named("to_vtk", file, ".pvd"), path.problem.comm
    meshes: dict[int, tuple[Fields, Any]] = {}              # fields, and points of all ranks
    steps = []

    def write(target: Any, text: str) -> None:
        files.replace(target, lambda stream: stream.write(text))

    for number, state in _chosen(path, states):
        key = id(path.record.segment(state).problem)
        if key not in meshes:
            fields = Fields(path._same_mesh(state))
            meshes[key] = fields, _gather(fields.points, comm)
        fields, points = meshes[key]
        values = {name: _gather(v, comm) for name, v in fields.evaluate(state).items()}
        piece = file.with_name(f"{file.stem}-{number}.vtu")
        text = _as_vtu(points, values) if comm.rank == 0 else ""
        files.on_root(comm, partial(write, piece, text))
        steps.append(f'<DataSet timestep="{number}" file={quoteattr(piece.name)}/>')
    listed = ['<VTKFile type="Collection" version="0.1">', "<Collection>", *steps, "</Collection>", "</VTKFile>", ""]
    files.on_root(comm, partial(write, file, "\n".join(listed)))


def _as_vtu(points: np.ndarray, values: dict[str, np.ndarray]) -> str:
    """Return the text of a VTU file of points and named values, both (cells, nodes, components)."""
    pyvista = figures.pyvista()
    from vtkmodules.vtkIOXML import vtkXMLUnstructuredGridWriter
    cells, nodes = points.shape[:2]
    kind = {3: pyvista.CellType.QUADRATIC_EDGE, 6: pyvista.CellType.QUADRATIC_TRIANGLE}[nodes]
    grid = pyvista.UnstructuredGrid({kind: np.arange(cells * nodes).reshape(cells, nodes)}, _three(points))
    for name, array in values.items():
        grid.point_data[name] = _three(array) if name == "displacement" else array.reshape(cells * nodes, -1)
    writer = vtkXMLUnstructuredGridWriter()
    writer.SetInputData(grid)
    writer.SetDataModeToBinary()
    writer.WriteToOutputStringOn()
    writer.Write()
    return writer.GetOutputString()


def _three(array: np.ndarray) -> np.ndarray:
    """Return the vectors of an array, shape (..., c), as rows of three components, shape (n, 3), filled with 0."""
    rows = array.reshape(-1, array.shape[-1])
    return np.pad(rows, ((0, 0), (0, 3 - rows.shape[1])))


def _chosen(path: Any, states: Any) -> list[tuple[int, Any]]:
    """Return (number, state) of the states to be written: one, a sequence, "all", or None for the last.

    The number is that in the path, of `Path.state_at` its position; unless they increase, they count from 0.
    """
    if isinstance(states, str):
        if states != "all":
            raise InputError(f"states = {states!r}: must be states of the path, or 'all'")
        states = path.states
    states = [path.last] if states is None else [states] if isinstance(states, State) else list(states)
    if not states or not all(isinstance(state, State) for state in states):
        raise InputError(f"states = {states!r}: must be one or more states of the path, or 'all'")
    numbers = {id(state): k for k, state in enumerate(path.states)}
    found = [numbers.get(id(state), k) for k, state in enumerate(states)]
    if any(b <= a for a, b in zip(found, found[1:])):
        found = list(range(len(states)))
    return list(zip(found, states))


def _gather(values: np.ndarray, comm: Any) -> Any:
    """Return the arrays of all ranks joined along their first axis on rank 0, and None on other ranks; collective."""
    parts = comm.gather(values, root=0)
    return np.concatenate(parts) if parts else None


def _position_across(points: np.ndarray, bottom: np.ndarray, top: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return k, (m,), of the line before each point on a sheet, and its position from line k (0) to k + 1 (1).

    Lines go from bottom points to opposite top points, (n, 2) each, in order; points have shape (m, 2), length.
    """
    k, part = np.zeros(len(points), dtype=int), np.zeros(len(points))
    across = top - bottom
    for i, x in enumerate(points):
        side = across[:, 0] * (x - bottom)[:, 1] - across[:, 1] * (x - bottom)[:, 0]
        s = np.clip(((x - bottom) * across).sum(1) / (across**2).sum(1), 0, 1)
        distance = np.hypot(*(bottom + s[:, None] * across - x).T)
        between = np.flatnonzero(side[:-1] * side[1:] <= 0)
        if not len(between):                                    # beyond the first line, or the last
            k[i], part[i] = (0, 0.0) if np.argmin(distance) == 0 else (max(np.argmin(distance) - 1, 0), 1.0)
            continue
        k[i] = between[np.argmin(distance[between] + distance[between + 1])]
        a, b = distance[k[i]], distance[k[i] + 1]
        part[i] = a / (a + b) if a + b > 0 else 0.0
    return k, part
