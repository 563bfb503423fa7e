"""A process of its own for FMUs, and what goes between it and this one."""
