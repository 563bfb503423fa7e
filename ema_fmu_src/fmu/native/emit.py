"""Emits the kernels of a twin as object code without Python, for any target, on any machine.

It runs as a program of its own (`python -m ema_fmu_src.fmu.native.emit MODEL FOLDER TRIPLE ...`), because numba reads its
target processor from the environment when it is imported: a generic one here, so that the code runs on every machine of
the target's architecture.

The method: numba compiles `initialize` and `advance` for plain pointers to float64. In the LLVM module everything except
these two is made internal, so that numba's wrappers for Python are eliminated; the rest is optimised and emitted for each
target. The result must not call anything outside the kernels and must not be able to raise. The method depends on numba's
mangled names and calling convention and on llvmlite's pass builder: pyproject pins both.
"""

import re
import sys
from pathlib import Path
from typing import Any

ENVIRONMENT = {"NUMBA_CPU_NAME": "generic", "NUMBA_CPU_FEATURES": "", "NUMBA_OPT": "3", "NUMBA_DISABLE_JIT": "0"}
"""Environment variables that `main` needs."""

ENTRY = """
define hidden i32 @ema_{name}({arguments}) align 64 {{
  %result = alloca i64
  %exception = alloca ptr
  %code = call i32 @{kernel}(ptr %result, ptr %exception, {arguments})
  %status = load i64, ptr %result
  %narrow = trunc i64 %status to i32
  ret i32 %narrow
}}
"""
"""`int ema_NAME(ARGUMENTS)` around numba's own `int kernel(result *, exception **, ARGUMENTS)`, whose code is not 0 only
after a raise; `_kernel_module` makes sure that there is none. Aligned to a cache line, because LF takes 6 % more time where
the linker happens to put it badly."""

INSTRUCTIONS = re.compile(r"llvm\.(fabs|sqrt|memset|memcpy|assume|lifetime|smax|smin|umax|umin)\b.*")
"""LLVM intrinsics that become instructions (exact or correctly rounded), memset or memcpy on every target."""


class EmitError(RuntimeError):
    """A kernel that cannot run without Python, and why."""


def _kernel_module(llvm: Any, function: Any, name: str, numbers: int) -> Any:
    """The LLVM module of a kernel of two pointers and `numbers` float64: an entry `ema_<name>`, everything else internal."""
    from numba import types

    pointer = types.CPointer(types.float64)
    signature = (pointer, pointer, *[types.float64] * numbers)
    function.compile(signature)
    result = types.unliteral(function.overloads[signature].signature.return_type)
    if getattr(result, "dtype", result) != types.int64:  # an IntEnum is held as its numbers are
        raise EmitError(f"{name}: returns {result}; a Status (int64) is needed")
    kernel = function.overloads[signature].fndesc.llvm_func_name
    arguments = ", ".join(["ptr %v", "ptr %x", *(f"double %t{n}" for n in range(numbers))])
    text = function.inspect_llvm(signature)
    if ".const.picklebuf." in text:  # what numba keeps of an exception
        raise EmitError(f"{name}: a kernel can raise; a status code is needed instead")
    module = llvm.parse_assembly(text + ENTRY.format(name=name, arguments=arguments, kernel=kernel))
    for item in (*module.functions, *module.global_variables):
        if not item.is_declaration and item.name != f"ema_{name}":
            item.linkage = llvm.Linkage.internal
    return module


def _optimise(llvm: Any, module: Any, machine: Any) -> None:
    """Run LLVM's pipeline at -O3, without fast-math, which would change the bits."""
    options = llvm.create_pipeline_tuning_options(speed_level=3)
    options.slp_vectorization = True  # two phases at once, the same bits: ELF 4 % less time, HF at a carrier 6 %
    builder = llvm.create_pass_builder(machine, options)
    passes = builder.getModulePassManager()
    passes.add_global_dead_code_eliminate_pass()
    passes.run(module, builder)


def _checked(module: Any, model: str) -> Any:
    """`module`; EmitError if it calls anything outside itself."""
    outside = [item.name for item in (*module.functions, *module.global_variables) if item.is_declaration]
    outside = [name for name in outside if not INSTRUCTIONS.fullmatch(name)]
    outside += ["fmod (a remainder of floats)"] if " frem " in str(module) else []
    if outside:
        raise EmitError(f"{model}: the kernels call {', '.join(sorted(outside))}; only arithmetic can be emitted")
    return module


def emit(model: str, triples: list[str]) -> dict[str, bytes]:
    """Object code with `ema_initialize` and `ema_advance` of the twin `model`, for each of the LLVM target `triples`.

    EmitError if a kernel needs Python, or if the environment is not `ENVIRONMENT`.
    """
    import llvmlite.binding as llvm
    from numba.core import config

    from ...physics import jit

    jit.OPTIONS["no_cpython_wrapper"] = True  # nobody calls these kernels from Python: a quarter of the time
    from ...twins import TWINS

    if getattr(config, "CPU_NAME", None) != ENVIRONMENT["NUMBA_CPU_NAME"]:
        raise EmitError(f"numba would compile for this machine: set {ENVIRONMENT} before it is imported")
    llvm.initialize_all_targets()
    llvm.initialize_all_asmprinters()
    twin = TWINS[model]
    module = _kernel_module(llvm, twin.initialize, "initialize", 0)
    module.link_in(_kernel_module(llvm, twin.advance, "advance", 1))
    text = str(module)
    objects = {}
    for triple in triples:
        machine = llvm.Target.from_triple(triple).create_target_machine(opt=3, reloc="pic", codemodel="default")
        own = llvm.parse_assembly(text)
        own.triple = triple
        own.data_layout = str(machine.target_data)
        _optimise(llvm, own, machine)
        objects[triple] = machine.emit_object(_checked(own, model))
    return objects


def main() -> int:
    """Write FOLDER/MODEL-TRIPLE.o for each TRIPLE; exit code 2 and one line on stderr if that is not possible."""
    model, folder, *triples = sys.argv[1:]
    try:
        for triple, code in emit(model, triples).items():
            (Path(folder) / f"{model}-{triple}.o").write_bytes(code)
    except EmitError as error:
        print(error, file=sys.stderr)
        return 2
    return 0


if __name__ == "__main__":
    sys.exit(main())
