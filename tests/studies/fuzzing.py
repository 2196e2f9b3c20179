"""Settings drawn at random go through the command line: each runs or is refused with a message."""

import json
import tempfile

import hypothesis.strategies as st
from hypothesis import HealthCheck, given, settings

from ethogram import cli

MESSAGES = ("Invalid", "Unknown", "needs")


def fuzz(study, small, valid, wrong, examples, capsys, *, then, messages=MESSAGES):
    """Run that many drawn settings of the smoke plan.

    Args:
        study: its name.
        small: settings that make the plan one small case.
        valid: draws settings that must run, or be refused for their size.
        wrong: draws settings of which most may not be.
        examples: how many to draw.
        capsys: pytest's.
        then: the command that must work on what was run.
        messages: words of which a refusal has one.

    Returns:
        How many ran and how many were refused.

    """
    outcomes = {"ran": 0, "refused": 0}

    @settings(max_examples=examples, suppress_health_check=[HealthCheck.function_scoped_fixture])
    @given(changes=st.one_of(valid, valid, wrong))
    def attempt(changes):
        written = [f"--set={key}={_written(value)}" for key, value in (small | changes).items()]
        with tempfile.TemporaryDirectory() as folder:
            command = ["run", study, "--plan=smoke", "--engine=inline", f"--out={folder}"]
            code = cli.main([*command, *written])
            if code == cli.DONE:
                assert cli.main([then, folder]) == cli.DONE
        said = capsys.readouterr().err
        assert code == cli.DONE or any(word in said for word in messages)
        outcomes["ran" if code == cli.DONE else "refused"] += 1

    attempt()
    return outcomes


def drawn(shapes, numbers):
    """Settings from both, each there or not."""
    numbers = st.fixed_dictionaries({}, optional=numbers)
    return st.builds(lambda shape, number: shape | number, shapes, numbers)


def misdrawn(keys, odd):
    """A few settings, by names that there are or not, with odd values."""
    names = st.sampled_from(sorted(keys)) | st.text(max_size=12)
    return st.dictionaries(names, odd, min_size=1, max_size=3)


def _written(value):
    return value if isinstance(value, str) else json.dumps(value)
