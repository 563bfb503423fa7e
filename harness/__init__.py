"""Runs, compares and reports the twins, which it knows only as FMUs and by their ports."""
