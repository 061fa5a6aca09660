"""What should be made: derivatives of a run by the numbers of its script, and searches that use them."""
