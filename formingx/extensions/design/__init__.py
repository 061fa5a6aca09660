"""Design: derivatives of a run by the parameters of its script, and searches that use them."""
