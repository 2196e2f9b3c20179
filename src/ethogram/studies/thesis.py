"""The thesis whose experiments the studies rebuild."""

_TITLE = (
    "Artificial Intelligence Strategies in Multi-agent Reinforcement Learning and Robotic Agents "
    "Evolution"
)


def chapter(number: int) -> str:
    """A chapter of it as a source: author, title, year."""
    return (
        f"J. Talamini, {_TITLE}, doctoral thesis, University of Trieste, 2020: chapter {number}. "
        "Sections, figures, tables and equations are counted as there."
    )
