"""Finding effects by name and text, and listing them."""

import json
import re

import pytest

from bns.errors import BnsError, UnknownNameError
from bns.worlds.effects import listing, registry
from bns.worlds.effects.base import STAGES

NAMES = registry.names()


def test_listing_is_plain_data_for_every_effect():
    rows = listing.rows()
    assert json.loads(json.dumps(rows)) == rows
    assert sorted(row["name"] for row in rows) == list(NAMES)
    stages = [STAGES.index(row["stage"]) for row in rows]
    assert stages == sorted(stages)
    for row in rows:
        assert str(registry.parse(row["example"])) == row["example"]


def test_unknown_effect_gets_a_suggestion():
    with pytest.raises(UnknownNameError, match="Did you mean 'wheel_gain'"):
        registry.get("wheel_gian")


def test_a_piece_without_equals_belongs_to_the_value_before_it():
    with pytest.raises(UnknownNameError, match="'left,right'"):
        registry.parse("wheel_gain:wheel=left,right,factor=0.8")


@pytest.mark.parametrize("rest", ["", "0.8", "=1", "factor=1,,", "factor=1,factor=0.5"])
def test_bad_text_is_refused_with_an_example(rest):
    with pytest.raises(BnsError, match=re.escape(registry.EXAMPLE)):
        registry.parse(f"wheel_gain:{rest}")


def test_a_table_without_a_name_is_refused():
    with pytest.raises(BnsError, match="has no name"):
        registry.from_table({"factor": 0.8})
