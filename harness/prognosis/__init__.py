"""Faults followed over many runs: their trend, and the remaining useful life, in the vocabulary of NASA's progpy."""
