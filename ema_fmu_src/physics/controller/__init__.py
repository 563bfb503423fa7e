"""Control laws, from the command and the measured motion to the current reference I_ref: one law a file.

A law has its gains as a named tuple and `sampled(...)`, which takes what it remembers (`derivative.Memory`) and returns it
anew. LF takes the cascade with a gain of the integral of 0 and its own step for a period, and of the PID the form
`continuous(...)`. A twin takes the law through `twins.drive.control`, where it is chosen.
"""
