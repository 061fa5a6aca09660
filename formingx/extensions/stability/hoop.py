"""Hoop stress resultants of a sheet; it may wrinkle where they are compressive."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from ...errors import InputError
from ...physics.models import Membrane
from ...results.evaluate.tension import Tension
from ...results.evaluate.wall import between_layers
from ...results.extend import method_of
from ...results.files.column_table import ColumnTable
from ...results.path import Path
from ...results.reader import section_only


@dataclass(frozen=True, repr=False)
class HoopResultants(ColumnTable):
    """Hoop stress resultants of a sheet in one state, at n points of its middle line from the axis to the rim.

    A negative resultant is necessary for wrinkles, not sufficient: a thick sheet may stay stable (`Path.stability`). A
    membrane, which has no bending stiffness, wrinkles there.

    Attributes:
        points: reference positions (R, Z) of the points, shape (n, 2), length: the middles of the elements of a solid,
            the quadrature points of a membrane.
        resultant: hoop component of the first Piola-Kirchhoff stress P, integrated through the reference thickness,
            shape (n,), force per reference length of the middle line.
        comm: MPI communicator of the run.
    """

    points: np.ndarray
    resultant: np.ndarray
    comm: Any

    @property
    def compressed(self) -> np.ndarray:
        """Mask of the points with a negative hoop stress resultant (compression), shape (n,)."""
        return self.resultant < 0

    @property
    def minimum(self) -> tuple[float, float]:
        """Smallest resultant, force/length, and the reference radius of its point, length."""
        k = int(np.argmin(self.resultant))
        return float(self.resultant[k]), float(self.points[k, 0])

    @property
    def columns(self) -> dict[str, np.ndarray]:
        return {"reference_radius": self.points[:, 0], "Z": self.points[:, 1], "hoop_resultant": self.resultant}


@method_of(Path)
def hoop_resultants(path: Path, state: Any = None) -> HoopResultants:
    r"""Compute the hoop stress resultants along a sheet; negative ones may cause wrinkles. Collective.

    .. math:: N = \int P_{\theta\theta} \, dH

    with the first Piola-Kirchhoff stress P and the reference thickness H.

    Args:
        path: the path of an axisymmetric solid or membrane.
        state: a state of the path; default the last.

    Returns:
        The resultants at points of the middle line.

    Raises:
        InputError: plane strain, a sheet in three dimensions, or a mesh that is no sheet.
    """
    section_only(path.scene, "hoop_resultants", "use path.wall().wrinkled")
    state = state or path.last
    problem = path.record.segment(state).problem
    scene = problem.scene
    if not scene.kinematics.axisymmetric:
        raise InputError("hoop_resultants: in plane strain nothing goes round an axis")
    if isinstance(scene.model, Membrane):
        return HoopResultants(*Tension(problem).hoop(state), problem.comm)
    profile = path.profile(state)
    (names, between), bottom, top = between_layers(scene.mesh, profile), profile.reference_bottom, profile.reference_top
    lines = np.array([bottom, *between, top])[:, 1::2]              # mid-edge nodes: corners of the rim are singular
    gauss, weights = np.polynomial.legendre.leggauss(scene.quadrature_degree // 2 + 2)
    stress, resultant = path.stress(state), np.zeros(lines.shape[1])
    for name, a, b in zip(names, lines[:-1], lines[1:], strict=True):
        points = a[:, None] + (b - a)[:, None] * (1 + gauss)[:, None] / 2
        P = stress.at_points(points.reshape(-1, points.shape[-1]), name).first_piola[:, 2, 2].reshape(points.shape[:2])
        resultant += np.linalg.norm(b - a, axis=1) * (P @ weights) / 2
    return HoopResultants((lines[0] + lines[-1]) / 2, resultant, problem.comm)
