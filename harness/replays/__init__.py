"""A log flown again by a twin, and how far the two are apart."""
