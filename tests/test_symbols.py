"""The table of symbols holds what the equations use, and agrees with the ports."""

import inspect
import pkgutil
from importlib import import_module
from types import ModuleType

import pytest

from ema_fmu_src import physics, ports
from ema_fmu_src.physics.phases import Abc
from ema_fmu_src.physics.symbols import SYMBOLS, Symbol, find

MODULES = [
    import_module(found.name) for found in pkgutil.walk_packages(physics.__path__, f"{physics.__name__}.") if not found.ispkg
]


def kernels(module: ModuleType) -> dict[str, list[str]]:
    """Public kernel of the module -> its arguments."""
    found = {name: getattr(item, "py_func", item) for name, item in vars(module).items() if not name.startswith("_")}
    return {
        name: list(inspect.signature(item).parameters)
        for name, item in found.items()
        if inspect.isfunction(item) and item.__module__ == module.__name__ and "." not in item.__qualname__
    }


def records(module: ModuleType) -> dict[str, list[str]]:
    """Named tuple of the module -> its fields."""
    return {
        name: list(item._fields)
        for name, item in vars(module).items()
        if isinstance(item, type) and issubclass(item, tuple) and item.__module__ == module.__name__
    }


def test_modules_are_found() -> None:
    names = {module.__name__.removeprefix(f"{physics.__name__}.") for module in MODULES}
    assert {"windings", "controller.cascade", "modulator.hysteresis"} <= names
    assert sum(len(kernels(module)) for module in MODULES) > 30
    assert sum(len(records(module)) for module in MODULES) > 6


@pytest.mark.parametrize("module", MODULES, ids=lambda module: module.__name__.split("physics.")[1])
def test_every_name_of_an_equation_is_in_the_table(module: ModuleType) -> None:
    if module.__name__.endswith((".jit", ".symbols")):
        return
    for kernel, arguments in kernels(module).items():
        assert {name for name in arguments if find(name) is None} == set(), kernel
    for record, fields in records(module).items():
        assert record == Abc.__name__ or {name for name in fields if find(name) is None} == set(), record


@pytest.mark.parametrize("symbol", SYMBOLS.values(), ids=lambda symbol: symbol.name)
def test_a_symbol_has_the_unit_of_its_port(symbol: Symbol) -> None:
    assert symbol.meaning
    if symbol.port:
        assert symbol.unit == ports.VARIABLES[ports.INDEX[symbol.port]].unit


def test_every_symbol_is_there_once() -> None:
    source = inspect.getsource(import_module(f"{physics.__name__}.symbols"))
    assert len(SYMBOLS) == source.count("    Symbol(")
