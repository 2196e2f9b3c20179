"""The worlds, by name; other packages add theirs under the entry point `ethogram.worlds`."""

from typing import TYPE_CHECKING

from ethogram.core.registry import Registry

if TYPE_CHECKING:  # listing names must not load JAX
    from ethogram.core.world import World

WORLDS: "Registry[type[World]]" = Registry(
    "world",
    "ethogram.worlds",
    {
        "language": "ethogram.worlds.language:Language",
        "learnable_publishing": "ethogram.worlds.publishing.learnable:LearnablePublishing",
        "publishing": "ethogram.worlds.publishing:Publishing",
        "sharing": "ethogram.worlds.sharing:Sharing",
        "softbody2d": "ethogram.worlds.softbody:SoftBody2D",
        "softbody3d": "ethogram.worlds.softbody:SoftBody3D",
        "traffic": "ethogram.worlds.traffic:Traffic",
    },
)
