"""Figures' SVG made fit to stand among others on one page, or alone in a file."""

import hashlib
import re
import xml.etree.ElementTree as ET

from ethogram.core.errors import EthogramError

_NAMESPACE = "http://www.w3.org/2000/svg"
_REFERENCE = re.compile(r"(?<=^#).+$|(?<=url\(#)[^)]+")


def inlined(svg: str, *, name: str, alt: str) -> str:
    """The drawing as an element of a page, said in words to those who cannot see it."""
    return ET.tostring(_element(svg, name, alt), encoding="unicode")


def alone(svg: str, *, name: str, alt: str) -> str:
    """The drawing as a file, with the ink and paper that a page would have given it."""
    element = _element(svg, name, alt)
    element.attrib |= {"xmlns": _NAMESPACE, "style": "color: #1d1d1b; background: #ffffff"}
    return ET.tostring(element, encoding="unicode")


def _element(svg: str, name: str, alt: str) -> ET.Element:
    """Parsed, without namespaces (HTML knows none), with ids of its own.

    Two drawings on a page may use the same id for different things (matplotlib names glyphs and
    markers by their content's hash), and the browser would take the first for both.  Here an id is
    a hash of the drawing's name and a number, which is short: a page has thousands of references.
    """
    try:
        root = ET.fromstring(svg)
    except ET.ParseError as error:
        raise EthogramError(f"The SVG of figure {name!r} is not well-formed: {error}.") from error
    if root.tag not in ("svg", f"{{{_NAMESPACE}}}svg"):
        raise EthogramError(f"The SVG of figure {name!r} is a <{_local(root.tag)}>, not an <svg>.")
    prefix = "d" + hashlib.sha256(name.encode(errors="replace")).hexdigest()[:7]
    numbers: dict[str, int] = {}

    def short(id_: str) -> str:
        return f"{prefix}.{numbers.setdefault(id_, len(numbers))}"

    for element in root.iter():
        element.tag = _local(element.tag)
        element.attrib = {
            _local(key): short(value)
            if key == "id"
            else _REFERENCE.sub(lambda target: short(target[0]), value)
            for key, value in element.attrib.items()
        }
        element[:] = _ungrouped(element)
    root.attrib |= {"role": "img", "aria-label": alt}
    return root


def _ungrouped(element: ET.Element) -> list[ET.Element]:
    """What an element holds, without groups that say nothing."""
    found = []
    for child in element:
        plain = _local(child.tag) == "g" and not child.attrib
        found += _ungrouped(child) if plain else [child]
    return found


def _local(name: str) -> str:
    return name.rpartition("}")[2]
