"""Tests of the learners, and the toy worlds they share."""
