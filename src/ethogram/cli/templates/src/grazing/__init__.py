"""What this package adds to Ethogram; its entry points are in `pyproject.toml`."""
