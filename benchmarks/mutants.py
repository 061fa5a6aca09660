"""Mutation test: change lines of the package one by one, in a copy of the tree, and run the tests beside them.

    ./fx python3 benchmarks/mutants.py [number or word ...]

A mutant is killed if one of its tests fails. The table `mutants.csv` beside this file is rewritten after each mutant,
so an interrupted run continues with the remaining numbers. All mutants take hours; continuous integration has none.
"""

from __future__ import annotations

import argparse
import csv
import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).parents[1]
TABLE = Path(__file__).with_suffix(".csv")
LIMIT = 900          # seconds for the tests of one mutant; one that makes a run endless is killed


class Mutant(NamedTuple):
    """A change of one text of the package.

    Attributes:
        file: file of the package.
        old: text that occurs once in the file.
        new: text in its place.
        tests: names NAME of tests/test_NAME.py, of which one should fail.
    """

    file: str
    old: str
    new: str
    tests: str


MUTANTS = [Mutant(*row) for row in [
    # contact and friction
    ("contact/rule.py", "+= share * whole", "+= share * whole / 2", "details"),
    ("contact/face.py", "        if one_sided:\n            newly", "        if False:\n            newly",
     "contact plugs jumps"),
    ("contact/face.py", "-self.scale[:, None] * (stiffness @", "self.scale[:, None] * (stiffness @",
     "contact derivatives"),
    ("contact/step_limit.py", "> 2 * max(self.max_closures, self._predicted_closures) + 2", "> 10**6", "details"),
    ("contact/step_limit.py", "return arc_lengths, start + arc_lengths[:, None] * velocity",
     "return arc_lengths, start + length * velocity", "thin_sheets contact_events"),
    ("contact/face.py", "        self._start_at(self.positions(fields, control))", "        pass", "details"),
    ("physics/contact_law.c", "ahead = d - centre", "ahead = 0 * d", "contact plugs"),
    ("physics/contact_law.c", "fabs(trial) > most", "fabs(trial) > 2 * most", "contact plugs"),
    ("physics/contact_law.c", "(most + grows * (N[i] - pressed))", "most", "contact compiled_contact"),
    ("physics/contact_law.c", "(1 - curvature[i] * across)", "(1 + curvature[i] * across)", "details"),
    ("physics/contact_law.c", "- bent * curvature[i]", "+ bent * curvature[i]", "contact derivatives"),
    ("physics/contact_law.c", "g[i] = slip[i] + along", "g[i] = along", "contact compression plugs"),
    ("physics/contact_law.c", "(*slope * *slope) : d;", "(*slope * *slope) : d + theta;", "contact closed_forms"),
    ("physics/contact_law.c", "*slope * (d + theta)", "*slope * d", "contact"),
    ("contact/rule.py", "np.tile(weights / 2, len(nodes))", "np.tile(weights / 2.1, len(nodes))",
     "contact_points evaluation"),
    # the body and its loads
    ("physics/kinematics.py", "return _block(ufl.Identity(2) + ufl.grad(u), 1 + u[0] / X[0])",
     "return _block(ufl.Identity(2) + ufl.grad(u), 1 + u[0] / X[0] / 1.001)", "closed_forms materials"),
    ("physics/kinematics.py", "return 2 * ufl.pi * (X[0] + u[0]) * _cofactor", "return 2 * ufl.pi * X[0] * _cofactor",
     "closed_forms derivatives"),
    ("physics/kinematics.py", "ufl.conditional(near, series, large**a + small**a)", "(large**a + small**a)",
     "derivatives materials"),
    ("forms/solid.py", "W -= terms.rest_stress * ufl.ln(J)", "W -= 0.9 * terms.rest_stress * ufl.ln(J)",
     "details"),
    ("forms/formulation.py", "residual -= self._scale * work", "residual -= 1.001 * self._scale * work",
     "closed_forms treloar"),
    ("forms/formulation.py", "base.value = active * (", "base.value = (", "process"),
    ("forms/membrane.py", "l1, l2 = ufl.sqrt(ufl.inner(t, t)), F[2, 2]",
     "l1, l2 = ufl.sqrt(ufl.inner(t, t)), 1 + (F[2, 2] - 1) / 1.01", "membrane"),
    ("forms/probes.py", "row, -0.5 if", "row, -0.49 if", "treloar closed_forms"),
    ("problem/problem.py", "return -float(combined(self.comm, left, MPI.SUM))",
     "return -1.002 * float(combined(self.comm, left, MPI.SUM))", "compression closed_forms"),
    ("problem/problem.py", "out.array_w += (control - 1) * stage.unbalanced",
     "out.array_w += (control - 0.5) * stage.unbalanced", "process"),
    ("problem/problem.py", "self.history.variables, self.history.predicted = variables, predicted",
     "self.history.predicted = predicted", "details"),
    ("forms/admissible.py", "> 0))\n                    for", "> -0.5))\n                    for", "admissible"),
    ("forms/constraints.py", "active * row for (_, row), active", "row for (_, row), active", "process"),
    # materials
    ("materials/hyperelastic.py", "return c10 * (I1 - 3) + c01 * (I2 - 3)", "return c01 * (I1 - 3) + c10 * (I2 - 3)",
     "materials closed_forms"),
    ("materials/hyperelastic.py", "s / 2 - s**2 / 20 - s**3 / 15", "s / 2 - s**2 / 20 + s**3 / 15", "materials"),
    ("materials/viscoelastic.py", "share * _parabola_weight(x)\n", "0 * _parabola_weight(x)\n", "viscoelastic"),
    ("materials/viscoelastic.py", "return 3 * s / (q**2 + p * q + p**2) - 3", "return s / q**2 - 3", "viscoelastic"),
    ("materials/viscoelastic.py", "(_mean_decay(x) - decay + p) * c", "(1 - decay + p) * c", "viscoelastic"),
    ("materials/relaxing.py", "mu / (2 * tau) * ufl.max_value", "mu / tau * ufl.max_value", "viscoelastic time"),
    ("extensions/kbkz/kbkz.py", "initial + np.sum", "np.sum", "kbkz"),
    ("extensions/heat/expansion.py", "return self.stretch(temperature) ** 3", "return self.stretch(temperature) ** 2",
     "expansion"),
    ("values/temperature.py", "self.c1 * (above - self.c2) / above", "self.c1 * above / above",
     "temperature materials"),
    ("contact/step_limit.py", "return bool(np.all(found > 0))", "return False", "contact"),
    # solution path
    ("solve/path_following.py", "if (limit.control - old.control) * old.slope < 0:", "if False:", "treloar"),
    ("solve/path_following.py", "if error > self.settings.max_time_error:", "if False:", "steps_in_time time accuracy"),
    ("solve/path_following.py", "if not 0 < self.curve.progress(old, new) < 2 * length:", "if False:",
     "details"),
    ("solve/progress.py", "change *= now / (now - then) if now * then < 0 else 1.0", "change *= 1.0", "details"),
    ("solve/arc_length.py", "if self.problem.has_inverted_element(self._x, control):", "if False:",
     "details"),
    ("solve/arc_length.py", "share = (length / h) ** 2", "share = -(length / h) ** 2", "treloar stepping limit"),
    ("solve/arc_length.py", "< (2e-6 if k == _BY_CUBIC - 1 else 2e-12) * curvature", "< 1e6 * curvature",
     "treloar limit"),
    ("solve/snap_through.py", "self.dissipated += 0.5 * (max(self._sum(self._pull * dx), 0.0) + self._sum(pull * dx))",
     "self.dissipated += self._sum(pull * dx)", "details"),
    ("solve/snap_through.py", "0.5 * (max(self._sum(self._pull * dx), 0.0) +", "0.5 * (self._sum(self._pull * dx) +",
     "details"),
    ("solve/snap_through.py", "or was_passed(self.curve, self._passed, self._old, state)", "", "bottle"),
    ("solve/branches.py", "sense = -1 if curve.progress(last, state) < 0 else 1", "sense = 1", "stability"),
    ("results/evaluate/admissibility.py", "penetration: float = 0.15", "penetration: float = 0.45",
     "inadmissible_states"),
    ("forms/material_terms.py", "(self._time_step / 2 if self._in_middle else 0)", "(0 if self._in_middle else 0)",
     "temperature"),
    ("extensions/contact_events/event_sequence.py", "share = np.linalg.lstsq(ahead, right, rcond=1e-10)[0]",
     "share = 0 * right", "contact_events"),
    ("solve/snap_through.py", "        problem.history.variables = kept\n        raise", "        raise", "details"),
    ("measures/forces.py", "self._by_control)\n            return (force - target) / self._scale, slope",
     "self._by_control)\n            return (force - target) / self._scale, 0.0", "process time derivatives"),
    ("solve/pieces.py", "rate[-1] = np.sign(change) * scale / stage.speed", "rate[-1] = scale / stage.speed",
     "process time"),
    ("solve/measure_control.py", "best = found if found.time < best.time else best", "best = found",
     "details"),
    ("measures/targets.py", "for t in _GAUSS)", "for t in (0, 1))", "evaluation"),
    ("solve/newton.py", "step = (-c - self.gradient.dot(self.a)) / self._slope",
     "step = (-c - 0.9 * self.gradient.dot(self.a)) / self._slope", "treloar process"),
    ("solve/predictor.py", "if after.kind == \"jump\":\n            return None",
     "if False:\n            return None",
     "details"),
    ("solve/stepping.py", "return max(once / self._once, lasting", "return max(0 * once, lasting", "steps_in_time"),
    # heat
    ("extensions/heat/conduction.py", "F[1, 1]]])).T", "F[1, 1]]]))", "details"),
    ("extensions/heat/conduction.py", "self._area = ufl.sqrt(ufl.inner(area, area))", "self._area = self._weight",
     "cooling heat heat_runs"),
    ("extensions/heat/conduction.py",
     "* ufl.exp(-kappa * depth) * J * self._weight", "* ufl.exp(-kappa * depth) * self._weight",
     "details"),
    ("extensions/heat/cooling_history.py", "(contact.active & (depth", "(True & (depth", "details"),
    ("extensions/heat/cooling_history.py", "self._body.power, self._power = (self._power + power) / 2, power",
     "self._body.power, self._power = power, power", "cooling"),
    ("extensions/heat/contact.py",
     "self.conductance / (1 + self.conductance * compliance[0])", "self.conductance + 0 * compliance[0]",
     "heat"),
    ("extensions/heat/stepping.py",
     "_D, _W = 1 - np.sqrt(0.5), np.sqrt(0.125)", "_D, _W = 1 - np.sqrt(0.5), 0.36", "heat"),
    ("extensions/heat/boundaries.py",
     "(kelvin[0] ** 4 - kelvin[1] ** 4)", "(kelvin[0] ** 4 - kelvin[1] ** 4) * 1.01", "details"),
    # answers
    ("results/evaluate/work.py", "@ c.contact.travel_vector)\n                                 for c in tools)",
     "@ np.sign(c.contact.travel_vector))\n                                 for c in tools)", "energy_balance"),
    ("results/evaluate/step_polynomials.py", "f.value(s) * y.slope(s)", "f.value(1) * y.slope(s)", "energy_balance"),
    ("results/evaluate/work.py", "+ _friction_of(c, b, problem)) / 2 * slid", "+ 0) / 2 * slid", "energy_balance"),
    ("results/evaluate/work.py", "temperature._replace(before=None)", "temperature", "energy_balance"),
    ("results/evaluate/dissipation.py", "history.advance(x, control)", "pass", "energy_balance"),
    ("results/evaluate/tension.py", "- F[1, 1] * P[1, 1])", "+ F[1, 1] * P[1, 1])", "membrane"),
    ("results/evaluate/part.py", "(r * r + r * s + s * s) * (w - z)", "(r * r + s * s) * 1.5 * (w - z)", "details"),
    ("results/evaluate/contact_face.py", "(traction / ratio).T", "traction.T", "evaluation"),
    ("results/evaluate/filling.py", "remaining[k] - gap) / (remaining[k]",
     "remaining[k] - gap) / (gap + remaining[k]", "evaluation"),
    ("results/evaluate/point_stress.py", "n[:, 1], -n[:, 0]", "n[:, 1], n[:, 0]", "stress"),
    # residuals and tangents of each load, model and body
    ("physics/loads.py", "return -value * self.share(body) * ufl.inner",
     "return -1.001 * value * self.share(body) * ufl.inner", "closed_forms treloar"),
    ("physics/loads.py", "self.density, body.du[body.kinematics.components - 1])", "self.density, body.du[0])",
     "terms sag"),
    ("physics/loads.py", "(body.X[0] + body.u[0]) * body.du[0])", "body.X[0] * body.du[0])", "terms"),
    ("physics/loads.py", "body.mode[0] * body.dmode[0] + body.mode[2]", "body.mode[0] * body.dmode[0] - body.mode[2]",
     "terms stability"),
    ("physics/models.py", "eps * p**2 / (16 * modulus)", "eps * p**2 / (8 * modulus)", "closed_forms"),
    ("physics/models.py", "modulus / eps * (J**2 - 1) ** 2", "modulus / eps * (J - 1) ** 2",
     "reference_element closed_forms"),
    ("physics/kinematics.py", "return _cofactor(ufl.Identity(2) + ufl.grad(u)) * N",
     "return _cofactor(ufl.Identity(2) + ufl.grad(u)).T * N", "derivatives closed_forms"),
    ("physics/kinematics.py", "return ufl.cofac(self.deformation_gradient(u, X)) * N",
     "return ufl.cofac(self.deformation_gradient(u, X)).T * N", "space"),
    ("physics/kinematics.py", "(number * V + U) / X[0]])", "(number * V - U) / X[0]])", "stability"),
    ("physics/kinematics.py", "-number * mode[1], number * mode[2]])", "-number * mode[1], 0 * mode[2]])", "stability"),
    ("forms/formulation.py", "residual += self.weighted(self._scale * work, entry.names)",
     "residual += self.weighted(0.9 * self._scale * work, entry.names)", "kbkz kbkz_scenes"),
    ("forms/tangent.py", "values += assemble(self._by_motion)", "values += 0.5 * assemble(self._by_motion)",
     "derivatives"),
    ("forms/tangent.py", "if self._by_time and rate[-1]:", "if False:", "time"),
    ("forms/solid.py", "        return F * before", "        return before * F", "state_transfer remesh"),
    ("extensions/space/surface.py", "ufl.inner(f1, f2) / l1, 0]", "0.9 * ufl.inner(f1, f2) / l1, 0]", "space"),
    ("extensions/space/surface.py", "l2 = 1 / ufl.sqrt(l1)", "l2 = 1 / l1", "space"),
    ("extensions/space/pressure_on_tools.py", "- side * size * n", "", "space"),
    ("extensions/space/pressure_on_tools.py", "h * further[i] for i, h", "0 * h * further[i] for i, h",
     "friction_in_space"),
    ("extensions/space/lagged_friction.py", "dg = np.eye(3) - outer(n, n) - bends", "dg = np.eye(3) - outer(n, n)",
     "friction_in_space"),
    ("extensions/space/lagged_friction.py", "stiff = mu * self.friction_pressure",
     "stiff = 0.9 * mu * self.friction_pressure", "friction_in_space"),
    ("extensions/space/lagged_friction.py", "depth = now + np.einsum", "depth = now + 0 * np.einsum",
     "friction_in_space"),
    ("extensions/space/lagged_stick.py", "self.k * (x[sticking] - old.position[sticking])",
     "self.k * 0.5 * (x[sticking] - old.position[sticking])", "space"),
    ("physics/contact_law.py", "return turned + np.where(out[4 * n:5 * n] == 0, out[11 * n:], 0.0)", "return turned",
     "contact stability"),
    ("extensions/stability/second_variation.py", "form = form if work is None else form - half * work",
     "form = form if work is None else form - 0.9 * half * work", "stability"),
    ("extensions/kbkz/integral.py", "+ (W * h2)[:, None] * by_I2", "+ 0 * (W * h2)[:, None] * by_I2",
     "kbkz kbkz_scenes"),
    ("extensions/kbkz/integral.py", "for i in range(4) for j in range(4)) / 4",
     "for i in range(4) for j in range(4)) / 2", "kbkz kbkz_scenes"),
    ("extensions/heat/conduction.py", "- self._c * ufl.derivative(R, T)", "- 0.5 * self._c * ufl.derivative(R, T)",
     "heat"),
    ("extensions/heat/boundaries.py", "return h * (air - T)", "return 1.001 * h * (air - T)", "heat"),
    ("extensions/heat/contact.py", "h / 30 * np.array([[4, 2, -1]", "h / 30 * np.array([[4, 2, 1]", "heat"),
    # laws
    ("materials/hyperelastic.py", "return c10 * (ufl.inner(F, F) - 3)", "return 1.001 * c10 * (ufl.inner(F, F) - 3)",
     "materials closed_forms"),
    ("materials/hyperelastic.py", "c10 * x + c20 * x**2", "c10 * x + 1.001 * c20 * x**2", "materials"),
    ("materials/hyperelastic.py", "return -mu * Jm / 2 * _ln(1 -", "return -mu * Jm / 2.002 * _ln(1 -", "materials"),
    ("materials/hyperelastic.py", "J**-a * powers", "powers", "materials"),
    ("materials/homogeneous.py", "K = l[:, None] * l * h + np.eye(3)[..., None] * tau", "K = l[:, None] * l * h",
     "materials"),
    ("materials/viscoelastic.py", "return m - m.mean(axis=-1, keepdims=True)", "return m - 1", "viscoelastic"),
    ("materials/viscoelastic.py", "return 1 - np.exp(-2 * w)", "return 2 * w", "viscoelastic"),
    ("materials/viscoelastic.py", "return deviator_squared(C, self._metric(Cv))",
     "return 2 * deviator_squared(C, self._metric(Cv))", "viscoelastic energy_balance"),
    ("materials/viscoelastic.py", "inner(C, A) - 3 - ufl.ln(determinant(A))",
     "inner(C, A) - 3", "viscoelastic energy_balance"),
    ("materials/relaxing.py", "mu / 2 * (inner(isochoric(F), IDENTITY) - 3)",
     "mu / 2.1 * (inner(isochoric(F), IDENTITY) - 3)", "viscoelastic time"),
    ("materials/solidification.py", "phi * (inner(isochoric(F), IDENTITY) - 3)",
     "phi * 0.9 * (inner(isochoric(F), IDENTITY) - 3)", "solidification"),
    ("materials/solidification.py", "after / ufl.max_value(before, 1e-12), 1.0)", "1.0, 1.0)", "solidification"),
    ("extensions/kbkz/damping.py", "return h, -self.beta * h**2 / self.alpha",
     "return h, -0.9 * self.beta * h**2 / self.alpha", "kbkz"),
    ("extensions/kbkz/damping.py", "f * np.exp(-n * s) for f, n", "f * np.exp(-1.01 * n * s) for f, n",
     "kbkz kbkz_scenes"),
    ("extensions/kbkz/damping.py", "slope = -h**2 * self.b / 2", "slope = -h**2 * self.b / 2.2", "kbkz"),
    ("extensions/kbkz/integral.py", "limited = h > smallest_h", "limited = h > 2 * smallest_h", "kbkz_scenes"),
    ("values/temperature.py", "(1 / kelvin - 1 / (self.reference - zero))",
     "(1 / kelvin - 0.999 / (self.reference - zero))", "temperature tables"),
    ("physics/contact_law.py", "inside**3 / (12 * theta), d**2 / 2 + theta**2 / 6)",
     "inside**3 / (12 * theta), d**2 / 2)", "contact energy_balance"),
    # time schemes
    ("materials/viscoelastic.py", "x / 2 * (1 + x / 3 *", "x / 2 * (1 + x / 6 *", "viscoelastic"),
    ("materials/viscoelastic.py", "return plus(Cv, past, x / 2), x",
     "return plus(Cv, past, x / 2.2), x", "viscoelastic"),
    ("materials/viscoelastic.py", "near = ufl.max_value(0, ufl.min_value(1, 2 - s / 2))",
     "near = 1", "viscoelastic time"),
    ("materials/viscoelastic.py", "- past[2] * _parabola_weight(x))",
     "+ past[2] * _parabola_weight(x))", "viscoelastic"),
    ("materials/solidification.py", "born = ufl.max_value(end - begin, 0) / 2", "born = ufl.max_value(end - begin, 0)",
     "solidification"),
    ("extensions/kbkz/integral.py", "w[1:] += young * (1 - mean)", "w[1:] += young * (1 - 0.99 * mean)",
     "kbkz_scenes steps_in_time"),
    ("extensions/kbkz/integral.py", "return share / (1 + s), share, share * s / (1 + s)",
     "return share / (1 + s), share, share / (1 + s)", "kbkz_scenes steps_in_time"),
    ("extensions/kbkz/integral.py", "slope[-1] += np.sum(G / self.tau[:, None] * (_mean_decay_slope(y) + decay)",
     "slope[-1] += np.sum(G / self.tau[:, None] * (_mean_decay_slope(y) - decay)",
     "kbkz_scenes steps_in_time"),
    ("extensions/heat/stepping.py", "np.array([1 - _W, 3 * _W + 1, _D]) / 3",
     "np.array([1 - _W, 3 * _W + 1, _D]) / 3.3", "heat"),
    ("extensions/heat/stepping.py", "[dt * _W * (a + b)", "[dt * _W * (a + 0.9 * b)", "heat"),
    ("extensions/heat/cooling_history.py", "(start.x[: len(x)] + x) / 2", "x", "cooling heat_runs"),
    ("forms/step_error.py", "end - step / 2)", "end)", "steps_in_time temperature"),
    # surfaces, tools and temperatures in three dimensions
    ("extensions/space/heat/columns.py", 'x - start - np.einsum("nfg,ng->nf", Z, q)',
     'x - start - 0.99 * np.einsum("nfg,ng->nf", Z, q)', "heat_columns"),
    ("extensions/space/heat/columns.py", "np.outer(1 / self.thickness**2, self.basis.rates)",
     "np.outer(1 / self.thickness, self.basis.rates)", "heat_columns"),
    ("extensions/space/heat/columns.py", "+= self._share / self.thickness * flux",
     "+= 0.99 * self._share / self.thickness * flux", "heat_columns heated_disc"),
    ("extensions/space/heat/columns.py", "self.thickness = self._nodes.thickness / ratio",
     "self.thickness = self._nodes.thickness", "heat_columns heated_disc warm_sheets"),
    ("extensions/space/heat/columns.py", "touch.area = self._nodes.area * ratio / self.capacity",
     "touch.area = self._nodes.area / self.capacity", "heat_columns heated_disc warm_sheets"),
    ("extensions/space/heat/columns.py", "np.broadcast_to(found.imag, T.shape) / 1e-30",
     "np.broadcast_to(found.imag, T.shape) / 1.1e-30", "heat_columns heated_disc"),
    ("extensions/space/heat/columns.py", "weights[layer.points] += layer.share * layer.weights",
     "weights[layer.points] += layer.weights", "heat_columns heat_layers"),
    ("extensions/space/heat/basis.py", "law.conductivity / share * slopes.T", "law.conductivity * slopes.T",
     "heat_columns"),
    ("extensions/space/heat/linear.py", "bool(np.abs((a + b) / 2 - mean).max() <= _LINEAR * np.abs(mean).max())",
     "True", "heat_columns heated_disc warm_sheets"),
    ("extensions/space/sheet_balance.py", '(p + q) / 2, xb - xa', 'q, xb - xa',
     "warm_sheets"),
    ("extensions/space/surface.py", "ufl.inner(f1, f2) / l1, 0], [0, J / l1, 0]",
     "0.9 * ufl.inner(f1, f2) / l1, 0], [0, J / l1, 0]", "space tubes"),
    ("extensions/space/surface.py", "cos, sin = (C11 - C22) / 2 / half, C12 / half",
     "cos, sin = (C11 - C22) / 2 / half, -C12 / half", "space"),
    ("extensions/space/surface.py", "[side * b[0], 0, side * b[1]]", "[b[0], 0, b[1]]", "fibres_in_space"),
    ("extensions/space/lagged_friction.py", "dg -= outer(way, np.einsum(\"ni,nij->nj\", way, dg))", "pass",
     "friction_in_space"),
    ("extensions/space/lagged_friction.py", "found[rows] = self.k * (outer(n, n) + depth[:, None, None] * hessian)",
     "found[rows] = self.k * outer(n, n)", "friction_in_space"),
    ("extensions/space/patches.c", "k12 = (M / a - L * p / (a * a)) / q", "k12 = M / a / q", "solid_surfaces"),
    ("extensions/space/patches.c", "T[i] = K[i] / fmax(1 + K[i] * d, 0.1)", "T[i] = K[i]", "solid_surfaces"),
    ("extensions/space/patches.c", "- share * t[i] * t[j]) / d", ") / d", "solid_surfaces"),
    ("extensions/space/patches.c", "distance[k] = d = s > 0 ? -d : d", "distance[k] = d = s >= -1e-3 ? -d : d",
     "solid_surfaces"),
    ("extensions/space/patches.py", "across0 * 2 * A1 + across3 * A0) / 3", "across0 * 2 * A1 + across3 * A2) / 3",
     "solid_surfaces"),
    ("extensions/space/patches.py", "inside = unit(chord - (chord * normal).sum(1, keepdims=True) * normal)",
     "inside = unit(chord)", "solid_surfaces"),
    ("extensions/space/edge_fillets.py", "(outer[0] + outer[1] - outer[2]) / s", "(outer[0] + outer[1]) / s",
     "unions solid_surfaces tools_in_bodies"),
    ("extensions/space/layers.c", "if (d[k] * d[l] >= 0 || depth <= limit) continue;",
     "if (d[k] * d[l] >= 0 || depth <= 10 * limit) continue;", "layers"),
    ("extensions/space/passed_tools.py", "wrong = np.flatnonzero(met & (outside != self._faces_out))",
     "wrong = np.flatnonzero(met & (outside == self._faces_out))", "passed_tools"),
    ("extensions/fits/oscillation.py", "return x**2 / (1 + x**2), x / (1 + x**2)",
     "return x**2 / (1 + x**2), x / (1 + x)", "fit_in_time fit"),
    ("extensions/design/whole_runs.py", "vector + _CHANGE * p.size > p.high, -1.0, 1.0)",
     "vector + _CHANGE * p.size > p.high, 1.0, 1.0)", "design"),
]]


def missing() -> list[str]:
    """Return messages on mutants whose text is not exactly once in its file, or whose tests do not exist."""
    tests = sorted({name for m in MUTANTS for name in m.tests.split()})
    return [f"{m.file}: {m.old!r} is in it {n} times" for m in MUTANTS
            if (n := (ROOT / "formingx" / m.file).read_text().count(m.old)) != 1] + [
        f"there is no tests/test_{name}.py" for name in tests if not (ROOT / "tests" / f"test_{name}.py").is_file()]


def outcome(mutant: Mutant, tree: Path) -> str:
    """Return "killed by ...", "survived", or why neither is known; the tree is restored."""
    file = tree / "formingx" / mutant.file
    before = file.read_text()
    file.write_text(before.replace(mutant.old, mutant.new))
    tests = [f"tests/test_{name}.py" for name in mutant.tests.split()]
    command = [sys.executable, "-m", "pytest", "-n", "0", "-x", "-rfE", "-p", "no:cacheprovider", "--deselect",
               "tests/test_details.py::test_every_mutant_stands_in_its_file", *tests]
    try:
        done = subprocess.run(command, cwd=tree, timeout=LIMIT, capture_output=True, text=True, check=False,
                              env=os.environ | {"PYTHONPATH": str(tree)}, start_new_session=True)
        if done.returncode not in (0, 1):
            return f"pytest ended with {done.returncode}"
        said = [line for line in done.stdout.splitlines() if line.startswith(("FAILED", "ERROR"))]
        first = said[0].split()[1].removeprefix("tests/") if said else done.stdout.strip()[-200:]
        return f"killed by {first}" if done.returncode else "survived"
    except subprocess.TimeoutExpired:
        return f"killed by the limit of {LIMIT} s"
    finally:
        file.write_text(before)


def chosen(words: list[str]) -> list[int]:
    """Return the numbers of the mutants that words name by number or by a part of the file's name (default: all)."""
    return [k for k, mutant in enumerate(MUTANTS, 1)
            if not words or any(word == str(k) or not word.isdigit() and word in mutant.file for word in words)]


def main(words: list[str]) -> None:
    if stale := missing():
        raise SystemExit("\n".join(stale))
    known = {}
    if TABLE.exists():
        with TABLE.open(newline="") as stream:
            known = {tuple(row[1:4]): row[5] for row in list(csv.reader(stream))[1:]}
    with tempfile.TemporaryDirectory() as scratch:
        tree = Path(scratch) / "tree"
        shutil.copytree(ROOT, tree, ignore=shutil.ignore_patterns(".git", ".cache", "__pycache__"))
        for k in chosen(words):
            mutant = MUTANTS[k - 1]
            known[tuple(mutant[:3])] = found = outcome(mutant, tree)
            print(f"{k:3} {mutant.file}: {(mutant.new.strip() or 'nothing').splitlines()[0]}: {found}", flush=True)
            with TABLE.open("w", newline="") as stream:
                rows = csv.writer(stream, lineterminator="\n")
                rows.writerow(["number", "file", "line", "instead", "tests", "outcome"])
                rows.writerows([n, *m, known[tuple(m[:3])]] for n, m in enumerate(MUTANTS, 1) if tuple(m[:3]) in known)
    survived = [k for k in chosen([]) if known.get(tuple(MUTANTS[k - 1][:3])) == "survived"]
    print(f"{len(survived)} of {len(known)} survive: {survived}")


if __name__ == "__main__":
    options = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    options.add_argument("words", nargs="*", help="numbers of mutants, or parts of names of files (default: all)")
    main(options.parse_args().words)
