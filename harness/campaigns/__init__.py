"""Fault campaigns: many runs over the fault space, on all cores or a Dask cluster, as one labelled dataset."""
