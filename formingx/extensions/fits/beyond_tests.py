"""Checks that the deformation of a run lies within the tests to which the constants of its materials were fitted."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import basix
import numpy as np
import ufl

from ... import _compat
from ...checks.expected_stretch import expected_stretches
from ...findings import Finding, register
from ...forms.transfer import isochoric_gradients
from ...mesh.triangles import place
from ...ranks import gathered
from ...values.tolerances import NOTICEABLE
from .tested import MeasuredRange, nearest_test, principal_strains


@register("scene")
def expected_stretches_beyond_tests(body: Any) -> Iterator[Finding]:
    """Yield warnings for layers with constants that tests leave undetermined, and stretches beyond the tests.

    For a target it is the largest stretch of a free dome, for a closed mould the root of the areal draw ratio.
    """
    for layer, tested in _tested(body.scene):
        about = f"materials[{layer!r}]"
        if tested.undetermined and tested.single_mode:
            yield Finding("warning", about, f"its tests ({tested}) do not determine {', '.join(tested.undetermined)}:"
                          f" in another mode of deformation its stress is a guess",
                          "fit it to tests of another mode too, or choose a law with fewer constants")
        for what, stretch in expected_stretches(body):
            strain = principal_strains(np.array([[stretch], [stretch]]))
            if tested.outside(strain)[0]:
                yield Finding("warning", about, f"{what} stretches it about {stretch:.3g}-fold in all directions;"
                              f" {_tests_of(tested, *strain[0])}", "use tests that reach so far")


@register("end")
def strains_beyond_tests(path: Any) -> Iterator[Finding]:
    """Yield a warning for each layer with 0.5 % of its volume beyond the tests in the last state; collective."""
    problem, scene = path.problem, path.problem.scene
    known = dict(_tested(scene))
    for terms in problem.forms.terms if known else ():
        tested = known.get(terms.names[0])
        if tested is None:
            continue
        with problem.state_context(path.last):
            strains, points, volumes = _deformation(problem, terms)
        outside = tested.outside(strains)
        share = float(volumes[outside].sum() / volumes.sum())
        if share < NOTICEABLE:
            continue
        furthest = int(np.argmax(np.where(outside, tested.distance(strains), 0.0)))
        largest, middle = strains[furthest]
        point = points[furthest]
        where = place(scene.mesh, point)
        undetermined = f"; they leave {', '.join(tested.undetermined)} open" if tested.undetermined else ""
        yield Finding("warning", f"materials[{terms.names[0]!r}]",
                      f"{100 * share:.3g} % of it is deformed as in none of its tests, furthest at {where}, where it is"
                      f" stretched {np.exp(largest):.3g} and {np.exp(middle):.3g}-fold;"
                      f" {_tests_of(tested, largest, middle)}{undetermined}: its stress there is extrapolated",
                      "fit it to tests of this mode that reach so far")


def _tests_of(tested: MeasuredRange, largest: float, middle: float) -> str:
    """Return a text that names the test nearest to logarithmic strains, with its range of stretches."""
    mode = nearest_test(largest, middle)
    found = tested.ranges.get(mode.replace(" ", "_"))
    if found is not None:
        return f"that is nearest to {mode} tension, tested at stretches from {found[0]:.3g} to {found[1]:.3g}"
    return f"that is nearest to {mode} tension, which was not tested (tests: {tested})"


def _tested(scene: Any) -> list[tuple[str, MeasuredRange]]:
    """Return (layer, its tests) of each layer of a scene whose material stores its tests."""
    found = [(layer, material.base.tested) for layer, material in scene.materials.items()]
    return [(layer, tested) for layer, tested in found if tested is not None]


def _deformation(problem: Any, terms: Any) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return largest and middle log strain (n, 2), positions (n, 2 or 3) and volumes (n,) on all ranks; collective."""
    forms, cells = problem.forms, terms.own_cells
    F = isochoric_gradients(forms, cells, terms.places)
    squares = np.linalg.eigvalsh(F.transpose(0, 2, 1) @ F)[:, ::-1]
    rule = basix.make_quadrature(forms.domain.basix_cell(), forms.scene.quadrature_degree)[1]
    size = len(forms.X)
    where = _compat.compile_expression(ufl.as_vector([*forms.X, forms.weight * abs(ufl.JacobianDeterminant(
        forms.domain))]), terms.places)
    values = where.eval(forms.domain, cells).reshape(-1, size + 1) if len(cells) else np.zeros((0, size + 1))
    volumes = values[:, size] * np.tile(np.abs(rule), len(cells))
    comm = problem.comm
    return gathered(comm, np.log(squares[:, :2]) / 2), gathered(comm, values[:, :size]), gathered(comm, volumes)
