import pytest

from ethogram.core.errors import TooLarge
from ethogram.core.memory import available_memory, readable_bytes, require_memory


def test_what_fits_passes_and_what_does_not_is_refused_with_both_sizes():
    require_memory("a byte", 1)
    with pytest.raises(TooLarge, match=r"a table needs 10\^500 bytes of memory; .* are free"):
        require_memory("a table", 10**500)
    assert available_memory() > 0


@pytest.mark.parametrize(
    ("size", "text"),
    [(0, "0 bytes"), (5, "5 bytes"), (403_606_400, "404 MB"), (1_200_000_000_000, "1.2 TB")],
)
def test_sizes_read_like_sizes(size, text):
    assert readable_bytes(size) == text
