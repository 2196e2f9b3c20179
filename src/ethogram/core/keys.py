"""Random numbers that depend on what is done, never on where, when or in which order.

A trial's key comes from the study's seed, the case's name and the trial's number.  Inner loops
that need one random word per agent and step take it from a counter hash keyed by such a key, at
a third of the price of a full generator.
"""

import hashlib
import math
from typing import Any

import jax
import jax.numpy as jnp
from jax import Array
from jaxtyping import Float, Int, Key, UInt32

from ethogram.core.errors import EthogramError, shown


def require_key(what: str, key: Any) -> None:
    """Refuse what is no random key.

    Raises:
        EthogramError: it is a number or a key of the old kind; the message says what to use.

    """
    if not jnp.issubdtype(getattr(key, "dtype", object), jax.dtypes.prng_key):
        raise EthogramError(
            f"{what}: key = {shown(key)}; allowed: jax.random.key(seed), or a key split from one."
        )


def trial_keys(seed: int, case: str, trials: int) -> Key[Array, "trials"]:
    """Keys of a case's trials, the same whichever other cases and trials there are."""
    digest = hashlib.sha256(case.encode()).digest()
    key = jax.random.key(seed)
    for start in (0, 4):
        key = jax.random.fold_in(key, int.from_bytes(digest[start : start + 4], "big"))
    return jax.vmap(jax.random.fold_in, (None, 0))(key, jnp.arange(trials))


def fold_in(keys: Key[Array, "..."], number: Int[Array, ""] | int) -> Key[Array, "..."]:
    """Derive a new key from each key and one number, whatever the keys' shape."""
    derive = jax.random.fold_in
    for _ in range(keys.ndim):
        derive = jax.vmap(derive, (0, None))
    return derive(keys, number)


def counter_bits(key: Key[Array, ""], counter: Int[Array, "..."]) -> UInt32[Array, "..."]:
    """One random word per counter value: two rounds of an integer mixer over key and counter.

    Meant for up to some thousand counter values under one key; take a new key (`fold_in`) for
    the next episode.  The mixer's constants are Wellons' lowbias32 (2018), found by search for
    the least avalanche bias among 32-bit two-multiplication mixers.
    """
    words = jax.random.key_data(key)
    spread = counter.astype(jnp.uint32) * jnp.uint32(0x9E3779B9)
    return _mix(_mix(spread + words[..., 0]) ^ words[..., 1])


def random_words(key: Key[Array, ""], *shape: int) -> UInt32[Array, "..."]:
    """An array of random words, by `counter_bits`: in inner loops, far cheaper than a generator."""
    return counter_bits(key, jnp.arange(math.prod(shape)).reshape(shape))


def branch(key: Key[Array, ""], number: Int[Array, ""] | int) -> Key[Array, ""]:
    """A new key from a key and a number below 2^30, by `counter_bits`: a `fold_in` for inner loops.

    It shares no word with `random_words` of less than 2^31 of them.
    """
    place = 2 * jnp.asarray(number) + jnp.int32(-(2**31))
    data = counter_bits(key, place[..., None] + jnp.arange(2))
    return jax.random.wrap_key_data(data)


def unit(bits: UInt32[Array, "..."]) -> Float[Array, "..."]:
    """Random words as numbers between 0 and 1, in steps of 2^-32 near 0 and of 2^-24 near 1."""
    return (bits.astype(jnp.float32) + 0.5) * jnp.float32(2.0**-32)


def gaussian(bits: UInt32[Array, "..."]) -> Float[Array, "..."]:
    """Random words as numbers from the standard normal distribution, within 6.2 of 0."""
    return jax.scipy.special.ndtri(jnp.clip(unit(bits), 2.0**-32, 1 - 2.0**-24))


def scaled(bits: UInt32[Array, "..."], bound: Int[Array, "..."] | int) -> Int[Array, "..."]:
    """Random words as whole numbers from 0 to below a bound: word x bound / 2^32, rounded down.

    Any range of them has its exact chance to 2^-32; computed in halves, as 64 bits may be off.
    """
    high, low = bits >> 16, bits & 0xFFFF
    whole = jnp.asarray(bound).astype(jnp.uint32)
    above, below = whole >> 16, whole & 0xFFFF
    middle = high * below + ((low * below) >> 16)
    carry = low * above + (middle & 0xFFFF)
    return (high * above + (middle >> 16) + (carry >> 16)).astype(jnp.int32)


def _mix(x: UInt32[Array, "..."]) -> UInt32[Array, "..."]:
    x = (x ^ (x >> 16)) * jnp.uint32(0x7FEB352D)
    x = (x ^ (x >> 15)) * jnp.uint32(0x846CA68B)
    return x ^ (x >> 16)
