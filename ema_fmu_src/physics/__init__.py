"""The twins' equations: functions of floats and of named tuples of floats, one block a file.

Symbols are the paper's where it has them; `symbols` says what each means and in which unit. Every function is compiled by
numba where numba is there and is plain Python where it is not; none allocates, none knows of FMUs, files or plots.
"""
