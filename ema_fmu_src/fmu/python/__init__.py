"""The Python runtime: the kernels as they are, in pythonfmu's binaries.

`slave` is one instance of a twin as pythonfmu drives it, `packing` what goes into the FMU. It serves to change the physics
without a compiler, and as a second, independent FMI implementation that the native one is compared with.
"""
