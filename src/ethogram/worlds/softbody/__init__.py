"""The world of chapter 5: soft robots made of voxels."""

from ethogram.worlds.softbody3d.world import SoftBody3D

__all__ = ["SoftBody3D"]
