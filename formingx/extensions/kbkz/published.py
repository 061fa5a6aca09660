"""Published constants of K-BKZ melts."""

from ...materials.published import Published, register_published
from .damping import PSM
from .kbkz import KBKZ

_LDPE = [(129000, 1e-4), (94800, 1e-3), (58600, 0.01), (26700, 0.1), (9800, 1), (1890, 10), (180, 100), (1, 1000)]


@register_published
def melts() -> dict[str, Published]:
    """Return {name: `Published`} of melts with published K-BKZ constants, in Pa and s."""
    return {"LDPE melt 150 C": Published(
        KBKZ(_LDPE, PSM(alpha=14.38, beta=0.018)), "Pa", "low-density polyethylene, melt I", 150.0,
        "relaxation times from 1e-4 to 1000 s",
        "spectrum in small shear; damping in shear and uniaxial extension, not in equibiaxial",
        "H. M. Laun, Rheol. Acta 17 (1978) 1-15 (spectrum); A. C. Papanastasiou, L. E. Scriven, C. W. Macosko,"
        " J. Rheol. 27 (1983) 387-410 (damping); not read in the original")}
