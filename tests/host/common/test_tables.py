"""The reader of untrusted tables: it reads values by key and type, and each error begins with the key."""

from enum import StrEnum

import pytest

from steptwin.host.common.tables import Table, check_name, json_table, number_at, toml_table
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
    assert Table({"lamp": "red"}, "table").choice("lamp", Colour) is Colour.RED
    with TABLE.section("in") as inner:
        assert inner.number("x") == 1


@pytest.mark.parametrize(
    "read",
    [
        lambda: TABLE.number("three"),
        lambda: TABLE.number("text"),
        lambda: TABLE.number("on"),
        lambda: TABLE.integer("half"),
        lambda: TABLE.integer("two", largest=1),
        lambda: TABLE.text("two"),
        lambda: TABLE.text("empty", empty=False),
        lambda: TABLE.truth("two"),
        lambda: TABLE.choice("text", Colour),
        lambda: TABLE.elements("two"),
        lambda: TABLE.each("many", lambda table: table),
        lambda: TABLE.section("two").__enter__(),
        lambda: TABLE.check_keys(["texts"]),
        lambda: number_at("here", 1.5e9),
        lambda: number_at("here", float("nan")),
        lambda: json_table("[]"),
    ],
)
def test_each_error_begins_with_its_key(read: object) -> None:
    assert callable(read)
    complaint_of(read)


def test_a_line_that_is_not_toml_is_shown() -> None:
    told = complaint_of(lambda: toml_table("a = 1\r\n  l1_mm = 200,5\x1b\nb = 2"))
    assert told.startswith("is not TOML: ")
    assert told.endswith("(at line 2, column 14): l1_mm = 200,5\\x1b")
    complaint_of(lambda: toml_table("a = ["))


@pytest.mark.parametrize("read", [toml_table, json_table])
@pytest.mark.parametrize("text", ["{", f"x = {'9' * 5000}", f"x = {'[' * 9999}"])
def test_a_text_that_is_not_a_document_is_refused(read: object, text: str) -> None:
    assert callable(read)
    complaint_of(lambda: read(text))


@pytest.mark.parametrize(
    ("name", "chars_max"),
    [
        ("x" * 9, 8),
        ("a\x1b[31m", 8),
        ("a\u202e", 8),
        ("a\n", 8),
    ],
)
def test_a_name_is_short_and_printable(name: str, chars_max: int) -> None:
    complaint_of(lambda: check_name(name, chars_max))
    check_name("Größe θ₁ [$]", 12)
    check_name("x" * chars_max, chars_max)


def test_the_largest_number_is_accepted() -> None:
    assert number_at("here", -1e9) == -1e9
    assert TABLE.integer("two", largest=2) == 2
