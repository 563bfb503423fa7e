"""Faults identified from a measured run: the FMU's parameters that explain it best, and how far to trust them."""
