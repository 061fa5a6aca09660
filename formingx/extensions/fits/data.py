"""Published tests of materials, as data for fits."""

import numpy as np

# L. R. G. Treloar, "Stress-strain data for vulcanised rubber under various types of deformation", Trans. Faraday Soc.
# 40 (1944) 59-70. Read off the published curves (digitised), not tabulated by the author; points as in
# data/Treloar_1944 of github.com/Chongran-Zhao/Calibration-Hyperelasticity.
_TRELOAR_1944 = {
    "uniaxial": """1.02 .0255  1.125 .1344  1.24 .2256  1.39 .3169  1.585 .4081  1.9 .5003  2.18 .5886  2.42 .6769
        3.02 .8633  3.57 1.0497  4.03 1.2263  4.76 1.5892  5.36 1.9522  5.75 2.3152  6.15 2.6879  6.4 3.0411
        6.6 3.4139  6.85 3.7769  7.05 4.13  7.15 4.493  7.25 4.8658  7.4 5.2287  7.5 5.5917  7.6 6.3176""",
    "pure_shear": """1.03 .0667  1.12 .1589  1.19 .2452  1.31 .3326  1.46 .4189  1.84 .5925  2.38 .7652  2.97 .9418
        3.47 1.1183  3.95 1.2851  4.37 1.4617  4.69 1.6285  4.97 1.805""",
    "equibiaxial": """1.027 .0925  1.065 .157  1.115 .2387  1.14 .257  1.2 .3282  1.31 .4364  1.42 .5146  1.68 .6557
        1.94 .7652  2.49 .9617  3.03 1.2386  3.43 1.4401  3.75 1.7096  4.07 1.9845  4.26 2.2065  4.45 2.4426""",
}


def treloar1944() -> dict[str, tuple[np.ndarray, np.ndarray]]:
    """Return Treloar's (1944) tests of vulcanised rubber, digitised from his published curves.

    Returns:
        {test: (stretches, nominal stresses in MPa)}, arrays of shape (n,) each.

    >>> sorted(fx.treloar1944())
    ['equibiaxial', 'pure_shear', 'uniaxial']
    """
    points = {mode: np.array(text.split(), float).reshape(-1, 2) for mode, text in _TRELOAR_1944.items()}
    return {mode: (p[:, 0].copy(), p[:, 1].copy()) for mode, p in points.items()}
