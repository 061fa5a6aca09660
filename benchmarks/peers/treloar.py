"""Problem data: Treloar's sheet, hinged by the mean displacement of its rim. Standard library only.

Neo-Hookean, W = C10 (I1 - 3), incompressible; R <= RADIUS, 0 <= Z <= THICKNESS; a follower pressure on the bottom, from
0 through its maximum until the point in the middle of the pole has risen by HEIGHT (pole stretch 8.2). u_R = 0 on the
axis; over the rim the means of u_R and u_Z are 0. Lengths in cm, stresses in kg/cm2.
"""

RADIUS, THICKNESS, C10, HEIGHT = 1.25, 0.082, 2.0, 3.46
