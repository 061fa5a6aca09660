"""A run resumes only with the scene by which its states were made: functions are compared by what they compute."""

import functools
from types import SimpleNamespace

import numpy as np
import pytest
import ufl
from scipy.interpolate import PchipInterpolator

import formingx as fx
from formingx.results.files.description import describe, differences, incomparable

SCALE = {"a": 1.0, "b": 1.0}
STEEP = PchipInterpolator([0.0, 100.0, 200.0], [1.0, 0.5, 0.2])


def factor():
    return SCALE["a"]


def own(a=0.0, b=2, python="same"):
    """The stress at small strain does not depend on a."""
    return fx.Hyperelastic(lambda I1, I2, c: c * (I1 - 3) + a * (I1 - 3) ** b, c=0.3)


def relaxing(shift):
    return fx.Viscoelastic(fx.NeoHookean(c10=0.3), [(0.3, 1.0)], shift=shift)


class Stiffening(fx.Material):
    """The user's own material; its energy is a method."""

    def __init__(self, c, a):
        self.parameters, self.a = {"c": c}, a
        self.check()

    def strain_energy(self, F, c):
        x = ufl.inner(F, F) - 3
        return c * x + self.a * x**2


class Rough(fx.Contact):
    """The user's own law of friction."""

    limit = 0.1

    def shear_limit(self, pressure, mu):
        return mu * np.minimum(pressure, self.limit), mu * (pressure < self.limit)


def exponential(T, width):
    return np.exp(-(T - 100.0) / width)


def scene(material=None, friction="none", contact=fx.Contact, temperature=100.0, **options):
    return fx.Scene(mesh=fx.mesh.disc(radius=20.0, thickness=0.5, elements=(4, 1)), materials=material or own(),
                    supports=[fx.Symmetry("axis"), fx.SimplySupported("rim")],
                    loads=[fx.Pressure("bottom", name="air")], temperature=temperature,
                    contacts=[contact("top", fx.tools.sphere(radius=9.0, z=2.5), friction, direction=(0, -1),
                                      name="ball")], **options)


def scaled(scale):
    def make():
        SCALE.update(a=scale)
        return scene(relaxing(lambda T: factor() * np.exp(-(T - 100.0) / 20.0)))
    return make


CHANGES = {
    "constant in an energy": (lambda: scene(own(a=0.0)), lambda: scene(own(a=0.05)), "equilibrium|energy.uses.a"),
    "power in an energy": (lambda: scene(own(0.1)), lambda: scene(own(0.1, 3)), "energy.uses.b"),
    "code of an energy": (lambda: scene(fx.Hyperelastic(lambda I1, I2, c: c * (I1 - 3), c=0.3)),
                          lambda: scene(fx.Hyperelastic(lambda I1, I2, c: c * (I2 - 3), c=0.3)), "energy.code"),
    "attribute of an own material": (lambda: scene(Stiffening(0.3, 0.0)), lambda: scene(Stiffening(0.3, 0.1)), "a"),
    "shift function": (lambda: scene(relaxing(lambda T: np.exp(-(T - 100.0) / 20.0))),
                       lambda: scene(relaxing(lambda T: np.exp(-(T - 100.0) / 25.0))), "shift.code"),
    "argument of a shift function": (lambda: scene(relaxing(functools.partial(exponential, width=20.0))),
                                     lambda: scene(relaxing(functools.partial(exponential, width=21.0))), "width"),
    "function that a function calls": (scaled(1.0), scaled(1.5), "SCALE.a"),
    "friction by temperature": (lambda: scene(friction=fx.of_temperature(lambda T: 0.2 + 0 * T)),
                                lambda: scene(friction=fx.of_temperature(lambda T: 0.2 + 1e-3 * (T - 100.0))), "mu"),
    "friction by interpolation": (lambda: scene(friction=fx.of_temperature(lambda T: STEEP(T))),
                                  lambda: scene(friction=fx.of_temperature(PchipInterpolator([0, 200], [0.8, 0.2]))),
                                  "mu"),
    "table of friction": (lambda: scene(friction=fx.table({100.0: 0.2, 150.0: 0.30000001})),
                          lambda: scene(friction=fx.table({100.0: 0.2, 150.0: 0.3})), "mu.function.y"),
    "own law of friction": (lambda: scene(contact=type("Law", (Rough,), {"__module__": __name__}), friction=0.3),
                            lambda: scene(contact=type("Law", (fx.Contact,), {"shear_limit": lambda s, p, m: (m * p, m),
                                                                              "__module__": __name__}), friction=0.3),
                            "shear_limit"),
    "temperature": (lambda: scene(temperature=lambda R, Z: 100.0 + R),
                    lambda: scene(temperature=lambda R, Z: 120.0 - R),
                    "temperature.sums"),
}


def about(make):
    """The description needs a problem only for its sizes."""
    made = make()
    forms = SimpleNamespace(length=20.0, domain=made.mesh.domain)
    return describe(SimpleNamespace(scene=made, forms=forms, n_unknowns=0, comm=made.mesh.comm))


@pytest.mark.parametrize("name", CHANGES)
def test_a_changed_function_is_a_difference(name):
    there, here, place = CHANGES[name]
    assert list(differences(about(there), about(there))) == []
    found = [where for where, *_ in differences(about(there), about(here))]
    assert any(part in where for where in found for part in place.split("|")), found


def test_a_changed_energy_is_refused_by_name(tmp_path):
    def run(material):
        return fx.Process(scene(material)).run([fx.Stage("air", control="air", until=fx.pole_height(1.0))],
                                               checkpoint=tmp_path / "run", resume=True, progress=False)
    first = run(own(a=0.01))
    assert len(run(own(a=0.01))) == len(first)
    with pytest.raises(fx.InputError, match=r"energy\.uses\.a: 0\.01 there, 0\.02 here"):
        run(own(a=0.02))
    (tmp_path / "run" / "stages.json").unlink()
    with pytest.raises(fx.InputError, match=r"has no stages\.json, by which its stages are compared"):
        run(own(a=0.01))


def test_an_object_whose_contents_are_unknown_is_named():
    generator = (x for x in range(3))
    found = list(incomparable(about(lambda: scene(relaxing(lambda T: np.exp(-(T - 100.0)) + 0 * bool(generator))))))
    assert len(found) == 1 and "generator" in found[0][0]
