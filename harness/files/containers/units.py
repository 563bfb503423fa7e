"""Units that a container keeps beside its arrays: a group `units` with a text for each name."""

from collections.abc import Iterable
from dataclasses import replace

from harness.files.containers.arrays import Array


def with_units(arrays: Iterable[Array]) -> list[Array]:
    """The arrays of numbers, each with the text of `units.NAME`, beside it or above, as its unit; texts are left out."""
    found = list(arrays)
    texts = {array.path.lower(): str(array.values) for array in found if array.values.dtype.kind == "U"}
    numbers = [array for array in found if array.values.dtype.kind != "U"]

    def unit(array: Array) -> str:
        parent, leaf = (f"{array.parent}." if array.parent else "").lower(), array.leaf.lower()
        return array.unit or texts.get(f"{parent}units.{leaf}", texts.get(f"units.{leaf}", ""))

    return [replace(array, unit=unit(array)) for array in numbers]
