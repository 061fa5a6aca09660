"""An independent solver: the element of Song (1993), written by hand from its formulas in plain NumPy.

It stands for a hand-coded program that formingx is compared with; it shares no code with formingx, and reads its mesh
from the text file of nodes and six-node elements.
"""
