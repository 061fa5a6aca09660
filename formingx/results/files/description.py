"""Description of a scene as JSON data, by which scenes are compared, and which people can read."""

import math
from collections.abc import Iterator, Mapping
from functools import cached_property
from typing import Any

import numpy as np
from mpi4py import MPI

from ...materials.constants import Varying
from ...materials.material import Material
from ...mesh.nodes import cell_node_positions, own_cells
from ...scene.summary import text
from ...values.table import Table
from ...values.temperature import FunctionOfTemperature
from .functions import UNKNOWN, class_code, described, field_sums, functions_in

_PARTS = ("materials", "supports", "loads", "contacts", "model", "kinematics", "quadrature_degree")


def describe(problem: Any) -> dict[str, Any]:
    """Return the description of the scene as JSON data, the same on any number of ranks; collective.

    The entry "mesh" holds counts and sums that change with any coordinate, tag or order of cells. The others are public
    attributes of materials, supports, loads, contacts, model and kinematics.
    """
    scene = problem.scene
    known = set(_PARTS) | {"mesh", "temperature", "state_transfer"}
    extra = sorted(name for name in vars(scene) if name not in known and not name.startswith("_"))
    found = {"mesh": _mesh(problem), "unknowns": problem.n_unknowns,
             **{name: plain(getattr(scene, name)) for name in (*_PARTS, *extra)}}
    if scene.temperature is not None:
        found["temperature"] = {"kind": text(scene.temperature), "sums": field_sums(scene.temperature.T)}
    for layer, material in scene.materials.items():
        if material.varies:
            constants = {name: constant.values for name, constant in material.constants().items()
                         if isinstance(constant, Varying)}
            found["materials"][layer] |= {"shear_modulus": scene.shear_modulus(layer),
                                          "sums": _sums(scene, layer, constants)}
    if "thickness" in extra:
        found["thickness"] = {layer: _sums(scene, layer, {"sum": lambda sample, h=h: h(*sample.points.T)})
                              for layer, h in scene.thickness.items()}
    return found


def plain(value: Any, depth: int = 8) -> Any:
    """Return an object as JSON data: numbers, strings, lists and dictionaries of at most `depth` levels.

    An object becomes {"kind": its class, public attribute: value}, with the code of a user's class; functions are
    described by what they compute.
    """
    if value is None or isinstance(value, bool | int | float | str):
        return value
    if isinstance(value, np.generic | np.ndarray):
        return value.tolist()
    if isinstance(value, Mapping):
        return {str(k): plain(v, depth - 1) for k, v in value.items()}
    if isinstance(value, list | tuple):
        return [plain(v, depth - 1) for v in value]
    if isinstance(value, Material):
        return {"kind": text(value)} | ({} if value.varies else {"shear_modulus": value.shear_modulus}) | (
            {"functions": found} if (found := dict(functions_in(value))) else {})
    if isinstance(value, FunctionOfTemperature):
        return {"kind": text(value), "function": described(value.function)}
    if callable(value) or isinstance(value, Table):
        return described(value)
    if depth == 0 or not hasattr(value, "__dict__"):
        return text(value)
    code = class_code(type(value))
    return {"kind": type(value).__name__, **code,
            **{k: plain(v, depth - 1) for k, v in vars(value).items()
               if (code or not k.startswith("_")) and not isinstance(getattr(type(value), k, None), cached_property)}}


def incomparable(about: Any, where: str = "") -> Iterator[tuple[str, str]]:
    """Yield the objects in a description that cannot be compared, as (place, text of the object)."""
    if isinstance(about, dict):
        if UNKNOWN in about:
            yield where, about[UNKNOWN]
        for key, value in about.items():
            yield from incomparable(value, f"{where}.{key}" if where else str(key))
    elif isinstance(about, list):
        for k, value in enumerate(about):
            yield from incomparable(value, f"{where}[{k}]")


def differences(a: Any, b: Any, where: str = "") -> Iterator[tuple[str, Any, Any]]:
    """Yield (place, value in a, value in b), None in one only, of JSON data that differ in nine digits."""
    if isinstance(a, dict) and isinstance(b, dict):
        for key in dict.fromkeys([*a, *b]):
            yield from differences(a.get(key), b.get(key), f"{where}.{key}" if where else key)
    elif isinstance(a, list) and isinstance(b, list) and len(a) == len(b):
        for k, (x, y) in enumerate(zip(a, b)):
            yield from differences(x, y, f"{where}[{k}]")
    elif isinstance(a, float) and isinstance(b, float):
        if not (math.isclose(a, b, rel_tol=1e-9, abs_tol=1e-12) or a != a and b != b):
            yield where, a, b
    elif a != b:
        yield where, a, b


def _sums(scene: Any, layer: str, fields: dict[str, Any]) -> dict[str, float]:
    """Return {field: sum} over the quadrature points of a layer, with weights that differ by point; collective."""
    sample = scene.sample(layer)
    numbers = np.sin(1.0 + scene.mesh.domain.topology.original_cell_index[sample.cells])
    weights = (numbers[:, None] * np.sin(1.0 + np.arange(len(sample.places)))).ravel()
    return {name: float(scene.mesh.comm.allreduce(float(weights @ values(sample)), MPI.SUM))
            for name, values in fields.items()}


def _mesh(problem: Any) -> dict[str, Any]:
    """Return counts, extent and weighted sums of cells' coordinates by which a mesh is recognised; collective."""
    mesh, domain, comm = problem.scene.mesh, problem.forms.domain, problem.comm
    cells = len(owned := own_cells(domain))
    x = cell_node_positions(domain, owned) / problem.forms.length
    number = domain.topology.original_cell_index[:cells]
    weights = np.sin(1.0 + number)[:, None] * np.sin(1.0 + np.arange(x.shape[1]))
    total = comm.allreduce(cells, MPI.SUM)
    sums = comm.allreduce(np.einsum("cn,cnk->k", weights, x), MPI.SUM)
    topology = mesh.domain.topology

    def count(found, dim):
        return int(comm.allreduce(int(np.sum(found < topology.index_map(dim).size_local)), MPI.SUM))
    return {"cells": total, "extent": [float(v) for v in problem.scene.extent], "length": problem.forms.length,
            "layers": {name: count(mesh.cells.find(tag), 2) for name, tag in mesh.layers.items()},
            "boundaries": {name: count(mesh.facets_of(name), 1) for name in mesh.boundaries},
            "sums": [float(v) for v in sums]}
