"""Rendering of scenes: frames as images and as SVG, in the plane and in space, and videos."""
