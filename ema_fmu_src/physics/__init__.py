"""The twins' equations: scalar functions of floats, one block a file, symbols as in the paper.

Every function is compiled by numba where numba is there and is plain Python where it is not; none allocates, none
knows of FMUs, files or plots. Suffixes _a, _b, _c are the phases; angles are in rad, theta is mechanical and theta_e
electrical; positions of the user shaft are x = theta / G.
"""
