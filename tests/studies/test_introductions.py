"""What pages say of our studies can be read by somebody who has not read the thesis."""

import re
from pathlib import Path

import numpy as np
import pytest

from ethogram.campaign.study import introduction_of
from ethogram.studies import STUDIES
from ethogram.studies.publishing.condition import BIG, SMALL, Condition, Size
from ethogram.studies.publishing.results import Results

RESULTS = Path(__file__).parents[2] / "docs" / "results"
# One or two letters, with or without an index or bars; or a word with an index.
SYMBOL = re.compile(r"\|[A-Z]\||\b(?:[A-Z]|[A-Za-z]{1,2}_[a-z]+|e)\b(?=[\s,.()=]|$)")
PLAIN = {"A", "B", "U", "I"}  # "A claim", "I within 10%", and the names of tests


@pytest.fixture(scope="module", params=["language", "sharing", "sensing", "publishing"])
def told(request):
    """A study's introduction, and all that its published page says in claims and tables."""
    page = (RESULTS / f"{request.param}.md").read_text().replace("\\", "")
    said = page.split("## Claims")[1].split("## Figures")[0]
    return introduction_of(STUDIES[request.param]), re.sub(r"`[^`]*`|]\([^)]*\)", "", said)


def test_every_symbol_that_claims_and_tables_use_is_explained(told):
    introduction, said = told
    used = set(SYMBOL.findall(said))
    known = {symbol for text in introduction.symbols for symbol in SYMBOL.findall(text)}
    assert used - known <= PLAIN


def test_every_study_has_a_paragraph_a_picture_and_a_source_with_author_title_and_year(told):
    introduction, _ = told
    assert len(introduction.text) > 300
    assert introduction.caption
    assert "Talamini" in introduction.source
    assert "Artificial Intelligence Strategies in Multi-agent" in introduction.source
    assert "2020" in introduction.source


@pytest.mark.parametrize("name", ["language", "sharing", "sensing", "publishing"])
def test_the_pictured_case_is_one_that_was_published(name):
    case = introduction_of(STUDIES[name]).case
    cases = {
        found
        for manifest in (RESULTS / "records" / name / "manifests").iterdir()
        for found in re.findall(r'"name": ?"([^"]+)"', manifest.read_text())
    }
    assert case in cases


def test_a_condition_that_was_run_at_another_size_says_what_differs():
    small = Size(12, 5, 60)
    run = Results({Condition("random", "mild_scrutiny", small): None})
    missing = run.trials(np.asarray, Condition("random", "mild_scrutiny", SMALL))
    assert missing.missing
    assert missing.name == (
        "random authors, mild-scrutiny editors with 100 authors, 20 journals and 1000 papers at "
        "first (run: 12 authors, 5 journals and 60 papers at first)"
    )
    other = run.trials(np.asarray, Condition("minded", "mild_scrutiny", BIG))
    assert other.name == "minded authors, mild-scrutiny editors, 1000 authors"
