"""What a world looked like, frame by frame, as plain data: no drawing here.

A scene has a fixed cast of shapes.  Per frame, each has a position, a tint (an entry of the
palette, or -1 for hidden) and possibly some words; the frame has a caption, and numbers to plot
beside it.  Between frames shapes move, unless they are said to appear anew; frames may be grouped
into chapters.  Lines may join shapes, in every frame the same.  In space positions are in metres,
the third axis points upwards and the floor is at 0.  A scene is stored as a dataset and
drawn by the report: on a study's page, on a page of its own, and in a notebook, where a scene on
the last line of a cell shows itself as a replay.  `World.scene` makes one of a rollout, and
`ethogram.core.rollout.watch` plays an episode to make one.
"""

import dataclasses
import json
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from jaxtyping import Bool, Float, Int

from ethogram.core.errors import EthogramError
from ethogram.core.registry import Registry

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    import xarray as xr

Kind = Literal["circle", "square", "ring", "text", "cube"]
GROUP = "scene"  # of a record
RECORDED = 3  # trials of a case whose scenes are kept, the first ones
OPTIONAL = {  # arrays that not every scene has: their further axes, and their types when stored
    "said": ((), np.int16),
    "scale": ((), np.float32),
    "orientation": (("quaternion",), np.float32),
    "fresh": ((), np.bool_),
}
# who draws is named here and found when a scene is shown: the core may not import the report
DRAWINGS: "Registry[Callable[[Scene], str]]" = Registry(
    "drawing of scenes", "ethogram.drawings", {"notebook": "ethogram.report.notebook:as_html"}
)


@dataclass(frozen=True)
class Shape:
    """One member of the cast."""

    kind: Kind
    size: float  # radius or half an edge, in the units of the positions
    label: str = ""  # always shown, as plain text


@dataclass(frozen=True, kw_only=True)
class Scene:
    """A recorded episode.

    Raises:
        EthogramError: an array does not have the shape that the cast and the frames ask for, or
            a line joins what is not in the cast.

    """

    title: str
    bounds: tuple[float, float, float, float]  # left, bottom, right, top
    frame_seconds: float  # how long a frame is shown at normal speed
    palette: tuple[str, ...]  # what each tint means, in words ("prefers resource 1")
    shapes: tuple[Shape, ...]
    links: tuple[tuple[int, int], ...] = ()  # entries of shapes that a thin line joins
    position: Float[np.ndarray, "frame shape axis"]  # 2 or 3 axes
    tint: Int[np.ndarray, "frame shape"]  # entry of the palette, -1 = hidden
    words: tuple[str, ...] = ()  # what shapes can say
    said: Int[np.ndarray, "frame shape"] | None = None  # entry of words, -1 = nothing
    scale: Float[np.ndarray, "frame shape"] | None = None  # of a shape's size
    orientation: Float[np.ndarray, "frame shape 4"] | None = None  # unit quaternion w, x, y, z
    fresh: Bool[np.ndarray, "frame shape"] | None = None  # is there anew: it did not move there
    captions: tuple[str, ...] = ()  # one per frame
    chapters: tuple[str, ...] = ()  # one per frame, the same for frames that belong together
    series: dict[str, Float[np.ndarray, "frame line"]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        frames, cast = len(self.position), len(self.shapes)
        shapes = {
            "position": (self.position.shape[:2], (frames, cast)),
            "tint": (self.tint.shape, (frames, cast)),
            "captions": (len(self.captions), frames),
            **{name: (line.shape[0], frames) for name, line in self.series.items()},
        }
        for name, array in self._optional().items():
            axes = (4,) if name == "orientation" else ()
            shapes[name] = (array.shape, (frames, cast, *axes))
        if self.chapters:
            shapes["chapters"] = (len(self.chapters), frames)
        for name, (found, wanted) in shapes.items():
            if found != wanted:
                raise EthogramError(f"Scene {self.title!r}: {name} is {found}, not {wanted}.")
        self._check_values()
        for link in self.links:
            if not all(0 <= end < cast for end in link):
                raise EthogramError(
                    f"Scene {self.title!r}: a line joins {link}, but there are only {cast} shapes."
                )

    def __repr__(self) -> str:
        return f"Scene({self.title!r}, {len(self.position)} frames, {len(self.shapes)} shapes)"

    def _repr_html_(self) -> str:
        """A replay: what a notebook shows for a scene on the last line of a cell."""
        return DRAWINGS["notebook"](self)

    def _check_values(self) -> None:
        """Refuse what could not be drawn."""
        axes = self.position.shape[2:]
        if axes not in {(2,), (3,)}:
            raise EthogramError(f"Scene {self.title!r}: a position has axes {axes}, not 2 or 3.")
        for name, lines in self.series.items():
            if lines.ndim != 2:
                raise EthogramError(
                    f"Scene {self.title!r}: {name} is {lines.shape}; allowed: frames and lines."
                )
        sizes = [shape.size for shape in self.shapes]
        numbers = {"bounds": self.bounds, "frame_seconds": [self.frame_seconds], "size": sizes}
        for name, values in numbers.items():
            for value in values:
                if not (isinstance(value, (int, float, np.number)) and np.isfinite(value)):
                    raise EthogramError(
                        f"Scene {self.title!r}: {name} holds {value!r}; allowed: finite numbers."
                    )
        if len(self.bounds) != 4 or self.frame_seconds <= 0:
            raise EthogramError(
                f"Scene {self.title!r}: bounds = {self.bounds} and frame_seconds = "
                f"{self.frame_seconds}; allowed: four numbers, and a time above 0."
            )
        for name in ("palette", "words", "captions", "chapters"):
            if not all(isinstance(text, str) for text in getattr(self, name)):
                raise EthogramError(f"Scene {self.title!r}: {name} holds what is no text.")

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
        plain["shapes"] = [dataclasses.astuple(shape) for shape in self.shapes]
        for name in ("links", "chapters"):
            if getattr(self, name):  # a scene without any is stored as before there were any
                plain[name] = getattr(self, name)
        return xr.Dataset(arrays, attrs={"scene": json.dumps(plain)})

    def _optional(self) -> dict[str, np.ndarray]:
        """Those arrays of `OPTIONAL` that there are."""
        arrays = {name: getattr(self, name) for name in OPTIONAL}
        return {name: array for name, array in arrays.items() if array is not None}

    @staticmethod
    def from_dataset(data: "xr.Dataset") -> "Scene":
        """The scene that `to_dataset` stored."""
        plain = json.loads(data.attrs["scene"])
        plain["shapes"] = tuple(Shape(*shape) for shape in plain["shapes"])
        plain["links"] = tuple((first, second) for first, second in plain.get("links", ()))
        plain.setdefault("chapters", ())
        for name in ("bounds", "palette", "words", "captions", "chapters"):
            plain[name] = tuple(plain[name])
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
        return Scene(
            position=data["position"].values.astype(np.float32),
            tint=data["tint"].values.astype(np.int16),
            series=series,
            **optional,
            **plain,
        )


def _at_most(widest: Any, array: np.ndarray) -> np.ndarray:
    """An array in a type, or in the narrower one of the same kind that it has."""
    kind = np.dtype(widest)
    narrower = array.dtype.kind == kind.kind and array.dtype.itemsize < kind.itemsize
    return array if narrower else array.astype(kind)


def grouped(scenes: "Sequence[Scene]") -> "dict[str, xr.Dataset]":
    """Scenes of a case's first trials as groups of its record: scene, scene-2, scene-3, ..."""
    return {
        GROUP if trial == 1 else f"{GROUP}-{trial}": scene.to_dataset()
        for trial, scene in enumerate(scenes, start=1)
    }


def groups_by_trial(groups: "Iterable[str]") -> dict[int, str]:
    """Those groups of a record that hold scenes, by the number of the trial."""
    found = {}
    for name in groups:
        stem, _, trial = name.partition("-")
        if stem == GROUP and (trial.isdecimal() or not trial):
            found[int(trial or 1)] = name
    return dict(sorted(found.items()))
