"""One inference of faults, parameters and nuisances from measured runs."""
