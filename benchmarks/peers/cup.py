"""Problem data: a clamped sheet blown into a shallow cup without friction. Standard library only.

Mooney, W = C10 (I1 - 3) + C01 (I2 - 3), incompressible; R <= RADIUS, 0 <= Z <= THICKNESS. A follower pressure on the
bottom up to PRESSURE presses the top into a cup of the sheet's radius and DEPTH, whose edge is rounded by FILLET, with
a penalty of PENALTY (traction over depth). Result: thickness over THICKNESS at the pole. Lengths in cm, stresses in
psi.
"""

RADIUS, THICKNESS, DEPTH, FILLET, C10, C01, PRESSURE = 10.0, 0.3, 5.0, 1.0, 50.0, 15.0, 160.0
PENALTY = 2e4 * 2 * (C10 + C01) / THICKNESS
