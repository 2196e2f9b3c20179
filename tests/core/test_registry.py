import sys
from pathlib import Path

import pytest

from ethogram.core.errors import EthogramError, UnknownName
from ethogram.core.registry import Registry

GROUP = "ethogram.tests.shapes"


def shapes() -> Registry[object]:
    return Registry("shape", GROUP, {"fraction": "fractions:Fraction", "turtle": "colorsys"})


def install(folder: Path, package: str, **entries: str) -> None:
    """Lay out the metadata that an installed package of these entry points has."""
    info = folder / f"{package}-1.0.dist-info"
    info.mkdir(parents=True)
    (info / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {package}\nVersion: 1.0\n")
    lines = [f"{name} = {value}" for name, value in entries.items()]
    (info / "entry_points.txt").write_text("\n".join([f"[{GROUP}]", *lines, ""]))


@pytest.fixture
def site(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder in which packages can be installed for the length of a test."""
    monkeypatch.syspath_prepend(str(tmp_path))
    monkeypatch.delitem(sys.modules, "grazing", raising=False)
    return tmp_path


def test_a_module_or_an_attribute_of_one_is_loaded_by_name():
    from fractions import Fraction

    assert shapes()["fraction"] is Fraction
    assert shapes()["turtle"] is sys.modules["colorsys"]


def test_listing_the_names_imports_nothing(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.delitem(sys.modules, "colorsys", raising=False)
    assert list(shapes()) == ["fraction", "turtle"]
    assert "colorsys" not in sys.modules


def test_an_unknown_name_is_answered_with_the_nearest_one():
    with pytest.raises(UnknownName, match=r"Unknown shape 'turtel'. Did you mean 'turtle'\?"):
        shapes()["turtel"]


def test_a_failure_of_a_builtin_keeps_its_own_traceback():
    broken: Registry[object] = Registry("shape", GROUP, {"gone": "ethogram.no_such_module"})
    with pytest.raises(ModuleNotFoundError):
        broken["gone"]


def test_another_package_adds_a_name_through_an_entry_point(site: Path):
    install(site, "grazing", meadow="decimal:Decimal")
    from decimal import Decimal

    assert list(shapes()) == ["fraction", "meadow", "turtle"]
    assert shapes()["meadow"] is Decimal


def test_a_plugin_that_cannot_be_imported_is_named_with_its_package_and_cause(site: Path):
    install(site, "grazing", meadow="grazing_is_not_here:Meadow")
    with pytest.raises(EthogramError) as caught:
        shapes()["meadow"]
    for part in ("'meadow'", "'grazing 1.0'", "grazing_is_not_here:Meadow", "No module named"):
        assert part in str(caught.value)


def test_a_broken_plugin_leaves_the_other_names_usable(site: Path):
    install(site, "grazing", meadow="grazing_is_not_here:Meadow")
    assert shapes()["turtle"] is sys.modules["colorsys"]


def test_a_plugin_may_not_take_the_name_of_a_builtin(site: Path):
    install(site, "impostor", turtle="decimal:Decimal")
    with pytest.raises(EthogramError, match=r"'ethogram'.*'colorsys'.*'impostor 1.0'.*'decimal"):
        shapes()["turtle"]


def test_two_plugins_may_not_share_a_name(site: Path):
    install(site, "grazing", meadow="decimal:Decimal")
    install(site, "mowing", meadow="fractions:Fraction")
    with pytest.raises(EthogramError, match="Two packages register the shape 'meadow'"):
        shapes()["meadow"]


def test_a_name_that_is_claimed_twice_leaves_the_other_names_usable(site: Path):
    install(site, "impostor", turtle="decimal:Decimal")
    assert list(shapes()) == ["fraction", "turtle"]
    assert shapes()["fraction"].__name__ == "Fraction"


@pytest.mark.parametrize(
    ("text", "parts"),
    [
        ("import math\nraise ValueError('it rains')", ["ValueError: it rains", "grazing.py:2"]),
        ("def broken(:", ["SyntaxError", "grazing.py:1"]),
        ("import sys\nimport json\nsys.exit('bye')", ["SystemExit: bye", "grazing.py:3"]),
        ("import math\nimport grazing_is_not_here", ["No module named", "grazing.py:2"]),
    ],
)
def test_what_breaks_a_plugin_is_named_with_file_and_line(site: Path, text: str, parts: list[str]):
    install(site, "grazing", meadow="grazing:Meadow")
    (site / "grazing.py").write_text(text)
    with pytest.raises(EthogramError) as caught:
        shapes()["meadow"]
    for part in parts:
        assert part in str(caught.value)


def test_a_plugin_that_is_not_what_it_has_to_be_is_named_with_its_file(site: Path):
    install(site, "grazing", meadow="grazing:Meadow")
    (site / "grazing.py").write_text("class Meadow: pass")
    registry: Registry[object] = Registry(
        "shape", GROUP, {}, lambda name, loaded: f"{name} has no {loaded.__name__.upper()}"
    )
    with pytest.raises(EthogramError, match=r"'grazing 1.0'.*meadow has no MEADOW .*grazing\.py:1"):
        registry["meadow"]
