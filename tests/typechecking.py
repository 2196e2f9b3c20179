"""The checker of shapes and types in tests; whole numbers pass for real ones, as in Python."""

from beartype import BeartypeConf, beartype

check = beartype(conf=BeartypeConf(is_pep484_tower=True))
