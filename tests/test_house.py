"""Limits of the house: names that exist once, folders that a reader can hold in the head, short lists of parameters."""

import pytest

from tests.house import ROOT, House


@pytest.fixture(scope="module")
def house() -> House:
    return House(ROOT)


def test_a_class_name_exists_once(house: House) -> None:
    assert house.classes_twice() == {}


def test_a_folder_has_few_entries(house: House) -> None:
    assert max(house.siblings().values()) <= 22


def test_a_file_name_exists_at_most_twice(house: House) -> None:
    assert {name: count for name, count in house.file_names().items() if count > 2} == {}


def test_a_function_has_few_parameters(house: House) -> None:
    assert max(house.parameters().values()) <= 12


def test_what_is_counted(house: House) -> None:
    """The rules themselves, on files that are known."""
    counts = {name.partition(" (")[0]: count for name, count in house.parameters().items()}
    assert counts["controller/motion/kernel.py: push"] == 6
    assert "protocol/emergency.py" in house.used_once()
    assert house.code_lines() < house.lines()
    assert house.siblings()["controller"] == 4
