"""Settings declared once, as fields of the world or learner they belong to.

    class Pasture(World):
        growth: Number = setting(0.3, Annotated[float, Field(ge=0)])
        herders: int = setting(3, Annotated[int, Field(ge=1)], static=True)

`settings_of(Pasture)` is a pydantic dataclass with the same names, defaults and bounds, for plans
and files; building a `Pasture` in Python checks the same bounds.
"""

import dataclasses
from collections.abc import Callable, Hashable, Iterable, Mapping
from functools import cache
from typing import Annotated, Any, Literal, TypeAlias, TypeVar, cast, dataclass_transform

import equinox as eqx
import jax
import jax.numpy as jnp
import pydantic
from jax import Array

from ethogram.core.errors import InvalidSettings, UnknownName, shown

T = TypeVar("T")
F = TypeVar("F", bound=Callable[..., Any])
Number = float | Array  # a setting that may be swept: a number, or an array of them under vmap

# what many settings allow, as pydantic reads it
Fraction: TypeAlias = Annotated[float, pydantic.Field(ge=0, le=1)]
Positive: TypeAlias = Annotated[float, pydantic.Field(gt=0)]
Count: TypeAlias = Annotated[int, pydantic.Field(ge=1, le=1_000_000)]
Seed: TypeAlias = Annotated[int, pydantic.Field(ge=0, lt=2**32)]

_NUMBERS = pydantic.ConfigDict(strict=True, allow_inf_nan=False)
_STRICT = pydantic.ConfigDict(extra="forbid", **_NUMBERS)


@dataclass_transform(kw_only_default=True, frozen_default=True, field_specifiers=(pydantic.Field,))
def settings_class(cls: type[T]) -> type[T]:
    """Turn a class of annotated fields into frozen settings that refuse unknown names."""
    make: Any = pydantic.dataclasses.dataclass(frozen=True, kw_only=True, config=_STRICT)
    return cast(type[T], make(cls))


def setting(
    default: Any,
    allowed: Any,
    *,
    static: bool = False,
    converter: Callable[[Any], Any] | None = None,
    names: tuple[str, ...] = (),
) -> Any:
    """Declare a field that users set.

    Args:
        default: the value when nothing is said.
        allowed: the type, with bounds, as pydantic reads it.
        static: a size or a name, part of the compiled program; else a number, kept as an array
            so that it may be swept and so that another value needs no other program.
        converter: checks a value and turns it into the array that the program computes with, or,
            of a static one, into its one spelling.
        names: of a choice that the program computes with as a number, counted from 0.

    """
    if static:
        convert = {} if converter is None else {"converter": converter}
        return eqx.field(default=default, static=True, metadata={"setting": allowed}, **convert)
    return eqx.field(
        default=default,
        converter=converter or _swept,
        metadata={
            "setting": allowed,
            "checked by converter": converter is not None,
            "names": names,
        },
    )


def named(default: str, functions: Mapping[str, Callable[..., Any]]) -> Any:
    """Declare a static field that takes a function, or the name of one of ours.

    Plans and files know the names only; in Python any function with the same arguments will do.
    `function_of` gives the function that the field stands for.

    Args:
        default: the name when nothing is said.
        functions: ours by name.

    """

    def known(value: Any) -> Any:
        function_of(functions, value)
        return value

    return eqx.field(
        default=default,
        static=True,
        converter=known,
        metadata={"setting": Literal[tuple(functions)], "checked by converter": True},
    )


def chosen(default: str, names: Iterable[str], converter: Callable[[Any], Any]) -> Any:
    """Declare a static field that takes an object, or the name of one of ours.

    Plans and files know the names only; in Python the object itself will do.

    Args:
        default: the name when nothing is said.
        names: of ours.
        converter: checks a value and turns it into the object.

    """
    return eqx.field(
        default=default,
        static=True,
        converter=converter,
        metadata={"setting": Literal[tuple(names)], "checked by converter": True},
    )


def function_of(functions: Mapping[str, F], value: str | F) -> F:
    """The function of that name, or the function itself.

    Raises:
        UnknownName: no function has the name.
        InvalidSettings: it is neither a name nor a function.

    """
    if callable(value):
        return value
    if not isinstance(value, str):
        raise InvalidSettings(
            f"{shown(value)} is neither a function nor a name; allowed: a function, or one of "
            f"{', '.join(functions)}."
        )
    if value not in functions:
        raise UnknownName("function", value, functions)
    return functions[value]


def of_shape(setting: str, given: Any, shape: tuple[int, ...]) -> Array:
    """What a function of a user's gave, as an array of real numbers.

    Args:
        setting: the field that the function stands in, for the message.
        given: by the function.
        shape: that it must have.

    Raises:
        InvalidSettings: it is no array of numbers, or one of another shape.

    """
    try:
        array = jnp.asarray(given)
    except (TypeError, ValueError):
        array = None
    if array is None or array.shape != shape:
        found = shown(given) if array is None else f"an array of shape {array.shape}"
        raise InvalidSettings(f"The function {setting} gives {found}; allowed: of shape {shape}.")
    return array


def _swept(value: Any) -> Any:
    """An array; what cannot be one stays what it is, and `check_settings` sees to it."""
    try:
        return value if value is None else jnp.asarray(value)
    except (TypeError, ValueError):
        return value


@cache
def settings_of(owner: type, *, omit: tuple[str, ...] = ()) -> Any:
    """Make the pydantic dataclass of a world's or a learner's settings, without those omitted."""
    fields = [
        (field.name, field.metadata["setting"], dataclasses.field(default=field.default))
        for field in dataclasses.fields(owner)
        if "setting" in field.metadata and field.name not in omit
    ]
    made = dataclasses.make_dataclass(
        f"{owner.__name__}Settings", fields, kw_only=True, frozen=True
    )
    made.__doc__ = f"Settings of `{owner.__module__}.{owner.__name__}`."
    return settings_class(made)


@cache
def _checks(owner: Any) -> list[tuple[str, "pydantic.TypeAdapter[Any]"]]:
    """The settings that are checked when an owner is built, and what is allowed."""
    return [
        (field.name, pydantic.TypeAdapter(field.metadata["setting"], config=_NUMBERS))
        for field in dataclasses.fields(owner)
        if "setting" in field.metadata and not field.metadata.get("checked by converter")
    ]


def check_settings(owner: Any) -> None:
    """Raise `InvalidSettings` naming every single value out of bounds; swept ones pass."""
    complaints = []
    for name, allowed in _checks(cast(Hashable, type(owner))):
        value = getattr(owner, name)
        if isinstance(value, Array):
            if isinstance(value, jax.core.Tracer) or value.ndim > 0:
                continue
            value = value.item()
        try:
            allowed.validate_python(value)
        except pydantic.ValidationError as error:
            reason = error.errors()[0]["msg"]
            complaints.append(f"{name} = {shown(value)}: {reason}")
    if complaints:
        raise InvalidSettings(f"{type(owner).__name__}: " + "; ".join(complaints))
