"""Modules whose methods `jax.jit` takes as it takes functions."""

import dataclasses
from collections.abc import Callable
from types import FunctionType, MethodType
from typing import TYPE_CHECKING, Any

import equinox as eqx
import jax
import jax.numpy as jnp

from ethogram.core.settings import check_settings


class Module(eqx.Module):
    """An `equinox.Module` that can be given to `jax.jit`, and so can its methods.

    `jax.jit` tells the functions that it is given apart by hash and equality.  Those of Equinox go
    by the values of arrays, which have no hash, and which cannot be compared while JAX traces.  A
    module of this class is equal to itself alone, and a method to the same one of the same module.
    As nothing in a module ever changes, no program is used again for other values; another module,
    also one of the same values, is another program.  (`eqx.tree_equal` compares values;
    `eqx.filter_jit` has one program for modules that differ in the values of arrays only.)
    """

    __hash__ = object.__hash__
    __eq__ = object.__eq__

    def __check_init__(self) -> None:
        """Refuse settings out of range, naming each (see `ethogram.core.settings`)."""
        check_settings(self)

    def __repr__(self) -> str:
        """The class with the values of its fields: `Sharing(scenario='cooperative', agents=10)`."""
        fields = dataclasses.fields(self)
        shown = ", ".join(
            f"{field.name}={_shown(getattr(self, field.name, None), field)}" for field in fields
        )
        return f"{type(self).__name__}({shown})"

    if not TYPE_CHECKING:

        def __getattribute__(self, name):
            """As ever, but methods are `Method`s."""
            found = object.__getattribute__(self, name)
            is_magic = name.startswith("__") and name.endswith("__")
            if is_magic or not isinstance(found, MethodType) or found.__self__ is not self:
                return found
            return Method(found.__func__, self)


def _shown(value: Any, field: "dataclasses.Field[Any]") -> str:
    """A field's value for a reader: numbers as numbers, functions and numbered choices by name."""
    if isinstance(value, jax.core.Tracer):
        return str(value)
    is_key = isinstance(value, jax.Array) and jnp.issubdtype(value.dtype, jax.dtypes.prng_key)
    if isinstance(value, jax.Array) and not value.ndim and not is_key:
        number = value.item()
        names = field.metadata.get("names", ())
        if names:
            return repr(names[number]) if 0 <= number < len(names) else str(number)
        # a 32-bit number in as few digits as tell it
        return repr(number) if isinstance(number, bool | int) else f"{number:.7g}"
    if isinstance(value, jax.Array):
        return eqx.tree_pformat(value)
    if isinstance(value, FunctionType):
        return value.__qualname__
    return repr(value)


class Method(eqx.Module):
    """A method of a module: a tree of the module's arrays, as those of Equinox, with a hash."""

    function: Callable[..., Any] = eqx.field(static=True)
    module: Module

    def __post_init__(self) -> None:
        """Go by the name, and have the help, of the function."""
        for name in ("__module__", "__name__", "__qualname__", "__doc__"):
            setattr(self, name, getattr(self.function, name))

    def __call__(self, *arguments: Any, **named: Any) -> Any:
        """Call it."""
        return self.function(self.module, *arguments, **named)

    def __hash__(self) -> int:
        return hash((self.function, id(self.module)))

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Method):
            return False
        return self.function == other.function and self.module is other.module

    @property
    def __wrapped__(self) -> Any:
        return MethodType(self.function, self.module)
