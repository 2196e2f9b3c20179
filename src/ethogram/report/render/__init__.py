"""Drawing of scenes: frames as pictures and as SVG, in the plane and in space, and films."""
