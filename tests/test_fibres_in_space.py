"""Laws whose energy depends on the direction in a sheet in three dimensions, and their order of axes in F."""

import numpy as np
import pytest
import ufl
from scipy.optimize import brentq
from test_terms import Fibres

import formingx as fx

C10, K = 0.3, 1.2


def strip(material, model=None):
    """A square pulled along x whose sides are free."""
    sheet = fx.mesh.sheet([(0, 0), (1, 0), (1, 1), (0, 1)], size=0.4, names=["y0", "pull", "free", "x0"])
    return fx.Scene(mesh=sheet, thickness=0.01, materials=material, model=model or fx.Membrane(), supports=[
        fx.Symmetry("x0", "x"), fx.Symmetry("y0", "y"), fx.Symmetry("y0", "z", guide=True),
        fx.PrescribedDisplacement("pull", "x", name="grip")])


def pull(scene, travel=0.5):
    path = fx.trace(scene, until=fx.travel(travel), progress=False)
    return abs(path.last.measures["support_force"]) / (2 * 0.01)              # of the mirror image, too


def pulled_across(l):
    """Nominal stress of fibres across the pull: dW/dm = 0 gives the stretch m along them."""
    m = brentq(lambda m: 2 * C10 * (m - 1 / (l**2 * m**3)) + K * (m**2 - 1) * m, 0.3, 1.2)
    return 2 * C10 * (l - 1 / (l**3 * m**2))


@pytest.mark.parametrize("angle, stress", [
    (0.0, 2 * C10 * (1.5 - 1.5**-2) + K * (1.5**2 - 1) * 1.5), (np.pi / 2, pulled_across(1.5)),
    (lambda x, y, z: np.pi / 2 + 0 * x, pulled_across(1.5))])
def test_fibres_along_and_across_the_pull(angle, stress):
    """Direction 1 is x, direction 2 the normal, direction 3 is y; triangles of any direction give the closed form."""
    assert pull(strip(Fibres(c10=C10, k=K, angle=angle))) == pytest.approx(stress, rel=1e-6)


class Normal(Fibres):
    """Fibres along the normal of the sheet."""

    def strain_energy(self, F, c10, k, angle):
        n = F * ufl.as_vector([0, 1, 0])
        return c10 * (ufl.inner(F, F) - 3) + k / 4 * (ufl.inner(n, n) - 1) ** 2


def test_direction_two_is_the_normal():
    m = brentq(lambda m: 2 * C10 * (m - 1 / (1.5**2 * m**3)) - K * (1 / (1.5 * m) ** 2 - 1) / (1.5**2 * m**3), 0.3, 1.2)
    stress = 2 * C10 * (1.5 - 1 / (1.5**3 * m**2)) - K * (1 / (1.5 * m) ** 2 - 1) / (1.5**3 * m**2)
    assert pull(strip(Normal(c10=C10, k=K, angle=0.0))) == pytest.approx(stress, rel=1e-6)


class Pair(fx.Material):
    """Two families of fibres at an angle to both sides of a direction that may vary."""

    def __init__(self, *, c10, k, angle, middle):
        self.parameters = {"c10": c10, "k": k, "angle": angle, "middle": middle}
        self.check()

    def strain_energy(self, F, c10, k, angle, middle):
        found = c10 * (ufl.inner(F, F) - 3)
        for sign in (-1, 1):
            a = F * ufl.as_vector([ufl.cos(middle + sign * angle), 0, ufl.sin(middle + sign * angle)])
            found += k / 8 * (ufl.inner(a, a) - 1) ** 2
        return found


def volume(scene):
    return fx.trace(scene, until=fx.pressure(0.006), progress=False)["enclosed_volume"][-1]


def test_a_disc_of_fibres_is_that_of_the_section():
    """Fibres at angles from the radius, as a field of (x, y): the volume under the membrane of revolution."""
    found = []
    for angle in (0.0, 0.7, np.pi / 2):
        section = fx.Scene(mesh=fx.mesh.disc(radius=1.0, thickness=0.01, elements=(30, 1)), model=fx.Membrane(),
                           materials=Pair(c10=C10, k=K, angle=angle, middle=0.0), loads=[fx.Pressure("bottom")],
                           supports=[fx.Symmetry("axis"), fx.SimplySupported("rim")])
        sheet = fx.Scene(mesh=fx.mesh.sheet(fx.mesh.circle(1.0, part="quarter"), size=0.0375), thickness=0.01,
                         materials=Pair(c10=C10, k=K, angle=angle, middle=lambda x, y, z: np.arctan2(y, x)),
                         loads=[fx.Pressure("bottom")], model=fx.Membrane(),
                         supports=[fx.SimplySupported("rim"), fx.Symmetry("x0", "x"), fx.Symmetry("y0", "y")])
        found.append([volume(section), volume(sheet)])
    section, sheet = np.transpose(found)
    assert np.ptp(section) > 0.1 * section.min()             # the angle matters
    assert sheet == pytest.approx(section, rel=5e-3)


class Isochoric(Fibres):
    """Fibres with a term that has no value for a negative determinant of F, and is 0 for a determinant of 1."""

    def strain_energy(self, F, c10, k, angle):
        return super().strain_energy(F, c10, k, angle) + ufl.ln(ufl.det(F)) ** 2


@pytest.mark.parametrize("angle, stiff", [(0.0, 0.0), (np.pi / 2, K)])
def test_direction_one_of_a_tube_is_its_meridian_and_direction_three_the_hoop(angle, stiff):
    """A thin ring in plane strain: p r = h dW/dl with l = r/R. The determinant of F is 1 there, too."""
    ring = fx.Scene(mesh=fx.mesh.tube(radius=1.0, length=0.2, elements=(2, 16), part="quarter"), thickness=0.01,
                    materials=Isochoric(c10=C10, k=K, angle=angle), model=fx.Membrane(), loads=[fx.Pressure("inner")],
                    supports=[*(fx.Symmetry(name, "z", guide=True) for name in ("neck", "end")),
                              fx.Symmetry("x0", "x"), fx.Symmetry("y0", "y")])
    path = fx.trace(ring, until=fx.enclosed_volume(0.2 * np.pi * (1.4**2 - 1)), progress=False)
    stress = 2 * C10 * (1.4 - 1.4**-3) + stiff * (1.4**2 - 1) * 1.4
    assert path["pressure"][-1] == pytest.approx(0.01 * stress / 1.4, rel=2e-3)


@pytest.mark.thorough
@pytest.mark.parametrize("material", [
    fx.MooneyRivlin(c10=0.3, c01=0.1), fx.Ogden(mu=[0.3, -0.05], alpha=[1.8, -2.2]),
    fx.Viscoelastic(fx.NeoHookean(c10=0.2), [(0.5, 0.3)])])
def test_isotropic_laws_have_the_same_energy_in_both_orders(material, monkeypatch):
    """A law of two parts, isotropic and of fibres, takes F in the order of the second."""
    def force():
        scene = strip(material)
        path = fx.Process(scene).run([fx.Stage("pull", control="grip", until=fx.travel(0.4), duration=1.0)],
                                     progress=False)
        return path.last.measures["support_force"]
    usual = force()
    monkeypatch.setattr("formingx.extensions.space.surface.depends_on_direction", lambda scene, name: True)
    assert force() == pytest.approx(usual, rel=1e-9)


def test_relaxed_energies_of_fibres_are_refused():
    with pytest.raises(fx.InputError, match=r"Fibres\(.*\) depends on the direction.* must be Membrane\(\)"):
        strip(Fibres(c10=C10, k=K, angle=0.2), model=fx.Membrane(wrinkles=0.01))
    strip(fx.NeoHookean(c10=C10), model=fx.Membrane(wrinkles=0.01))


def test_isotropy_is_found_by_permuted_and_by_turned_stretches():
    class Cubic(Fibres):
        """Stiff along all three axes alike."""

        def strain_energy(self, F, c10, k, angle):
            along = [sum(F[i, j] ** 2 for i in range(3)) for j in range(3)]
            return c10 * (ufl.inner(F, F) - 3) + k / 4 * sum((square - 1) ** 2 for square in along)
    assert not Cubic(c10=C10, k=K, angle=0.0).is_isotropic() and not Fibres(c10=C10, k=K, angle=0.3).is_isotropic()
    for material in (fx.NeoHookean(c10=0.3), fx.Ogden(mu=[0.3, -0.05], alpha=[1.8, -2.2]), fx.Yeoh(
            c10=0.2, c20=0.1, c30=0.01), fx.Viscoelastic(fx.NeoHookean(c10=0.2), [(0.5, 0.3)])):
        assert material.is_isotropic()
