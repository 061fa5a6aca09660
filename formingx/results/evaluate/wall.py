"""Wall thickness of a formed part from the axis to the rim, as a table."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from ... import _compat
from ...errors import InputError, finite
from ...forms.probes import probe
from ...mesh.nodes import cell_node_positions, facet_node_positions
from ...ranks import gathered
from ..files.column_table import ColumnTable
from .profile import Profile, distance_to_line


@dataclass(frozen=True, repr=False)
class Wall(ColumnTable):
    """Wall of a sheet in one state, at the n nodes of the bottom (inner) face from the axis to the rim.

    Attributes:
        profile: reference and deformed positions of opposite points on both faces.
        layers: {name of a layer: its fraction of the wall, 0 to 1, shape (n,)}, from the bottom up. The fractions are
            measured along the material line from a bottom point to the opposite top point.
        comm: MPI communicator of the run.
    """

    profile: Profile
    layers: Mapping[str, np.ndarray]
    comm: Any

    @property
    def reference_radius(self) -> np.ndarray:
        """Reference radius R of the nodes, shape (n,), length."""
        return self.profile.reference_radius

    @property
    def arc_length(self) -> np.ndarray:
        """Arc length of the deformed middle line from the axis to each point, shape (n,), length."""
        return self.profile.arc_length

    @property
    def r(self) -> np.ndarray:
        """Deformed radius r of the points on the middle line, shape (n,), length."""
        return self.profile.middle[:, 0]

    @property
    def z(self) -> np.ndarray:
        """Deformed coordinate z of the points on the middle line, shape (n,), length."""
        return self.profile.middle[:, 1]

    @property
    def height(self) -> np.ndarray:
        """Axial distance of the middle line from the pole, never negative, shape (n,), length.

        Without a pole it is the distance from the lowest point of the middle line.
        """
        return np.abs(self.z - self.z[0]) if abs(self.r[0]) <= 1e-9 * np.ptp(self.r) else self.z - self.z.min()

    @cached_property
    def wall(self) -> np.ndarray:
        """Wall thickness: shortest distance from each bottom point to the top face, shape (n,), length."""
        return self.profile.wall_thickness

    @property
    def ratio(self) -> np.ndarray:
        """Wall over original thickness, shape (n,)."""
        return self.wall / self.profile.original_thickness

    @property
    def columns(self) -> dict[str, np.ndarray]:
        """Columns of the table of n nodes, {name: values, shape (n,)}.

        Their names are reference_radius, arc_length, r, z, height, wall, wall_ratio (wall over original thickness), and
        with several layers `wall_of_NAME` for each layer.
        """
        each = {f"wall_of_{name}": share * self.wall for name, share in self.layers.items()}
        return {"reference_radius": self.reference_radius, "arc_length": self.arc_length, "r": self.r, "z": self.z,
                "height": self.height, "wall": self.wall, "wall_ratio": self.ratio, **(each if len(each) > 1 else {})}

    def at_height(self, height: float) -> float:
        """Return the wall thickness at a height, interpolated linearly between nodes, length.

        If the middle line passes the height several times, the smallest thickness is returned.

        Args:
            height: height of the middle line (`Wall.height`), length.

        Raises:
            InputError: the middle line does not reach the height.
        """
        height, h = finite("at_height: height", height), self.height
        k = np.flatnonzero((h[:-1] - height) * (h[1:] - height) <= 0)
        if not len(k):
            raise InputError(f"at_height: height = {height:g}: the part goes from {h.min():.6g} to {h.max():.6g}")
        step = h[k + 1] - h[k]
        part = np.divide(height - h[k], step, out=np.zeros(len(k)), where=step != 0)
        return float(np.min((1 - part) * self.wall[k] + part * self.wall[k + 1]))


class Walls:
    """Computes the `Wall` of the states of a path."""

    def __init__(self, path: Any):
        self._path = path
        self._lines: tuple[list[str], Any] | None = None

    def evaluate(self, state: Any) -> Wall:
        """Return the wall in a state; no sheet, or layers not above each other, are an InputError; collective."""
        path, profile = self._path, self._path.profile(state)
        names = list(path.problem.scene.mesh.layers)
        shares = {names[0]: np.ones(len(profile.bottom))}
        if len(names) > 1:
            if self._lines is None:
                names, between = between_layers(path.problem.scene.mesh, profile)
                self._lines = names, probe(path.problem, between.reshape(-1, between.shape[-1]))
            names, material_lines = self._lines
            with path.problem.state_context(state) as problem:
                deformed = material_lines.points + material_lines.displacement(problem.x)
            lines = [profile.bottom, *deformed.reshape(len(names) - 1, -1, deformed.shape[-1]), profile.top]
            lengths = np.array([np.hypot(*(b - a).T) for a, b in zip(lines, lines[1:])])
            shares = dict(zip(names, lengths / lengths.sum(0), strict=True))
        return Wall(profile, shares, path.problem.comm)


def between_layers(mesh: Any, profile: Profile) -> tuple[list[str], np.ndarray]:
    """Return the k + 1 layers from the bottom up, and the points between them on n lines across, (k, n, 2), length.

    Reference lines go from the bottom points of the profile to the opposite top points. Layers that do not lie above
    each other are an InputError.
    """
    if len(mesh.layers) == 1:
        return list(mesh.layers), np.zeros((0, *profile.reference_bottom.shape))
    edges = _interfaces(mesh)
    direction = profile.reference_top - profile.reference_bottom
    found = {pair: _crossing(profile.reference_bottom, direction, lines) for pair, lines in edges.items()}
    missing = [pair for pair, part in found.items() if not np.all(np.isfinite(part))]
    if missing or len(found) != len(mesh.layers) - 1:
        raise InputError(f"wall: the layers {', '.join(map(repr, mesh.layers))} do not lie one upon another from the"
                         f" axis to the rim")
    order = sorted(found, key=lambda pair: found[pair].mean())
    first = next(iter(set(order[0]) - set(order[1]))) if len(order) > 1 else min(
        order[0], key=lambda name: _middle_of(mesh, name, profile))
    names = [first]
    for pair in order:
        names.append(next(name for name in pair if name != names[-1]))
    return names, np.array([profile.reference_bottom + found[pair][:, None] * direction for pair in order])


def _interfaces(mesh: Any) -> dict[tuple[str, ...], np.ndarray]:
    """Return {layers: straight pieces of their interface (m, 2, 2), length} on all ranks; collective."""
    domain, topology = mesh.domain, mesh.domain.topology
    topology.create_connectivity(1, 2)
    layer = np.full(len(_compat.cell_nodes(domain)), -1)
    names = list(mesh.layers)
    for k, tag in enumerate(mesh.layers.values()):
        layer[mesh.cells.find(tag)] = k
    of_facet = topology.connectivity(1, 2)
    pairs: dict[tuple[int, ...], list[int]] = {}
    for facet in range(topology.index_map(1).size_local):
        cells = of_facet.links(facet)
        if len(cells) == 2 and layer[cells[0]] != layer[cells[1]]:
            pairs.setdefault(tuple(sorted(layer[cells].tolist())), []).append(facet)
    found = {}
    for pair in sorted(set().union(*mesh.comm.allgather(set(pairs)))):
        points = gathered(mesh.comm, facet_node_positions(domain, np.array(pairs.get(pair, []), dtype=np.int32)))
        chain = [0, 2, 1] if points.shape[1] == 3 else [0, 1]
        found[tuple(names[k] for k in pair)] = np.concatenate([points[:, [a, b]] for a, b in zip(chain, chain[1:])])
    return found


def _crossing(start: np.ndarray, direction: np.ndarray, pieces: np.ndarray) -> np.ndarray:
    """Return s, 0 to 1, where start + s direction, (n, 2), first meets pieces (m, 2, 2), (n,); nan for none."""
    a, edge = pieces[:, 0], pieces[:, 1] - pieces[:, 0]
    from_start = a - start[:, None]
    det = direction[:, None, 0] * edge[:, 1] - direction[:, None, 1] * edge[:, 0]
    with np.errstate(divide="ignore", invalid="ignore"):
        s = (from_start[..., 0] * edge[:, 1] - from_start[..., 1] * edge[:, 0]) / det
        t = (from_start[..., 0] * direction[:, None, 1] - from_start[..., 1] * direction[:, None, 0]) / det
    tolerance = 1e-6
    s = np.where((t >= -tolerance) & (t <= 1 + tolerance) & (s >= -tolerance) & (s <= 1 + tolerance), s, np.inf).min(1)
    return np.where(np.isfinite(s), s, np.nan)


def _middle_of(mesh: Any, layer: str, profile: Profile) -> float:
    """Return the mean distance of a layer's nodes from the bottom face in the reference configuration, length."""
    cells = mesh.cells.find(mesh.layers[layer])
    points = gathered(mesh.comm, cell_node_positions(mesh.domain, cells))
    return float(distance_to_line(points.reshape(-1, points.shape[-1]), profile.reference_bottom).mean())
