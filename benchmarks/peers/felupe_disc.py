"""A disc with FElupe: what loading and plug share. FElupe's axis is x.

Biquadratic quadrilaterals of nearly incompressible material that keep pressure and volume to themselves.
"""

import felupe as fem


def disc(elements, radius, thickness, c10):
    """(mesh, field of displacements, solid body): elements along the radius and through the thickness."""
    n, m = elements
    mesh = fem.Rectangle(b=(thickness, radius), n=(m + 1, n + 1)).add_midpoints_edges().add_midpoints_faces()
    mesh = fem.Mesh(mesh.points, mesh.cells, "quad9")
    field = fem.FieldContainer([fem.FieldAxisymmetric(fem.RegionBiQuadraticQuad(mesh), dim=2)])
    return mesh, field, fem.SolidBodyNearlyIncompressible(fem.NeoHooke(mu=2 * c10), field, bulk=5000 * 2 * c10)
