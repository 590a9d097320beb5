"""The reader of untrusted tables: it reads values by key and type, and each error begins with the key."""

from enum import StrEnum

import pytest

from steptwin.host.common.tables import Table, json_table, number_at, toml_table
from tests.host.complaints import complaint_of


class Colour(StrEnum):
    RED = "red"
    GREEN = "green"


TABLE = json_table(
    '{"text": "a", "empty": "", "half": 0.5, "two": 2, "on": true, "none": null, "many": [1], "in": {"x": 1}}'
)


def test_values_are_read_by_key_and_type() -> None:
    assert (TABLE.text("text"), TABLE.text("empty")) == ("a", "")
    assert (TABLE.number("half"), TABLE.number("two"), TABLE.integer("two")) == (0.5, 2.0, 2)
    assert TABLE.truth("on")
    assert (TABLE.is_null("none"), TABLE.is_null("on")) == (True, False)
    assert TABLE.elements("many") == [1]
    assert (TABLE.optional("two", TABLE.integer), TABLE.optional("three", TABLE.integer)) == (2, None)
    assert Table({"lamp": "red"}, "table").choice("lamp", Colour) is Colour.RED
    with TABLE.section("in") as inner:
        assert inner.number("x") == 1


@pytest.mark.parametrize(
    ("read", "told"),
    [
        (lambda: TABLE.number("three"), "three: is missing"),
        (lambda: TABLE.number("text"), "text: 'a' is not a number"),
        (lambda: TABLE.number("on"), "on: True is not a number"),
        (lambda: TABLE.integer("half"), "half: 0.5 is not a whole number"),
        (lambda: TABLE.integer("two", largest=1), "two: 2 is not a whole number up to 1"),
        (lambda: TABLE.text("two"), "two: 2 is not a text"),
        (lambda: TABLE.text("empty", empty=False), "empty: '' is not a text"),
        (lambda: TABLE.truth("two"), "two: 2 is neither true nor false"),
        (lambda: TABLE.choice("text", Colour), "text: 'a' is not one of red, green"),
        (lambda: TABLE.elements("two"), "two: 2 is not a list"),
        (lambda: TABLE.each("many", Table.finish), "many[0]: 1 is not a JSON object"),
        (lambda: TABLE.section("two").__enter__(), "two: 2 is not a JSON object"),
        (lambda: TABLE.check_keys(["texts"]), "text: key 'text' is unknown: did you mean texts?"),
        (lambda: number_at("here", 1.5e9), "here: 1500000000.0 is not a finite number up to 1e+09"),
        (lambda: number_at("here", float("nan")), "here: nan is not a finite number up to 1e+09"),
        (lambda: json_table("[]"), "[] is not a JSON object"),
    ],
)
def test_each_error_begins_with_its_key(read: object, told: str) -> None:
    assert callable(read)
    assert complaint_of(read) == told


@pytest.mark.parametrize("read", [toml_table, json_table])
@pytest.mark.parametrize("text", ["{", f"x = {'9' * 5000}", f"x = {'[' * 9999}"])
def test_a_text_that_is_not_a_document_is_refused(read: object, text: str) -> None:
    assert callable(read)
    assert complaint_of(lambda: read(text)).startswith("is not ")


def test_finish_refuses_a_key_that_was_not_read() -> None:
    table = toml_table("lower = 1\nuper = 2")
    table.number("lower")
    assert "upper" not in table
    assert complaint_of(table.finish) == "uper: key 'uper' is unknown: did you mean upper?"


def test_the_largest_number_is_accepted() -> None:
    assert number_at("here", -1e9) == -1e9
    assert TABLE.integer("two", largest=2) == 2
