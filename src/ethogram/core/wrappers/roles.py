"""Policies of single roles: made into one of a whole world, or made part of the world."""

import dataclasses
from collections.abc import Callable, Mapping
from typing import Any

import equinox as eqx
from jax import Array
from jaxtyping import Key

from ethogram.core.errors import EthogramError, UnknownName, shown
from ethogram.core.keys import branch
from ethogram.core.module import Module
from ethogram.core.rollout import Policy, require_policy
from ethogram.core.world import Outcome, PerRole, Role, World
from ethogram.core.wrappers.base import Wrapper

RolePolicy = Callable[[Key[Array, ""], Array], Array]  # (key, a role's observation) -> its action


class RolePolicies(Module):
    """One policy of several roles, made of one policy for each."""

    policies: Mapping[str, RolePolicy]

    def __check_init__(self) -> None:
        """Refuse what is no policy.

        Raises:
            EthogramError: naming role and value.

        """
        _require_policies("RolePolicies", self.policies)

    def __call__(self, key: Key[Array, ""], observation: PerRole) -> PerRole:
        """Each role acts on what it observes, with a key by its place in the alphabet."""
        return {
            role: self.policies[role](branch(key, number), observation[role])
            for number, role in enumerate(sorted(self.policies))
        }


class GivenPolicies(Wrapper):
    """A world some of whose roles follow given policies, for a learner of the others.

    Its roles are those that remain.  What the given ones observe, do and earn, nobody is told.
    """

    given: Mapping[str, RolePolicy] = eqx.field(default_factory=dict)

    def __check_init__(self) -> None:
        """Refuse what is no policy, or one of no role, and a world that nobody is left in.

        Raises:
            UnknownName: a role is none of the world's.
            EthogramError: a policy is no function, or no role is left.

        """
        _require_policies("GivenPolicies", self.given)
        roles = self.world.roles
        for role in self.given:
            if role not in roles:
                raise UnknownName("role", role, roles)
        if not set(roles) - set(self.given):
            raise EthogramError(
                f"GivenPolicies: all roles of {type(self.world).__name__} have a policy; allowed: "
                "that one role or more is left. A policy of all roles is "
                "RolePolicies({role: policy, ...})."
            )

    @property
    def roles(self) -> dict[str, Role]:
        """Those that have no given policy."""
        return {role: each for role, each in self.world.roles.items() if role not in self.given}

    def reset(self, key: Key[Array, ""]) -> tuple[Any, PerRole]:
        """As the other world."""
        state, observation = self.world.reset(key)
        return state, self._of_others(observation)

    def observe(self, state: Any) -> PerRole:
        """What the roles observe that have no given policy."""
        return self._of_others(self.world.observe(state))

    def step(self, key: Key[Array, ""], state: Any, action: PerRole) -> tuple[Any, Outcome]:
        """As the other world, with the actions of the given policies."""
        for_given, for_world = branch(key, 0), branch(key, 1)
        given = RolePolicies(self.given)(for_given, self.world.observe(state))
        after, outcome = self.world.step(for_world, state, {**action, **given})
        parts = ("observation", "reward", "terminated", "truncated", "acting")
        others = {name: self._of_others(getattr(outcome, name)) for name in parts}
        return after, dataclasses.replace(outcome, **others)

    def completed(self, policy: Any) -> Any:
        """A policy of the world inside, of one of this world: all roles act."""

        def act(key: Key[Array, ""], observation: PerRole) -> Any:
            given = RolePolicies(self.given)(branch(key, 0), observation)
            chosen = policy(branch(key, 1), self._of_others(observation))
            action = chosen[0] if isinstance(chosen, tuple) else chosen
            both = {role: (given | action)[role] for role in self.world.roles}
            return (both, chosen[1]) if isinstance(chosen, tuple) else both

        return act

    def _of_others(self, values: PerRole) -> PerRole:
        return {role: value for role, value in values.items() if role not in self.given}


def _require_policies(owner: str, policies: Any) -> None:
    if not isinstance(policies, Mapping):
        raise EthogramError(
            f"{owner}: {shown(policies)}; allowed: policies by role, {{role: policy, ...}}."
        )
    for role, policy in policies.items():
        require_policy(f"{owner}: of the role {role!r}", policy)


def completed(world: World, policy: Policy) -> Policy:
    """A policy of the world inside the outermost wrappers that give policies."""
    while isinstance(world, GivenPolicies):
        policy, world = world.completed(policy), world.world
    return policy
