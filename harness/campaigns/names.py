"""Names of the features of a run; how each is computed: `features.py`."""

from collections.abc import Sequence

HARMONICS = 6


def names(kept: Sequence[str]) -> list[str]:
    """Names of the features, in order, if the outputs `kept` are kept."""
    of_outputs = [f"{name}_{kind}" for name in kept for kind in ("rms", "range")]
    harmonics = [f"current_harmonic_{k}" for k in range(1, HARMONICS + 1)]
    return [*of_outputs, "tracking_error_rms", "tracking_error_max", *harmonics, "energy_supply", "energy_copper",
            "saturated_part"]  # fmt: skip
