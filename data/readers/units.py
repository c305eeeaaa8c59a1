"""Units of length, by name or as a number of metres."""

from ..errors import InputError

METRES = {
    "metre": 1.0,
    "decimetre": 0.1,
    "centimetre": 0.01,
    "millimetre": 0.001,
    "kilometre": 1000.0,
    "inch": 0.0254,
    "foot": 0.3048,
    "yard": 0.9144,
}
OTHER_NAMES = {
    "meter": "metre",
    "m": "metre",
    "decimeter": "decimetre",
    "dm": "decimetre",
    "centimeter": "centimetre",
    "cm": "centimetre",
    "millimeter": "millimetre",
    "mm": "millimetre",
    "kilometer": "kilometre",
    "km": "kilometre",
    "in": "inch",
    "inche": "inch",
    "ft": "foot",
    "feet": "foot",
    "yd": "yard",
}


def metres_per_unit(unit: str | float) -> tuple[float, str]:
    """Length of a unit [m] and its name for the manifest.

    Args:
        unit: a name in English, singular or plural, its symbol, or a number of metres.

    Raises:
        InputError: the name is unknown, or the number is not positive and finite.
    """
    text = str(unit).strip().lower()
    name = OTHER_NAMES.get(text, text)
    name = name if name in METRES else OTHER_NAMES.get(text.rstrip("s"), text.rstrip("s"))
    if name in METRES:
        return METRES[name], name
    try:
        length = float(text)
    except ValueError:
        length = 0.0
    if not 0.0 < length < float("inf"):
        raise InputError(f"unit: expected {', '.join(METRES)} or a positive number of metres, found {unit!r}")
    return length, f"{length:g} metre"
