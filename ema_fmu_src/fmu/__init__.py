"""The FMUs: model description, native and Python runtime, packaging."""
