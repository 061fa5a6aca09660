"""Problem data: a clamped disc loaded by a follower pressure in equal steps. Standard library only.

Neo-Hookean, W = C10 (I1 - 3), incompressible; R <= RADIUS, 0 <= Z <= THICKNESS; the bottom under a pressure that rises
to PRESSURE in STEPS equal steps, each by Newton's method. u_R = 0 on the axis; the rim is fixed. Result: the rise of
the middle of the bottom.
"""

RADIUS, THICKNESS, C10, PRESSURE, STEPS = 10.0, 1.0, 1.0, 0.05, 5
