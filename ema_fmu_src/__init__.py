"""What becomes an FMU: the ports, the physics, the twins and their two FMI 2.0 runtimes."""

__version__ = "0.2.0"
