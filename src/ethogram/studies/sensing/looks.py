"""How each controller looks wherever it appears."""

from ethogram.studies.plotting import SERIES, Series
from ethogram.studies.sensing.condition import NON_SENSING_LAWS, OUTPUTS, Condition

_BLUE, _RED, _GREEN, _, _, _GREY = SERIES
_LOOKS = dict(zip((*NON_SENSING_LAWS, *OUTPUTS), (_BLUE, _GREY, _RED, _GREEN), strict=True))


def look(condition: Condition) -> Series:
    """Blue for non-sensing and red for sensing, as in the thesis; green for unbounded outputs."""
    return _LOOKS.get(condition.law, _GREY)
