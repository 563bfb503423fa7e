"""No output of any fidelity moves by a bit, in either runtime: two FMI implementations around the same equations."""

from pathlib import Path

import pytest
from recorded import Case, cases, hashes, recorded

CASES = list(cases())
EXPECTED = recorded()


def test_all_cases_are_recorded_and_differ() -> None:
    assert set(EXPECTED) == {case.name for case in CASES}
    healthy, faulted = EXPECTED["SIN HF healthy held"], EXPECTED["SIN HF faulted held"]
    assert all(
        healthy[name] != faulted[name]
        for name in healthy
        if name not in ("voltage_saturated", "voltage_saturated_real", "end_stop_torque")
    )


@pytest.mark.parametrize("case", CASES, ids=lambda case: case.name)
def test_native_to_the_last_bit(fmus: dict[str, Path], case: Case) -> None:
    expected = EXPECTED[case.name]
    found = hashes(case.fly(fmus["HF"].parent))
    assert {name: found[name] for name in expected} == expected


@pytest.mark.parametrize("case", [case for case in CASES if not case.ramps], ids=lambda case: case.name)
def test_python_to_the_last_bit(python_fmus: dict[str, Path], case: Case) -> None:
    expected = EXPECTED[case.name]
    found = hashes(case.fly(python_fmus["HF"].parent))
    assert {name: found[name] for name in expected} == expected
