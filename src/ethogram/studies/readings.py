"""Readings of a source's text: what each changes in the settings, and the names of others."""

import hashlib
import json
from collections.abc import Mapping
from typing import Any

Scalar = str | int | float | None
Readings = Mapping[str, Mapping[str, Scalar]]  # by name, the settings by dotted key

DEFAULT = "default"  # the reading that changes nothing


def keys_of(known: Readings) -> tuple[str, ...]:
    """The settings that any of some readings changes."""
    return tuple(dict.fromkeys(key for changes in known.values() for key in changes))


def reading_of(settings: Mapping[str, Any], default: Mapping[str, Any], known: Readings) -> str:
    """The name of the reading that settings are of, given those of the default.

    Args:
        settings: by dotted key, at least `keys_of(known)`.
        default: likewise.
        known: by name.

    Returns:
        A name that is known, or for any other combination one made of what it changes.

    """
    changes = {key: settings[key] for key in keys_of(known) if settings[key] != default[key]}
    for name, named in known.items():
        if changes == named:
            return name
    if len(changes) == 1:
        ((key, value),) = changes.items()
        return f"{key.rpartition('.')[2]}_{value}"
    text = json.dumps(changes, sort_keys=True)
    return f"reading_{hashlib.sha256(text.encode()).hexdigest()[:8]}"
