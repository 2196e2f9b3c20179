"""The worlds, by name; other packages add theirs under the entry point `ethogram.worlds`."""

from ethogram.core.registry import Registry

WORLDS = Registry("world", "ethogram.worlds", {"sharing": "ethogram.worlds.sharing:Sharing"})
