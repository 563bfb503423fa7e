"""The native runtime: a shared library for each platform, from the emitted kernels and C around them.

`targets` lists the platforms, `emit` turns the kernels into object code, `library` compiles and links. In C, `instance.h` is
one instance of a twin for any version of FMI (`instance.c`, `saved.c`), and `fmi2.c` is FMI 2.0 as an adapter of it. The
extra [build] brings all that is needed: numba and llvmlite emit, ziglang compiles and links for every platform.
"""
