"""What a step may be given: an array per role, whose shape and kind of number are the space's."""

from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax import Array

from ethogram.core.errors import EthogramError
from ethogram.core.spaces import is_of_kind

if TYPE_CHECKING:
    from ethogram.core.world import PerRole, Role

Roles = Mapping[str, "Role"]


class InvalidAction(EthogramError):
    """An action of another form than its role's, or, where values are checked, out of its space."""


def formed(world: str, roles: Roles, action: Any) -> "PerRole":
    """The action as arrays; costs nothing in a compiled program.

    Args:
        world: its name, for the message.
        roles: of the world.
        action: what a step was given.

    Raises:
        InvalidAction: a role is missing or is none of the world's; or an array has another shape
            than one action for each of the role's agents, or numbers of another kind.

    """
    if not isinstance(action, Mapping) or set(action) != set(roles):
        found = f"the roles {_listed(action)}" if isinstance(action, Mapping) else repr(action)
        raise InvalidAction(
            f"{world}: an action is an array for each of the roles {_listed(roles)}; given: "
            f"{found}."
        )
    return {name: _of_role(world, name, role, action[name]) for name, role in roles.items()}


def _of_role(world: str, name: str, role: "Role", given: Any) -> Array:
    value = _as_array(given)
    shape = (role.agents, *role.action.shape)
    if value is None or value.shape != shape or not is_of_kind(role.action, value):
        kind = jnp.result_type(role.action.kind).name
        found = repr(given) if value is None else f"{value.dtype}{list(value.shape)}"
        raise InvalidAction(
            f"{world}: the action of the role {name!r} is {kind}{list(shape)}, for each of "
            f"{role.agents} agents one of {role.action}; given: {found}."
        )
    return value.astype(jnp.result_type(role.action.kind))


def _as_array(given: Any) -> Array | None:
    """An array as JAX computes with it; whole numbers beyond its range are the last ones in it."""
    largest = np.iinfo(jnp.result_type(int))
    try:
        if not isinstance(given, Array) and not _is_traced(given):
            given = np.asarray(given)
            if given.dtype.kind in "iu":
                given = given.clip(largest.min, largest.max).astype(largest.dtype)
        with np.errstate(over="ignore"):
            value = jnp.asarray(given)
    except (TypeError, ValueError, OverflowError):
        return None
    unsigned = jnp.issubdtype(value.dtype, jnp.unsignedinteger)
    return jnp.minimum(value, largest.max) if unsigned else value


def _is_traced(given: Any) -> bool:
    """Whether any number is not known yet, as in a list of them inside `jit`."""
    return any(isinstance(leaf, Array) for leaf in jax.tree.leaves(given))


def nearest(roles: Roles, action: "PerRole") -> "PerRole":
    """The action with what is out of its space taken for what is in it (see the spaces)."""
    return {name: role.action.nearest(action[name]) for name, role in roles.items()}


def require_inside(world: str, roles: Roles, action: "PerRole") -> "PerRole":
    """The action, if it is in its spaces; inside `jit` the error is raised as the program runs.

    Raises:
        InvalidAction: a value is out of its space; inside `jit`, what `equinox.error_if` raises.

    """
    checked = {}
    for name, role in roles.items():
        value, inside = action[name], role.action.contains(action[name])
        what = f"{world}: the action of the role {name!r} is out of {role.action}"
        if isinstance(inside, jax.core.Tracer):
            checked[name] = eqx.error_if(value, ~inside.all(), f"{what}.")
            continue
        for agent in np.flatnonzero(~np.asarray(inside))[:1]:
            raise InvalidAction(f"{what}: that of agent {agent} is {np.asarray(value[agent])}.")
        checked[name] = value
    return checked


def admitting(step: Callable[..., Any]) -> Callable[..., Any]:
    """A world's `step` that only ever sees actions of the right form, in their spaces."""

    def admitted(self: Any, key: Any, state: Any, action: Any) -> Any:
        roles = self.roles
        action = formed(type(self).__name__, roles, action)
        return step(self, key, state, nearest(roles, action))

    for attribute in ("__module__", "__name__", "__qualname__", "__doc__"):
        setattr(admitted, attribute, getattr(step, attribute))
    admitted.__wrapped__ = step  # type: ignore[attr-defined]
    return admitted


def _listed(names: Mapping[str, Any]) -> str:
    return ", ".join(repr(name) for name in names) or "none"
