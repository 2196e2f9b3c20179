"""Soft robots made of voxels: the world of chapter 5, and what soft bodies share."""

from ethogram.worlds.softbody.world3d import SoftBody3D

__all__ = ["SoftBody3D"]
