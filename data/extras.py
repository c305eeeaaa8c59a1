"""Packages that come with an extra of viewcell, and what to say where one is missing."""

from importlib.util import find_spec

from .errors import InputError

# Extra by package, as imported.
EXTRAS = {
    "ifcopenshell": "ifc",
    "DracoPy": "formats",
    "ezdxf": "formats",
    "jax": "tune",
    "clarabel": "tune",
    "nlopt": "tune",
    "matplotlib": "plots",
}


def need(package: str) -> None:
    """Refuse to go on without a package of an extra.

    Raises:
        InputError: it is not installed.
    """
    if find_spec(package) is None:
        raise missing(ModuleNotFoundError(name=package))


def missing(error: ModuleNotFoundError) -> InputError | ModuleNotFoundError:
    """The same error, as one that says what to install if an extra brings it."""
    package = (error.name or "").partition(".")[0]
    if package not in EXTRAS:
        return error
    return InputError(
        f"expected the package {package}, found none; pip install 'viewcell[{EXTRAS[package]}]' brings it"
    )
