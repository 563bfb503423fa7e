"""What becomes an FMU: the ports, the physics, the twins and their two FMI 2.0 runtimes."""

__version__ = "0.2.0"
__author__ = "The EMA twins contributors"
__copyright__ = "Copyright (c) 2026 the EMA twins contributors"
__license__ = "MIT"
