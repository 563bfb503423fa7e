"""The built FMUs and what goes with them: the port table and the reference results."""
