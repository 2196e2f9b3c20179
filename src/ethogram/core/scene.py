"""A recorded episode, frame by frame, as plain data: no drawing here.

A scene has a fixed cast of shapes.  Per frame, each has a position, a tint (an entry of the
palette, or -1 for hidden) and possibly some words; the frame has a caption, and numbers to plot
beside it.  One frame is enough: a scene may be of a single state.  Between frames shapes move,
unless they are said to appear anew; frames may be grouped into chapters.  Lines may join shapes, in
every frame the same.

In the plane a shape may have a heading, in radians from the x axis towards the y axis: a polygon is
turned by it, any other shape has a mark in its direction.  A polygon's vertices are relative to its
position and, with its heading at 0, not turned; they stay as they are or, as a soft body's, change
from frame to frame.  A background (a road graph) lies under everything, in every frame the same.
In space positions are in metres, the third axis points upwards and the floor is at 0.

All colours are those of the palette.  A scene is stored as a dataset and drawn by the report: on a
study's page, on a page of its own, and in a notebook, where a scene on the last line of a cell
shows itself as a replay; `Scene.save` writes a page or a video.  `World.scene` makes one of a
rollout, and `ethogram.core.rollout.watch` plays an episode to make one.
"""

import dataclasses
import json
import re
from collections.abc import Callable
from dataclasses import dataclass, field
from itertools import cycle, islice
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, NamedTuple, get_args

import numpy as np
from jaxtyping import Bool, Float, Int

from ethogram.core.errors import EthogramError
from ethogram.core.registry import Registry

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    import xarray as xr

Kind = Literal["circle", "square", "ring", "text", "polygon", "cube"]
BackgroundKind = Literal["line", "polygon"]
Point = tuple[float, float]
LEAST_VERTICES = {"line": 2, "polygon": 3}
FLAT = ("heading", "vertices")  # arrays of scenes in the plane
OPTIONAL = {  # arrays that not every scene has: their further axes, and their types when stored
    "said": ((), np.int16),
    "scale": ((), np.float32),
    "orientation": (("quaternion",), np.float32),
    "heading": ((), np.float32),
    "vertices": (("vertex", "axis"), np.float32),
    "fresh": ((), np.bool_),
}
COLOURS = {  # that can be told apart, by those too who see fewer; all but the last in this order
    "blue": "#0072b2",
    "vermilion": "#d55e00",
    "green": "#009e73",
    "pink": "#cc79a7",
    "ochre": "#a87400",
    "grey": "#7d7d7d",
    "silver": "#bdbab1",  # of what is at rest, or lies in the background
}
DEFAULT_COLOURS = tuple(COLOURS.values())[:-1]
GRADED_COLOURS = (COLOURS["blue"], COLOURS["silver"], COLOURS["vermilion"])
GRADED_RANGE = 0.1  # of the size at rest: a larger change does not change a graded colour further
_HEXADECIMAL = re.compile("#[0-9a-f]{6}")
# who draws is named here and found when a scene is shown: the core may not import the report
DRAWINGS: "Registry[Callable[..., Any]]" = Registry(
    "drawing of scenes",
    "ethogram.drawings",
    {"notebook": "ethogram.report.notebook:as_html", "file": "ethogram.report.scene_files:save"},
)


class Tint(NamedTuple):
    """An entry of a palette."""

    label: str  # what it means ("prefers resource 1")
    colour: str  # "#rrggbb", one of `COLOURS` for instance


def tints(*labels: str) -> tuple[Tint, ...]:
    """A palette in the default colours, which begin again after the last one."""
    return tuple(map(Tint, labels, cycle(DEFAULT_COLOURS)))


@dataclass(frozen=True)
class Shape:
    """One member of the cast.

    Raises:
        EthogramError: there is no such kind, its size is no finite number, or its vertices are not
            those of a polygon.

    """

    kind: Kind
    size: float  # radius or half an edge, in the units of the positions; of a polygon, a factor
    label: str = ""  # always shown, as plain text
    vertices: tuple[Point, ...] = ()  # of a polygon that keeps its form: `size` multiplies them

    def __post_init__(self) -> None:
        _check_kind("shape", self.kind, get_args(Kind))
        if not _is_finite(self.size):
            raise EthogramError(f"A shape has size {self.size!r}; allowed: a finite number.")
        if isinstance(self.vertices, tuple) and not self.vertices:
            return
        if self.kind != "polygon":
            raise EthogramError(f"A {self.kind} has vertices; allowed: of a polygon.")
        _check_vertices("polygon", self.vertices)


@dataclass(frozen=True)
class BackgroundShape:
    """A line or a polygon that does not move, under everything else.

    Raises:
        EthogramError: there is no such kind, or its vertices or its width could not be drawn.

    """

    kind: BackgroundKind
    vertices: tuple[Point, ...]
    tint: int  # entry of the palette
    width: float = 0.0  # of a line, in the units of the positions; 0 = as thin as can be seen

    def __post_init__(self) -> None:
        _check_kind("background", self.kind, get_args(BackgroundKind))
        _check_vertices(self.kind, self.vertices)
        if not (_is_finite(self.width) and self.width >= 0):
            raise EthogramError(f"A background has width {self.width!r}; allowed: 0 or more.")


@dataclass(frozen=True, kw_only=True)
class Scene:
    """A recorded episode.

    Raises:
        EthogramError: an array does not have the shape that the cast and the frames ask for, a
            line joins what is not in the cast, or something could not be drawn.

    """

    title: str
    bounds: tuple[float, float, float, float]  # left, bottom, right, top
    frame_seconds: float  # how long a frame is shown at normal speed
    palette: tuple[Tint, ...]  # what each tint means, and its colour
    shapes: tuple[Shape, ...]
    background: tuple[BackgroundShape, ...] = ()  # from the lowest to the uppermost
    links: tuple[tuple[int, int], ...] = ()  # entries of shapes that a thin line joins
    position: Float[np.ndarray, "frame shape axis"]  # 2 or 3 axes
    tint: Int[np.ndarray, "frame shape"]  # entry of the palette, -1 = hidden
    words: tuple[str, ...] = ()  # what shapes can say
    said: Int[np.ndarray, "frame shape"] | None = None  # entry of words, -1 = nothing
    scale: Float[np.ndarray, "frame shape"] | None = None  # of a shape's size
    orientation: Float[np.ndarray, "frame shape 4"] | None = None  # unit quaternion w, x, y, z
    heading: Float[np.ndarray, "frame shape"] | None = None  # rad, from x towards y
    # of polygons that have none of their own; what is not finite is left out (nan = padding)
    vertices: Float[np.ndarray, "frame shape vertex 2"] | None = None
    fresh: Bool[np.ndarray, "frame shape"] | None = None  # is there anew: it did not move there
    captions: tuple[str, ...] = ()  # one per frame
    chapters: tuple[str, ...] = ()  # one per frame, the same for frames that belong together
    series: dict[str, Float[np.ndarray, "frame line"]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self._check_arrays()
        self._check_numbers()
        self._check_texts()
        self._check_palette()
        self._check_references()

    def __repr__(self) -> str:
        return f"Scene({self.title!r}, {len(self.position)} frames, {len(self.shapes)} shapes)"

    def _repr_html_(self) -> str:
        """A replay: what a notebook shows for a scene on the last line of a cell."""
        html: str = DRAWINGS["notebook"](self)
        return html

    def save(self, file: str | Path) -> None:
        """Write it as a page that plays it, or as a video, in place of an earlier one.

        Args:
            file: where to; its name ends in .html, .gif, .webp or .mp4 (which needs
                `pip install 'ethogram[video]'`).

        Raises:
            EthogramError: the name ends in something else, the scene has nothing to show, or the
                file cannot be written, or is a page that is not ours.

        """
        DRAWINGS["file"](Path(file), self)

    @property
    def axes(self) -> int:
        """2 in the plane, 3 in space."""
        return self.position.shape[2]

    @property
    def graded(self) -> bool:
        """Whether colours are mixed by the shapes' scale.

        They are in space, where the palette's three entries are then those of what is contracted,
        at rest and expanded.
        """
        return _graded(self.axes, self.scale is not None, self.palette)

    def every(self, step: int) -> "Scene":
        """The same with every so many frames, from the first on, at the same speed."""
        frames = slice(None, None, step)
        parts: dict[str, Any] = {name: each[frames] for name, each in self._optional().items()}
        if self.fresh is not None:  # in any of the frames since the last one that stays
            starts = [max(0, frame - step + 1) for frame in range(0, len(self.fresh), step)]
            shown = self.fresh[: starts[-1] + step if len(starts) > 1 else 1]
            parts["fresh"] = np.logical_or.reduceat(shown, starts)
        return dataclasses.replace(
            self,
            frame_seconds=self.frame_seconds * step,
            position=self.position[frames],
            tint=self.tint[frames],
            captions=self.captions[frames],
            chapters=self.chapters[frames],
            series={name: lines[frames] for name, lines in self.series.items()},
            **parts,
        )

    def visible(self, frames: Any = ...) -> Bool[np.ndarray, "*frame shape"]:
        """Which shapes are drawn: not hidden, finite, and of polygons those that have an area.

        Args:
            frames: one, or some as a slice; by default all.

        """
        shown: np.ndarray = (self.tint[frames] >= 0) & np.isfinite(self.position[frames]).all(-1)
        if self.scale is not None:
            shown = shown & np.isfinite(self.scale[frames])
        polygon = np.array([shape.kind == "polygon" for shape in self.shapes], bool)
        if self.heading is not None:
            shown = shown & (np.isfinite(self.heading[frames]) | ~polygon)
        if self.vertices is not None:
            own = np.array([bool(shape.vertices) for shape in self.shapes], bool)
            count = np.isfinite(self.vertices[frames]).all(-1).sum(-1)
            shown = shown & (own | (count >= LEAST_VERTICES["polygon"]) | ~polygon)
        return shown

    def _refuse(self, what: str, found: Any, allowed: str) -> None:
        raise EthogramError(f"Scene {self.title!r}: {what} {found!r}; allowed: {allowed}.")

    def _check_arrays(self) -> None:
        frames, cast = len(self.position), len(self.shapes)
        if not frames:
            self._refuse("frames", frames, "one or more")
        shapes = {
            "position": (self.position.shape, (frames, cast, *self.position.shape[2:3])),
            "tint": (self.tint.shape, (frames, cast)),
            "captions": (len(self.captions), frames),
            **{name: (line.shape[0], frames) for name, line in self.series.items()},
        }
        for name, array in self._optional().items():
            further = {"orientation": (4,), "vertices": (*array.shape[2:3], 2)}.get(name, ())
            shapes[name] = (array.shape, (frames, cast, *further))
        if self.chapters:
            shapes["chapters"] = (len(self.chapters), frames)
        for name, (found, wanted) in shapes.items():
            if found != wanted:
                what = "has shape" if isinstance(found, tuple) else "has as many entries as"
                raise EthogramError(
                    f"Scene {self.title!r}: {name} {what} {found}; allowed: {wanted}, of {frames} "
                    f"frames and {cast} shapes."
                )
        if self.position.shape[2:] not in {(2,), (3,)}:
            axes = self.position.shape[2:]
            raise EthogramError(f"Scene {self.title!r}: a position has axes {axes}, not 2 or 3.")
        for name, lines in self.series.items():
            if lines.ndim != 2:
                raise EthogramError(
                    f"Scene {self.title!r}: {name} is {lines.shape}; allowed: frames and lines."
                )

    def _check_numbers(self) -> None:
        for name, values in {"bounds": self.bounds, "frame_seconds": [self.frame_seconds]}.items():
            for value in values:
                if not _is_finite(value):
                    self._refuse(f"{name} holds", value, "finite numbers")
        if len(self.bounds) != 4 or self.frame_seconds <= 0:
            raise EthogramError(
                f"Scene {self.title!r}: bounds = {self.bounds} and frame_seconds = "
                f"{self.frame_seconds}; allowed: four numbers, and a time above 0."
            )

    def _check_texts(self) -> None:
        for name in ("words", "captions", "chapters"):
            if not all(isinstance(text, str) for text in getattr(self, name)):
                raise EthogramError(f"Scene {self.title!r}: {name} holds what is no text.")

    def _check_palette(self) -> None:
        for entry in self.palette:
            if not (
                isinstance(entry, Tint)
                and all(isinstance(text, str) for text in entry)
                and _HEXADECIMAL.fullmatch(entry.colour)
            ):
                self._refuse("palette holds", entry, "Tint(label, '#rrggbb'), or tints(label, ...)")

    def _check_references(self) -> None:
        """Refuse what names no entry of the palette, no shape, or no vertices."""
        count = len(self.palette)
        most = int(self.tint.max(initial=-1))
        if most >= count:
            self._refuse("tint holds", most, f"-1 (hidden), and entries of a palette of {count}")
        for each in self.background:
            if not 0 <= each.tint < count:
                self._refuse("background has tint", each.tint, f"entries of a palette of {count}")
        for link in self.links:
            if not all(0 <= end < len(self.shapes) for end in link):
                self._refuse("a line joins", link, f"entries of its {len(self.shapes)} shapes")
        polygons = [shape for shape in self.shapes if shape.kind == "polygon"]
        if self.vertices is None and not all(shape.vertices for shape in polygons):
            self._refuse("a polygon has vertices", (), "its own, or those of the scene")
        flat = ["polygon"] * len(polygons) + ["background"] * len(self.background)
        flat += [name for name in FLAT if getattr(self, name) is not None]
        if self.axes == 3 and flat:
            self._refuse("in space there is a", flat[0], "cubes, with an orientation")

    def to_dataset(self) -> "xr.Dataset":
        """Arrays as variables, everything else as one JSON attribute.

        Numbers are stored in 32 or, whole ones, 16 bits; those that come in fewer stay as they are.
        """
        import xarray as xr

        arrays = {
            "position": (("frame", "shape", "axis"), _at_most(np.float32, self.position)),
            "tint": (("frame", "shape"), _at_most(np.int16, self.tint)),
        }
        for name, array in self._optional().items():
            axes, widest = OPTIONAL[name]
            arrays[name] = (("frame", "shape", *axes), _at_most(widest, array))
        for name, lines in self.series.items():
            arrays[f"series.{name}"] = (("frame", f"line.{name}"), lines.astype(np.float32))
        plain = {
            name: getattr(self, name)
            for name in ("title", "bounds", "frame_seconds", "palette", "words", "captions")
        }
        plain["palette"] = [tint.label for tint in self.palette]
        colours = [tint.colour for tint in self.palette]
        default = _default_colours(len(colours), graded=self.graded)
        plain["shapes"] = [_stored(shape) for shape in self.shapes]
        further = {
            "links": self.links,
            "chapters": self.chapters,
            "background": list(map(dataclasses.astuple, self.background)),
            "colours": [] if colours == default else colours,
        }
        # a scene without any is stored as before there were any
        plain |= {name: value for name, value in further.items() if value}
        return xr.Dataset(arrays, attrs={"scene": json.dumps(plain, default=float)})

    def _optional(self) -> dict[str, np.ndarray]:
        """Those arrays of `OPTIONAL` that there are."""
        arrays = {name: getattr(self, name) for name in OPTIONAL}
        return {name: array for name, array in arrays.items() if array is not None}

    @staticmethod
    def from_dataset(data: "xr.Dataset") -> "Scene":
        """The scene that `to_dataset` stored."""
        plain = json.loads(data.attrs["scene"])
        series = {
            str(name).removeprefix("series."): lines.values
            for name, lines in data.data_vars.items()
            if str(name).startswith("series.")
        }
        optional: dict[str, Any] = {
            name: data[name].values.astype(kind)
            for name, (_, kind) in OPTIONAL.items()
            if name in data
        }
        labels = plain["palette"]
        graded = _graded(data.sizes["axis"], "scale" in optional, labels)
        default = _default_colours(len(labels), graded=graded)
        return Scene(
            title=plain["title"],
            bounds=tuple(plain["bounds"]),
            frame_seconds=plain["frame_seconds"],
            palette=tuple(map(Tint, labels, plain.get("colours", default))),
            shapes=tuple(
                Shape(kind, size, label, _points(*vertices))
                for kind, size, label, *vertices in plain["shapes"]
            ),
            background=tuple(
                BackgroundShape(kind, _points(vertices), int(tint), width)
                for kind, vertices, tint, width in plain.get("background", ())
            ),
            links=tuple((first, second) for first, second in plain.get("links", ())),
            position=data["position"].values.astype(np.float32),
            tint=data["tint"].values.astype(np.int16),
            words=tuple(plain["words"]),
            captions=tuple(plain["captions"]),
            chapters=tuple(plain.get("chapters", ())),
            series=series,
            **optional,
        )


def _stored(shape: Shape) -> list[Any]:
    """A shape as JSON; one without vertices as before there were any."""
    plain = [shape.kind, shape.size, shape.label]
    return [*plain, shape.vertices] if shape.vertices else plain


def _points(vertices: "Iterable[Sequence[float]]" = ()) -> tuple[Point, ...]:
    return tuple((x, y) for x, y in vertices)


def _graded(axes: int, scaled: bool, palette: "Sequence[object]") -> bool:
    return axes == 3 and scaled and len(palette) == 3


def _default_colours(count: int, *, graded: bool) -> list[str]:
    """The colours of a palette that is stored without any."""
    return list(GRADED_COLOURS if graded else islice(cycle(DEFAULT_COLOURS), count))


def _check_kind(what: str, kind: str, allowed: tuple[str, ...]) -> None:
    if kind not in allowed:
        raise EthogramError(f"A {what} is of kind {kind!r}; allowed: {', '.join(allowed)}.")


def _check_vertices(kind: str, vertices: tuple[Point, ...]) -> None:
    least = LEAST_VERTICES[kind]
    fit = isinstance(vertices, tuple) and least <= len(vertices)
    if not fit or not all(len(pair) == 2 and all(map(_is_finite, pair)) for pair in vertices):
        raise EthogramError(
            f"A {kind} has vertices {vertices!r}; allowed: a tuple of {least} or more pairs of "
            "finite numbers."
        )


def _is_finite(value: Any) -> bool:
    return isinstance(value, (int, float, np.number)) and bool(np.isfinite(value))


def _at_most(widest: Any, array: np.ndarray) -> np.ndarray:
    """An array in a type, or in the narrower one of the same kind that it has."""
    kind = np.dtype(widest)
    narrower = array.dtype.kind == kind.kind and array.dtype.itemsize < kind.itemsize
    return array if narrower else array.astype(kind)
