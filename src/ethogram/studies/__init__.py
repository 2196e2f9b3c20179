"""The studies, by name; other packages add theirs under the entry point `ethogram.studies`."""

from ethogram.core.registry import Registry

STUDIES = Registry("study", "ethogram.studies", {"sharing": "ethogram.studies.sharing"})
