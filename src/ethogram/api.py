"""The front door: worlds by name, evaluation, stored records; used as `ethogram.make` and so on."""

import dataclasses
import difflib
from pathlib import Path
from typing import TYPE_CHECKING, Any

import equinox as eqx
import jax
from jax import Array
from jaxtyping import Key

from ethogram.core.errors import InvalidSettings, require_count
from ethogram.core.keys import require_key
from ethogram.core.rollout import Policy, require_policy
from ethogram.core.world import PerRole, World
from ethogram.learners.episodes import returns_of_policy
from ethogram.worlds import WORLDS

if TYPE_CHECKING:
    from ethogram.campaign.study import Records


def make(name: str, **settings: Any) -> World:
    """A world by its name, with settings that differ from its defaults.

    Args:
        name: one of `ethogram.WORLDS`.
        settings: fields of the world.

    Raises:
        UnknownName: there is no world of that name.
        InvalidSettings: the world has no such setting, or its value is out of range.

    """
    kind = WORLDS[name]
    known = [field.name for field in dataclasses.fields(kind) if field.init]
    for setting in settings:
        if setting not in known:
            near = difflib.get_close_matches(setting, known, n=1, cutoff=0.5)
            hint = f" Did you mean {near[0]!r}?" if near else ""
            raise InvalidSettings(
                f"The world {name!r} has no setting {setting!r}.{hint} Allowed: {', '.join(known)}."
            )
    return kind(**settings)


def evaluate(world: World, policy: Policy, key: Key[Array, ""], episodes: int = 100) -> PerRole:
    """Returns of whole episodes, not discounted: Float[episode, agent] per role.

    Args:
        world: any world.
        policy: `policy(key, observation) -> action`, per role.
        key: consumed; the same key gives the same episodes.
        episodes: how many, played side by side, each from its start to its end.

    Raises:
        EthogramError: the policy is no function, the key no random key, or there is no episode.

    """
    require_policy("evaluate", policy)
    require_key("evaluate", key)
    require_count("evaluate", "episodes", episodes, least=1)
    keys = jax.random.split(key, episodes)
    return eqx.filter_jit(returns_of_policy)(world, policy, keys)


def load_records(folder: str | Path, study: str) -> "Records":
    """The stored records of a study's last run: by case, then by group, as `xarray.Dataset`s.

    Args:
        folder: of results, where `ethogram run` stored them.
        study: its name.

    Raises:
        DamagedRecords: a record cannot be used; the message names each.
        UnknownName: the folder holds nothing of the study.
        EthogramError: the folder holds no results.

    """
    from ethogram.campaign.results import DamagedRecords, collect, stores
    from ethogram.core.errors import UnknownName

    held = stores(Path(folder))
    if study not in held:
        raise UnknownName("study with results here", study, held)
    collected = collect(held[study])
    if collected.damages:
        raise DamagedRecords("\n".join(damage for _, damage in collected.damages))
    return collected.records
