"""Actuators: what a user knows of the own one, from an actuator file, a parameter set or the library."""
