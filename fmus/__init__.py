"""The built FMUs, the table of their ports and their cross-check results."""
