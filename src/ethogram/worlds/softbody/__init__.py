"""Soft robots made of voxels: the worlds of chapters 5 and 6, and what soft bodies share."""

from ethogram.worlds.softbody.world2d import SoftBody2D
from ethogram.worlds.softbody.world3d import SoftBody3D

__all__ = ["SoftBody2D", "SoftBody3D"]
