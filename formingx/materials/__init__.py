"""Materials: strain energies, internal variables, and stresses in homogeneous tests."""
