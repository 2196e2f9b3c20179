"""The studies, by name; other packages add theirs under the entry point `ethogram.studies`."""

from typing import TYPE_CHECKING

from ethogram.core.registry import Registry

if TYPE_CHECKING:  # listing names must not load JAX
    from ethogram.campaign.study import Study

STUDIES: "Registry[Study]" = Registry(
    "study",
    "ethogram.studies",
    {
        "language": "ethogram.studies.language",
        "publishing": "ethogram.studies.publishing",
        "sensing": "ethogram.studies.sensing",
        "sharing": "ethogram.studies.sharing",
    },
)
