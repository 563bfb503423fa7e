"""The native runtime: a shared library for each platform, from the emitted kernels and one generic C file.

`targets` names the platforms, `emit` turns the kernels into object code, `library` compiles and links; `fmi2.c` is the FMI
API. The extra [build] has all that is needed: numba and llvmlite emit, ziglang compiles and links for every platform.
"""
