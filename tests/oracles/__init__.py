"""Plain, slow versions of what the library computes fast: to be read beside the thesis."""
