"""What caused the error, on the screen, in the document and on the page."""

from __future__ import annotations

import json
from dataclasses import replace

import jsonschema
import pytest

from vehnav.config import Config
from vehnav.report.causes import causes_block, causes_lines, causes_of
from vehnav.report.html import render_html
from vehnav.report.schema import schema
from vehnav.report.summary import summary


def test_the_document_holds_the_methods_explained(city, city_document) -> None:
    tree = city_document["errors"]["causes"]
    assert list(tree) == ["default", "as_published", "free"]
    jsonschema.validate(json.loads(json.dumps(city_document)), schema())
    for found in tree.values():
        shares = sum(cause["share"] for cause in found["causes"])
        assert shares + found["unexplained"] == pytest.approx(1.0)
        assert found["residual_m"] < found["rms_m"]


def test_the_schema_refuses_a_cause_without_its_share(city_document) -> None:
    broken = json.loads(json.dumps(city_document))
    del broken["errors"]["causes"]["free"]["causes"][0]["share"]
    with pytest.raises(jsonschema.ValidationError, match="share"):
        jsonschema.validate(broken, schema())


def test_the_screen_says_which_method_is_explained(city) -> None:
    lines = causes_lines(city)
    assert lines[0].startswith("cause      default: ")
    assert max(map(len, lines)) < 100
    assert lines[0] in summary(city)


def test_the_page_has_the_table_and_the_other_methods(city, city_document) -> None:
    page = render_html(city, city_document)
    assert '<section id="causes">' in page
    block = causes_block(city)
    assert block in page
    assert "<b>as published</b>" in block
    assert "unexplained" in block


def test_they_are_computed_once_for_a_run(city) -> None:
    assert causes_of(city) is causes_of(city)
    assert causes_of(replace(city)) is not causes_of(city)


def test_nothing_is_said_without_a_judge_or_for_filters(city) -> None:
    assert causes_lines(replace(city, errors=None)) == []
    assert causes_block(replace(city, errors=None)) == ""
    assert causes_of(replace(city, config=Config(method="filter"))) == {}


def test_a_causal_run_explains_the_methods_that_do_not_look_ahead(city) -> None:
    """The causal default follows the bias but distributes nothing: no model of it is fitted."""
    found = causes_of(replace(city, config=Config(causal=True)))
    assert list(found) == ["as_published", "free"]
