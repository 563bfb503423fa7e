"""Logs: measured runs as they are, from any file, in the ports' names and units."""
