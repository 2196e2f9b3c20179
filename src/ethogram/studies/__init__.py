"""The studies, by name; other packages add theirs under the entry point `ethogram.studies`."""

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from ethogram.core.registry import Registry

if TYPE_CHECKING:  # listing names must not load JAX
    from ethogram.campaign.study import Study

_TEXTS = ("NAME", "VERSION", "TITLE", "QUESTION")
_FUNCTIONS = ("cases", "cost", "run", "tables", "figures", "claims")


def trouble_with(name: str, study: Any) -> str:
    """What keeps an object from being the study of that name (`Study`), or ""."""
    names = (*_TEXTS, "PLANS", *_FUNCTIONS)
    missing = [each for each in names if not hasattr(study, each)]
    if missing:
        return f"it lacks {', '.join(missing)}"
    for each in _TEXTS:
        if not isinstance(getattr(study, each), str):
            return f"its {each} is no text but {getattr(study, each)!r:.80}"
    if name != study.NAME:
        return f"its NAME is {study.NAME!r}, which must be that of the entry point"
    plans = study.PLANS
    if not isinstance(plans, Mapping) or not all(
        hasattr(plan, "points") for plan in plans.values()
    ):
        return "its PLANS are no plans by name"
    uncallable = [each for each in _FUNCTIONS if not callable(getattr(study, each))]
    return f"it lacks the functions {', '.join(uncallable)}" if uncallable else ""


STUDIES: "Registry[Study]" = Registry(
    "study",
    "ethogram.studies",
    {
        "criticality": "ethogram.studies.criticality",
        "language": "ethogram.studies.language",
        "publishing": "ethogram.studies.publishing",
        "rules": "ethogram.studies.rules",
        "sensing": "ethogram.studies.sensing",
        "sharing": "ethogram.studies.sharing",
    },
    trouble_with,
)
