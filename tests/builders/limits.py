"""The searches with little room: a law about full lists needs no large scene if the lists are short."""

import sys
from collections.abc import Iterator
from contextlib import contextmanager

import warp as wp


def kernel_modules() -> list[object]:
    return [module for name, module in sys.modules.items() if name.startswith("viewcell.kernels.")]


@contextmanager
def limited(**values: int) -> Iterator[None]:
    """Kernels whose constants of these names have other values; they are compiled anew, from a cache but once.

    A limit may be lowered, not raised: the scratch of a search is laid out for the largest.
    """
    changed = [(module, name) for module in kernel_modules() for name in values if hasattr(module, name)]
    assert {name for _, name in changed} == set(values)
    before = [getattr(module, name) for module, name in changed]
    modules = {module.__name__ for module, _ in changed} | {module.__name__ for module in kernel_modules()}
    try:
        for (module, name), old in zip(changed, before, strict=True):
            assert values[name] <= int(old)
            setattr(module, name, wp.constant(values[name]))
        unload(modules)
        yield
    finally:
        for (module, name), old in zip(changed, before, strict=True):
            setattr(module, name, old)
        unload(modules)


def unload(modules: set[str]) -> None:
    """Have modules hashed, and if need be compiled, before they are next used."""
    for name in modules:
        wp.get_module(name).unload()
