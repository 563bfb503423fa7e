"""The FMUs: model description, slave, packaging."""
