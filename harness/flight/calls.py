"""Calls of FMI 2.0 functions from compiled code, through their addresses in the library that FMPy has loaded.

What numba keeps of a loop is as old as the loop's own file: whoever changes a call here changes the files of the loops too.
"""

import ctypes
from typing import Any

from fmpy.fmi1 import FMICallException
from fmpy.fmi2 import FMU2Slave
from llvmlite import ir
from numba import types
from numba.extending import intrinsic

CALLS = ("fmi2SetReal", "fmi2SetRealInputDerivatives", "fmi2SetInteger", "fmi2SetBoolean", "fmi2DoStep",
         "fmi2GetReal", "fmi2GetInteger", "fmi2GetBoolean", "fmi2SetString", "fmi2GetString")  # fmt: skip
(SET_REAL, SET_SLOPE, SET_INTEGER, SET_BOOLEAN, DO_STEP,
 GET_REAL, GET_INTEGER, GET_BOOLEAN, SET_STRING, GET_STRING) = range(len(CALLS))  # fmt: skip
"""Places in CALLS."""
STATUSES = ("fmi2OK", "fmi2Warning", "fmi2Discard", "fmi2Error", "fmi2Fatal", "fmi2Pending")
WARNING = 1
"""The worst status with which a run goes on."""
NEGATIVE = 2**30
"""From here on: a negative status, which FMI does not know and which no `>` would find, plus 2**31."""


class FMU2Checked(FMU2Slave):  # type: ignore[misc] # FMPy has no types, and goes by the first letters of the name
    """FMPy's slave, which takes a negative status for success: FMICallException for that too."""

    def _call(self, name: str, *arguments: Any) -> Any:
        result = super()._call(name, *arguments)
        if isinstance(result, int) and result < 0:
            raise FMICallException(name, result)
        return result


def addresses(slave: Any) -> tuple[int, ...]:
    """Address of each of CALLS in the library of FMPy's `slave`; 0 for one that it does not have."""
    return tuple(_address(slave.dll, name) for name in CALLS)


def _address(library: Any, name: str) -> int:
    try:
        return int(ctypes.cast(getattr(library, name), ctypes.c_void_p).value or 0)
    except AttributeError:
        return 0


def instance_address(slave: Any) -> int:
    """Address of the instance of FMPy's `slave`: the first argument of each call."""
    return int(ctypes.cast(slave.component, ctypes.c_void_p).value or 0)


def status_name(status: int) -> str:
    """Such as fmi2Fatal; of a status as the calls below answer it."""
    status = status - 2**31 if status >= NEGATIVE else status
    return STATUSES[status] if 0 <= status < len(STATUSES) else f"status {status}"


def _call(context: Any, builder: Any, signature: Any, values: Any) -> Any:
    """Code of a call through the address `values[0]`: an `int` function in C of the arguments that follow."""
    kinds = {types.intp: ir.IntType(64), types.float64: ir.DoubleType(), types.int32: ir.IntType(32)}
    function = ir.FunctionType(ir.IntType(32), [kinds[argument] for argument in signature.args[1:]])
    status = builder.call(builder.inttoptr(values[0], function.as_pointer()), values[1:])
    low, negative = (ir.Constant(status.type, value) for value in (NEGATIVE - 1, NEGATIVE))
    beyond = builder.or_(builder.and_(status, low), negative)
    return builder.select(builder.icmp_signed("<", status, ir.Constant(status.type, 0)), beyond, status)


@intrinsic
def call_values(typing_context, address, component, value_references, n, values):  # type: ignore[no-untyped-def]
    """fmi2Set<Type> and fmi2Get<Type>(component, value_references, n, values)."""
    return types.int32(types.intp, types.intp, types.intp, types.intp, types.intp), _call


@intrinsic
def call_slopes(typing_context, address, component, value_references, n, orders, values):  # type: ignore[no-untyped-def]
    """fmi2SetRealInputDerivatives(component, value_references, n, orders, values)."""
    return types.int32(types.intp, types.intp, types.intp, types.intp, types.intp, types.intp), _call


@intrinsic
def call_step(typing_context, address, component, time, size, no_set_state_prior):  # type: ignore[no-untyped-def]
    """fmi2DoStep(component, currentCommunicationPoint, communicationStepSize, noSetFMUStatePriorToCurrentPoint)."""
    return types.int32(types.intp, types.intp, types.float64, types.float64, types.int32), _call


@intrinsic
def byte_at(typing_context, address):  # type: ignore[no-untyped-def]
    """The byte at an address."""

    def load(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        return builder.load(builder.inttoptr(values[0], ir.IntType(8).as_pointer()))

    return types.uint8(types.intp), load
