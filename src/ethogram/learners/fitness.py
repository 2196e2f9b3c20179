"""From a world to a fitness: how well a policy network does whose parameters are a genome."""

from typing import Annotated, ClassVar

import equinox as eqx
import jax
import jax.numpy as jnp
from jax import Array
from jax.flatten_util import ravel_pytree
from jaxtyping import Float, Key
from pydantic import Field

from ethogram.core.module import Module
from ethogram.core.rollout import Policy, PolicyWithExtras
from ethogram.core.search_space import SearchSpace
from ethogram.core.settings import setting
from ethogram.core.specs import role_specs
from ethogram.core.world import PerRole, World
from ethogram.learners.action_heads import (
    HEADS,
    action_shares,
    decoded_action,
    encoded_action,
    reachable,
    require_head,
)
from ethogram.learners.base import Spaces
from ethogram.learners.critic_input import encode_observations
from ethogram.learners.episodes import episode_returns, rewards_of_policy
from ethogram.learners.evolution.base import Evaluation
from ethogram.learners.networks import MLP, feature_count, used_features

DESCRIPTORS = 2  # of behaviour; fewer where actions have fewer numbers


class PolicyFitness(Module):
    """The mean return of an agent when each role acts by a network of its own.

    A genome holds the parameters of all networks.  Policies draw nothing: weights of choices are
    the softmax of the outputs, choices the largest, boxes squashed (see `action_heads`).
    All candidates of a generation play the same episodes (common random numbers).

    A candidate's descriptor is how it acts: the first two numbers of an action as a network reads
    it, those of the roles one after the other, each the mean over agents, steps and episodes.  Of
    choices they are how often each is made, of a box where in its range the action is.

    Attributes:
        world: any whose actions are `Discrete`, `Simplex`, or a `Box` with finite bounds.
        key: draws the episodes, which are then the same in all generations; without it, each
            generation has new ones.
        episodes: over which the mean is.
        hidden_size: units in the hidden layer of a network.
        reach: parameters are first drawn from -reach to reach; they have no limits.

    """

    spaces: ClassVar[Spaces] = Spaces(action=HEADS)

    world: World
    key: Key[Array, ""] | None = None
    episodes: int = setting(1, Annotated[int, Field(ge=1, le=1_000_000)], static=True)
    hidden_size: int = setting(8, Annotated[int, Field(ge=1, le=100_000)], static=True)
    reach: float = setting(1.0, Annotated[float, Field(gt=0)], static=True)

    def __check_init__(self) -> None:
        """Refuse a world that networks cannot act in.

        Raises:
            EthogramError: a role's actions are no choices and no bounded box.

        """
        for name, role in self.world.roles.items():
            require_head("PolicyFitness", name, role.action)

    @property
    def deterministic(self) -> bool:
        """Whether a genome has the same fitness in every generation."""
        return self.key is not None

    @property
    def search_space(self) -> SearchSpace:
        """Where genomes are drawn."""
        roles = role_specs(self.world).values()
        ends = [(feature_count(role.observation), feature_count(role.action)) for role in roles]
        genes = sum(MLP.numbers(before, (self.hidden_size,), after) for before, after in ends)
        drawn, limit = jnp.full(genes, self.reach), jnp.full(genes, jnp.inf)
        return SearchSpace(-drawn, drawn, -limit, limit)

    def __call__(self, key: Key[Array, ""], genomes: Float[Array, "candidate gene"]) -> Evaluation:
        """The fitness and the descriptor of candidates, all in the same episodes."""
        keys = jax.random.split(key if self.key is None else self.key, self.episodes)

        def judge(genome: Float[Array, "gene"]) -> tuple[Array, Array]:
            played = rewards_of_policy(self.world, self._described(genome), keys)
            returns = jnp.concatenate([*episode_returns(played).values()], -1).mean()
            ends = played.episode_end
            counted = (jnp.cumsum(ends, -1) - ends == 0)[..., None]
            shares = jnp.where(counted, played.extras, 0.0).sum((0, 1)) / counted.sum()
            return returns, shares

        fitness, descriptor = jax.vmap(judge)(genomes)
        return Evaluation(fitness, ~jnp.isfinite(fitness), descriptor)

    def policy(self, genome: Float[Array, "gene"]) -> Policy:
        """How the networks act whose parameters are a genome."""
        act = self._described(genome)
        return lambda key, observation: act(key, observation)[0]

    def _described(self, genome: Float[Array, "gene"]) -> PolicyWithExtras:
        """The policy, with the first numbers of what all agents do, from 0 to 1, their mean."""
        roles = self.world.roles
        networks = self._networks(genome)

        def act(key: Key[Array, ""], observation: PerRole) -> tuple[PerRole, Array]:
            del key
            encoded = encode_observations(roles, observation)
            action, shares, used = {}, [], []
            for name, role in roles.items():
                outputs = reachable(role.action, networks[name](encoded[name]))
                whole = encoded_action(role.action, None, outputs, 1.0)
                action[name] = decoded_action(role.action, whole)
                shares.append(action_shares(role.action, whole).mean(0))
                used.append(used_features(role.action))
            first = jnp.argsort(~jnp.concatenate(used), stable=True)[:DESCRIPTORS]
            return action, jnp.concatenate(shares)[first]

        return act

    def _networks(self, genome: Float[Array, "gene"]) -> dict[str, MLP]:
        """A network per role, with the genome's numbers."""
        key = jax.random.key(0)
        like = {
            name: eqx.filter_eval_shape(
                MLP.init,
                key,
                used_features(role.observation),
                (self.hidden_size,),
                used_features(role.action),
            )
            for name, role in self.world.roles.items()
        }
        zeros = jax.tree.map(lambda spec: jnp.zeros(spec.shape, spec.dtype), like)
        networks: dict[str, MLP] = ravel_pytree(zeros)[1](genome)
        return networks
