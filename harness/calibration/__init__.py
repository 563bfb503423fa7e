"""An actuator's parameters from runs that are known to be healthy."""
