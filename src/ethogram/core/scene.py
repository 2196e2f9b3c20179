"""What a world looked like, frame by frame, as plain data: no drawing here.

A scene has a fixed cast of shapes.  Per frame, each has a position, a tint (an entry of the
palette, or -1 for hidden) and possibly some words; the frame has a caption, and numbers to plot
beside it.  Lines may join shapes, in every frame the same.  A scene is stored as a dataset and
drawn by the report.
"""

import dataclasses
import json
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Literal

import numpy as np
from jaxtyping import Float, Int

from ethogram.core.errors import EthogramError

if TYPE_CHECKING:
    import xarray as xr

Kind = Literal["circle", "square", "ring", "text", "cube"]
TURNS = {  # arrays that only scenes of bodies have, and their axes
    "scale": ("frame", "shape"),
    "orientation": ("frame", "shape", "quaternion"),
}


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
    captions: tuple[str, ...] = ()  # one per frame
    series: dict[str, Float[np.ndarray, "frame line"]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        frames, cast = len(self.position), len(self.shapes)
        shapes = {
            "position": (self.position.shape[:2], (frames, cast)),
            "tint": (self.tint.shape, (frames, cast)),
            "captions": (len(self.captions), frames),
            **{name: (line.shape[0], frames) for name, line in self.series.items()},
        }
        if self.said is not None:
            shapes["said"] = (self.said.shape, (frames, cast))
        if self.scale is not None:
            shapes["scale"] = (self.scale.shape, (frames, cast))
        if self.orientation is not None:
            shapes["orientation"] = (self.orientation.shape, (frames, cast, 4))
        for name, (found, wanted) in shapes.items():
            if found != wanted:
                raise EthogramError(f"Scene {self.title!r}: {name} is {found}, not {wanted}.")
        for link in self.links:
            if not all(0 <= end < cast for end in link):
                raise EthogramError(
                    f"Scene {self.title!r}: a line joins {link}, but there are only {cast} shapes."
                )

    def to_dataset(self) -> "xr.Dataset":
        """Arrays as variables, everything else as one JSON attribute."""
        import xarray as xr

        arrays = {
            "position": (("frame", "shape", "axis"), self.position.astype(np.float32)),
            "tint": (("frame", "shape"), self.tint.astype(np.int16)),
        }
        if self.said is not None:
            arrays["said"] = (("frame", "shape"), self.said.astype(np.int16))
        for name, axes in TURNS.items():
            turned = getattr(self, name)
            if turned is not None:
                arrays[name] = (axes, turned.astype(np.float32))
        for name, lines in self.series.items():
            arrays[f"series.{name}"] = (("frame", f"line.{name}"), lines.astype(np.float32))
        plain = {
            name: getattr(self, name)
            for name in ("title", "bounds", "frame_seconds", "palette", "words", "captions")
        }
        plain["shapes"] = [dataclasses.astuple(shape) for shape in self.shapes]
        if self.links:  # a scene without any is stored as scenes were before there were links
            plain["links"] = self.links
        return xr.Dataset(arrays, attrs={"scene": json.dumps(plain)})

    @staticmethod
    def from_dataset(data: "xr.Dataset") -> "Scene":
        """The scene that `to_dataset` stored."""
        plain = json.loads(data.attrs["scene"])
        plain["shapes"] = tuple(Shape(*shape) for shape in plain["shapes"])
        plain["links"] = tuple((first, second) for first, second in plain.get("links", ()))
        for name in ("bounds", "palette", "words", "captions"):
            plain[name] = tuple(plain[name])
        series = {
            str(name).removeprefix("series."): lines.values
            for name, lines in data.data_vars.items()
            if str(name).startswith("series.")
        }

        def optional(name: str) -> np.ndarray | None:
            return data[name].values if name in data else None

        return Scene(
            position=data["position"].values,
            tint=data["tint"].values,
            said=optional("said"),
            scale=optional("scale"),
            orientation=optional("orientation"),
            series=series,
            **plain,
        )
