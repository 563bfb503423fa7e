"""Control laws, from the command and the measured motion to the current reference I_ref: one law a file.

A law has its gains as a named tuple, `sampled(...)` for the twins whose controller ticks (HF, ELF) and `continuous(...)`
for LF's simplified control logic. A twin takes the law through `twins.actuator.control`, where it is chosen.
"""
