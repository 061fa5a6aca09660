"""A clamped disc loaded by a follower pressure in equal steps: what every code solves. Standard library only.

Neo-Hookean, W = C10 (I1 - 3), incompressible; R <= RADIUS, 0 <= Z <= THICKNESS; the bottom under a pressure that rises
to PRESSURE in STEPS equal steps, each by Newton's method. u_R = 0 on the axis; the rim is held. Result: how far the
middle of the bottom rises.
"""

RADIUS, THICKNESS, C10, PRESSURE, STEPS = 10.0, 1.0, 1.0, 0.05, 5
