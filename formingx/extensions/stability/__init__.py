"""Loss of stability and buckling modes of axisymmetric bodies."""
