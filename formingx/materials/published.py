"""Published material constants with their sources, as a starting point, not for design."""

from collections.abc import Callable
from typing import NamedTuple

from .hyperelastic import MooneyRivlin, NeoHookean
from .material import Material


class Published(NamedTuple):
    """Published material constants with the conditions of their tests.

    Attributes:
        material: the material with constants in `unit`; c10 is the constant of I1, c01 the constant of I2.
        unit: unit of stress of the constants.
        substance: the tested substance.
        temperature: temperature of the tests in degrees Celsius; None if the source does not state it.
        rate: rate of the tests, as text.
        mode: tests from which the constants were fitted, as text.
        source: publication of the constants, and the work that quotes them if they are quoted.
    """

    material: Material
    unit: str
    substance: str
    temperature: float | None
    rate: str
    mode: str
    source: str


_PSI = 0.006894757293168361                                                                             # MPa
_KG_PER_CM2 = 0.0980665                                                                                 # MPa
_SONG = "W. Song, PhD thesis, McMaster University, 1993"
_THRONE = f"J. L. Throne, Adv. Polym. Technol. 9 (1989) 309-320, quoted by {_SONG}, section 6.4"
_NOT_STATED = "not stated where quoted"
_MORE: list[Callable[[], dict[str, Published]]] = []


def register_published(constants: Callable[[], dict[str, Published]]) -> Callable[[], dict[str, Published]]:
    """Add {name: `Published`} of a function to the result of `published`; usable as a decorator."""
    _MORE.append(constants)
    return constants


def published() -> dict[str, Published]:
    """Return published material constants with their sources, in MPa; for melts in Pa and s.

    The constants are valid for the stretches, temperatures and rates of their tests, as far as the source states them.
    Quoted constants were taken from the work that quotes them. `treloar1944` has test data for fits.

    Returns:
        {name: `Published`}.

    >>> acrylic = fx.published()["PMMA 160 C"]
    >>> acrylic.material, acrylic.temperature
    (NeoHookean(c10=0.44815922405594344), 160.0)
    """
    found = {
        "PMMA 160 C": Published(
            NeoHookean(c10=65 * _PSI), "MPa", "polymethyl methacrylate", 160.0, _NOT_STATED, _NOT_STATED,
            f"J. G. Williams, J. Strain Anal. 5 (1970) 49-57, quoted by {_SONG}, section 6.3"),
        "PMMA 163 C": Published(
            NeoHookean(c10=40 * _PSI), "MPa", "polymethyl methacrylate", 163.0, "a sheet is formed in about 6 s",
            "estimated from sigma = K t^-0.05 epsilon with K = 240 psi, relaxation left out: K = 6 c10",
            f"{_SONG}, section 4.4, from M. O. Lai and D. L. Holt, J. Appl. Polym. Sci. 19 (1975) 1209 and 1805"),
        "natural rubber, Treloar's sheet": Published(
            NeoHookean(c10=2.0 * _KG_PER_CM2), "MPa", "rubber with 8 % sulphur", None, _NOT_STATED,
            "inflation of a sheet",
            f"L. R. G. Treloar, Trans. Inst. Rubber Ind. 19 (1944) 201-212, quoted by {_SONG}, section 4.3.2"),
        "natural rubber, Mooney": Published(
            MooneyRivlin(c10=20.78 * _PSI, c01=4.825 * _PSI), "MPa", "natural rubber", None, _NOT_STATED, _NOT_STATED,
            f"L. R. G. Treloar, The Physics of Rubber Elasticity, Oxford 1975, quoted by {_SONG}, section 6.4"),
        "natural rubber, 0.25 mm": Published(
            MooneyRivlin(c10=17.587 * _PSI, c01=4.825 * _PSI), "MPa", "sheet of natural rubber, room temperature", None,
            _NOT_STATED, _NOT_STATED, _THRONE),
        "natural rubber, 0.76 mm": Published(
            MooneyRivlin(c10=25.11 * _PSI, c01=0.581 * _PSI), "MPa", "sheet of natural rubber, room temperature", None,
            _NOT_STATED, _NOT_STATED, _THRONE),
    }
    for constants in _MORE:
        found |= constants()
    return found
