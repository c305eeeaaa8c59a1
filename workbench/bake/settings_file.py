"""Settings of a bake in a JSON file: an object with keys of `Settings`, or a file that `viewcell tune` has written."""

import dataclasses
import json
from dataclasses import dataclass
from pathlib import Path

from ...data.errors import InputError
from ...data.store.scene_folder import one_line
from .settings import Settings

# What a bake takes from a tune file and stores in its manifest.
KEPT = ("lod",)


@dataclass(frozen=True)
class SettingsFile:
    """What a file says.

    Attributes:
        settings: values by key of `Settings`; keys that the file leaves out are absent.
        tuned: parts of a tune file that a bake's manifest stores, by name; empty for plain settings.
        says: what a tune file says that it does, beside the default, in a line; empty if it says nothing.
    """

    settings: dict[str, object]
    tuned: dict[str, dict]
    says: str = ""

    @property
    def line(self) -> str:
        """What whoever bakes with the file should know of it; empty if there is nothing."""
        method, usual = self.settings.get("method"), Settings().method
        if self.says or method in (None, usual):
            return self.says
        return f"Changes the method from {usual}, the default, to {method}."


def read_settings(path: str | Path) -> SettingsFile:
    """What a settings or tune file says.

    Raises:
        InputError: it is unreadable, no JSON object, has a key that `Settings` does not know, or a value of another
            type.
    """
    path = Path(path)
    try:
        found = json.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise InputError(f"{path}: expected a settings file, found {error.strerror}") from None
    except ValueError as error:
        raise InputError(f"{path}: expected JSON, found {one_line(error)}") from None
    if not isinstance(found, dict):
        raise InputError(f"{path}: expected a JSON object, found {type(found).__name__}")
    tuned, says = {}, ""
    if "tuned" in found:
        says = found.get("says", "")
        if not isinstance(says, str):
            raise InputError(f"{path}: expected text as says, found {type(says).__name__}")
        tuned = {name: found[name] for name in KEPT if name in found}
        found = found.get("settings", {})
        for name, part in (("settings", found), *tuned.items()):
            if not isinstance(part, dict):
                raise InputError(f"{path}: expected an object as {name}, found {type(part).__name__}")
    defaults = {field.name: field.default for field in dataclasses.fields(Settings)}
    for name, value in found.items():
        if name not in defaults:
            raise InputError(f"{path}: expected keys among {', '.join(defaults)}; found {name!r}")
        if not _fits(value, defaults[name]):
            raise InputError(f"{path}: expected {name} to be like {json.dumps(defaults[name])}, found {value!r}")
    return SettingsFile(
        {name: type(defaults[name])(value) for name, value in found.items()}, tuned, " ".join(says.split())
    )


def _fits(value: object, default: object) -> bool:
    """Whether JSON's value is of the default's type: 4.0 may be written 4, and true is no number."""
    return type(value) in (int, float) if isinstance(default, float) else type(value) is type(default)
