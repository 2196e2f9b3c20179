"""Figures' SVG made fit to stand among others on one page, or alone in a file.

A drawing may come from another package.  Of its elements, attributes and rules of style only those
are taken over that draw: nothing of it runs, is fetched, leads elsewhere, or reaches what is around
it, whatever opens the file.
"""

import hashlib
import re
import xml.etree.ElementTree as ET

from ethogram.core.errors import EthogramError

PAGE_WIDTH = 518.4  # points, 7.2 inches: a drawing as wide as this takes all of a page's width
FULL_SHARE = 0.995  # of that: what is wider is taken as just as wide

_NAMESPACE = "http://www.w3.org/2000/svg"
_REFERENCE = re.compile(r"(?<=url\(#)[^)]+")

# Static content: no scripts, no style sheets, no animation, no HTML, no links, no filters.
_DRAWN = """
    circle clipPath defs desc ellipse g image line linearGradient marker mask path pattern polygon
    polyline radialGradient rect stop svg symbol text textPath title tspan use
"""
_SHARED = """
    alignment-baseline baseline-shift clip-path clip-rule color direction display dominant-baseline
    fill fill-opacity fill-rule font font-family font-size font-stretch font-style font-variant
    font-weight image-rendering letter-spacing marker-end marker-mid marker-start mask
    mix-blend-mode opacity paint-order shape-rendering stop-color stop-opacity stroke
    stroke-dasharray stroke-dashoffset stroke-linecap stroke-linejoin stroke-miterlimit
    stroke-opacity stroke-width text-anchor text-decoration text-rendering vector-effect visibility
    white-space word-spacing writing-mode
"""
_OWN = """
    clipPathUnits cx cy d dx dy fx fy gradientTransform gradientUnits height id lengthAdjust
    markerHeight markerUnits markerWidth maskContentUnits maskUnits offset orient pathLength
    patternContentUnits patternTransform patternUnits points preserveAspectRatio r refX refY rotate
    rx ry spreadMethod startOffset textLength version viewBox width x x1 x2 y y1 y2
"""
_FUNCTIONS = "rgb rgba hsl hsla calc matrix rotate scale scalex scaley skewx skewy translate "
_FUNCTIONS += "translatex translatey"
_ELEMENTS = frozenset(_DRAWN.split())
_RENAMED = {"a": "g", "switch": "g"}  # what they hold is drawn, without what they do
_PROPERTIES = frozenset(_SHARED.split())  # of styles and of elements
_PLACING = frozenset(("transform", "transform-origin"))  # but of the whole: it stays in its place
_ATTRIBUTES = _PROPERTIES | _PLACING | frozenset(_OWN.split())
_HARMLESS = frozenset(_FUNCTIONS.split())  # others may fetch, and an escape may spell their names
_FUNCTION = re.compile(r"([\w-]*)\s*\(\s*([^)]*)")
_PIXELS = re.compile(r"data:image/(png|jpeg|gif|webp);base64,[A-Za-z0-9+/=\s]*")
_WIDTH = re.compile(r"(\d+(?:\.\d+)?)(pt|px|in)?")
_POINTS = {"pt": 1.0, "in": 72.0, "px": 0.75, None: 0.75}


def inline(svg: str, *, name: str, alt: str) -> str:
    """The drawing as an element of a page, said in words to those who cannot see it.

    One that is narrower than a page keeps its share of the page's width (`--share`), so that its
    letters are as large as those of others.
    """
    element = _element(svg, name, alt)
    share = _points(element.get("width", "")) / PAGE_WIDTH
    if 0 < share < FULL_SHARE:
        _add_style(element, f"--share: {share:.3f}")
    return ET.tostring(element, encoding="unicode")


def standalone(svg: str, *, name: str, alt: str) -> str:
    """The drawing as a file, with the ink and paper that a page would have given it."""
    element = _element(svg, name, alt)
    element.set("xmlns", _NAMESPACE)
    _add_style(element, "color: #1d1d1b; background: #ffffff")
    return ET.tostring(element, encoding="unicode")


def _add_style(element: ET.Element, rules: str) -> None:
    element.set("style", ";".join(filter(None, (element.get("style"), rules))))


def _element(svg: str, name: str, alt: str) -> ET.Element:
    """Parsed, without namespaces (HTML knows none), with ids of its own, and only what draws.

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

    def renamed(key: str, value: str) -> str:
        if key == "id":
            return short(value)
        if key == "href" and value.startswith("#"):
            return f"#{short(value[1:])}"
        return _REFERENCE.sub(lambda target: short(target[0]), value)

    for element in root.iter():  # before its children, of which it keeps those that draw
        element.tag = _RENAMED.get(_local(element.tag), _local(element.tag))
        element.attrib = {key: renamed(key, value) for key, value in _drawing_attributes(element)}
        element[:] = _kept(element)
    for key in _PLACING.intersection(root.attrib):
        del root.attrib[key]
    root.attrib |= {"role": "img", "aria-label": alt}
    return root


def _kept(element: ET.Element) -> list[ET.Element]:
    """What an element holds and what draws, without groups that say nothing."""
    found = []
    for child in element:
        tag = _RENAMED.get(_local(child.tag), _local(child.tag))
        if tag == "g" and not child.attrib:
            found += _kept(child)
        elif tag in _ELEMENTS:
            found.append(child)
    return found


def _drawing_attributes(element: ET.Element) -> list[tuple[str, str]]:
    """The attributes that draw, by their local names."""
    kept = []
    for name, value in element.attrib.items():
        key = _local(name)
        if key == "href":
            allowed = value.startswith("#") or (
                element.tag == "image" and _PIXELS.fullmatch(value) is not None
            )
        elif key == "style":
            value = _style(value)
            allowed = bool(value)
        else:
            allowed = key in _ATTRIBUTES and (key == "id" or _is_harmless(value))
        if allowed:
            kept.append((key, value))
    return kept


def _style(rules: str) -> str:
    """Those rules of a style that draw, as they were."""
    kept = []
    for rule in rules.split(";"):
        key, _, value = rule.partition(":")
        if key.strip().lower() in _PROPERTIES and _is_harmless(value):
            kept.append(rule)
    return ";".join(kept)


def _is_harmless(value: str) -> bool:
    """Whether a value refers to nothing outside of the drawing."""
    if any(mark in value for mark in ("\\", "/*", "@", "<")):
        return False
    return all(
        inside.startswith("#") if name.lower() == "url" else name.lower() in _HARMLESS or not name
        for name, inside in _FUNCTION.findall(value)
    )


def _points(width: str) -> float:
    """A drawing's width in points; 0 where it does not say."""
    found = _WIDTH.fullmatch(width.strip())
    return float(found[1]) * _POINTS[found[2]] if found else 0.0


def _local(name: str) -> str:
    return name.rpartition("}")[2]
