"""Tests of the campaign, on a toy study that takes no time and can be told to go wrong."""
