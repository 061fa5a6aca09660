"""A flat plug that sticks, as driven nodes (Song 1993, 6.1 to 6.4): what every code solves. Standard library only.

Neo-Hookean, W = C10 (I1 - 3), incompressible; R <= RADIUS, 0 <= Z <= THICKNESS. The bottom within R <= PLUG goes up by
TRAVEL and not sideways, the rest of it is free; u_R = 0 on the axis; the rim is held. Result: the force that drives it.
(The stress at R = PLUG is singular, so forces converge slowly.) Lengths in cm, MPa.
"""

RADIUS, THICKNESS, PLUG, C10, TRAVEL = 8.0, 0.6, 2.0, 0.448, 4.0
