"""Stick in space, lagged by a step: what touches is held where it crossed the tool, from the next step on.

A point whose straight way between two accepted states leads into the tool is held by an isotropic penalty, in the
steps after, at the place where that way crossed the surface (as the user's guide of Polyflow describes of its contact).
Within a step nothing changes: the law is linear, and Newton's method meets no kink, no normal and no curvature, nor
asks the tool. The price is an error of first order in how far points move in the step in which they arrive: with 1 % of
the points to a step, walls are within 0.1 % of those of exact stick. The tool must give its signed distance alone.

A point that `separates` allows to let go does so from the next step on, when it pulls.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from ..tools.shapes import Nearest
from ..tools.tool import RigidTool
from .contact_law import Motion, Touch, Tractions

_BISECTIONS = 30
_APART = 1e-6
"""Of the thickness: half of the difference quotient of a distance."""


class LaggedStick:
    """The `ContactLaw` of this module.

    Of a point that is held `Touch.position` is where, `distance` is 0, and `arrival` is the gradient of the distance
    there; of one that is free they are its position at the last accepted state and its distance, below -theta.

    Args:
        tool: with its signed distance.
        k: penalty, stress/length; theta: distance from which on a point counts as touching, length; separates: see
            above. thickness: of the sheet, length.
    """

    has_friction = False
    remembers = True
    elastic_slip = 0.0
    mu = np.inf

    def __init__(self, tool: RigidTool, k: Any, theta: float, thickness: float, separates: bool):
        self.tool, self.k, self.theta, self.separates, self._thickness = tool, k, theta, separates, thickness
        self._found: list[tuple[np.ndarray, np.ndarray]] = []           # distances asked for last, and where

    def part(self, points: np.ndarray | slice) -> LaggedStick:
        """See `ContactLaw`."""
        return LaggedStick(self.tool, self.k, self.theta, self._thickness, self.separates)

    def with_friction(self, mu: np.ndarray | float) -> LaggedStick:
        """See `ContactLaw`."""
        return self

    def held(self, old: Touch) -> np.ndarray:
        """Which points are held, shape (n,)."""
        return old.distance > -self.theta

    def touching(self, x: np.ndarray, old: Touch | None) -> np.ndarray:
        """See `ContactLaw`."""
        return np.zeros(len(x), dtype=bool) if old is None else self.held(old)

    def distance(self, x: np.ndarray) -> np.ndarray:
        """See `ContactLaw`; those of the last few states are kept."""
        for at, found in self._found:
            if np.array_equal(at, x):
                return found
        found = self.tool.signed_distance(x.reshape(-1, x.shape[-1])).reshape(x.shape[:-1])
        if x.ndim == 2:
            self._found = [(x.copy(), found), *self._found[:2]]
        return found

    def start(self, x: np.ndarray) -> Touch:
        """What touches from the start is held from the start."""
        d = self.distance(x)
        held = d > -self.theta
        return Touch(x.copy(), np.where(held, 0.0, d), np.zeros(len(x)), self._normals(x, held))

    def tractions(self, x: np.ndarray, old: Touch | None, sense: np.ndarray | None = None,
                  expected: Motion | None = None) -> Tractions:
        """See `ContactLaw`."""
        assert old is not None
        held, zero = self.held(old), np.zeros(len(x))
        force = np.where(held[:, None], self.k * (x - old.position), 0.0)
        normal = np.where(held, np.einsum("ni,ni->n", force, old.arrival), 0.0)
        across = force - normal[:, None] * np.where(held[:, None], old.arrival, 0.0)
        return Tractions(force, normal, np.linalg.norm(across, axis=1), zero,
                         lambda: self.stiffness_ahead(x, old, held), lambda: self._touch(x, old, held, normal))

    def stiffness_ahead(self, x: np.ndarray, old: Touch | None, arrived: np.ndarray) -> np.ndarray:
        """See `ContactLaw`."""
        assert old is not None
        return self.held(old)[:, None, None] * (self.k * np.eye(x.shape[1]))

    def stiffness_round(self, x: np.ndarray, old: Touch | None, radius: np.ndarray) -> np.ndarray:
        """See `ContactLaw`; there is no axis."""
        raise NotImplementedError

    def motion(self, x: np.ndarray, old: Touch | None) -> Motion:
        """See `ContactLaw`; a linear law needs none."""
        return Motion(x, np.zeros(len(x)), np.zeros_like(x), np.zeros(len(x)), np.zeros_like(x))

    def nearest(self, x: np.ndarray) -> Nearest:
        """See `ContactLaw`; not needed."""
        raise NotImplementedError

    def ramp(self, d: np.ndarray, held: np.ndarray | bool = False) -> tuple[np.ndarray, np.ndarray]:
        """See `ContactLaw`; there is none."""
        return np.zeros(len(d)), np.zeros(len(d))

    def energy(self, x: np.ndarray) -> np.ndarray:
        """See `ContactLaw`; nothing is held by penetration."""
        return np.zeros(len(x))

    def _touch(self, x: np.ndarray, old: Touch, held: np.ndarray, normal: np.ndarray) -> Touch:
        """What to remember of an accepted state."""
        d = self.distance(x)
        stays = held & ((normal >= 0) | (not self.separates))
        new = ~held & (d > -self.theta)
        position = np.where(stays[:, None], old.position, x)
        normals = np.where(stays[:, None], old.arrival, 0.0)
        rows = np.flatnonzero(new)
        if len(rows):
            a, b = old.position[rows], x[rows]
            low: np.ndarray = np.zeros(len(rows))
            high: np.ndarray = np.ones(len(rows))
            for _ in range(_BISECTIONS):
                middle = (low + high) / 2
                inside = self.tool.signed_distance(a + middle[:, None] * (b - a)) > 0
                low, high = np.where(inside, low, middle), np.where(inside, middle, high)
            position[rows] = a + high[:, None] * (b - a)
            normals[rows] = self._normals(position[rows], np.ones(len(rows), dtype=bool))
        free = np.minimum(d, -2 * self.theta)
        return Touch(position, np.where(stays | new, 0.0, free), np.zeros(len(x)), normals)

    def _normals(self, x: np.ndarray, where: np.ndarray) -> np.ndarray:
        """The direction of the gradient of the distance at some of the points, else 0, shape (n, c)."""
        found, at, h = np.zeros_like(x), x[where], _APART * self._thickness
        if len(at):
            by = np.stack([self.tool.signed_distance(at + h * e) - self.tool.signed_distance(at - h * e)
                           for e in np.eye(x.shape[1])], 1)
            found[where] = by / np.maximum(np.linalg.norm(by, axis=1, keepdims=True), 1e-300)
        return found
