"""Problem data: a flat plug that sticks, as driven nodes (Song 1993, 6.1 to 6.4). Standard library only.

Neo-Hookean, W = C10 (I1 - 3), incompressible; R <= RADIUS, 0 <= Z <= THICKNESS. The bottom within R <= PLUG moves up by
TRAVEL and not sideways, the rest of it is free; u_R = 0 on the axis; the rim is fixed. Result: the driving force. (The
stress at R = PLUG is singular, so forces converge slowly.) Lengths in cm, stresses in MPa.
"""

RADIUS, THICKNESS, PLUG, C10, TRAVEL = 8.0, 0.6, 2.0, 0.448, 4.0
