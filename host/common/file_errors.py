"""What is wrong with the values of files, in words: pydantic's errors, and those of our own types."""

import re
from reprlib import repr as short
from typing import Any, Final

from pydantic_core import PydanticCustomError

from steptwin.host.common.bad_input import nearest
from steptwin.host.common.numbers import LARGEST


def wrong(message: str) -> PydanticCustomError:
    """Return the error by which a validator refuses a value; the value's key is put in front."""
    return PydanticCustomError("wrong", "{message}", {"message": message})


_WORDS: Final = {
    "float_type": "{} is not a number",
    "finite_number": f"{{}} is not a finite number up to {LARGEST:g}",
    "int_type": "{} is not a whole number",
    "string_type": "{} is not a text",
    "bool_type": "{} is neither true nor false",
    "dict_type": "{} is not a table",
    "list_type": "{} is not a list",
    "tuple_type": "{} is not a list",
}
"""Messages by pydantic's types of errors."""

_CHOICE: Final = re.compile(r"'([^']*)'|(-?\d+)")


def error_place(error: Any) -> str:
    """Return where in a value an error of pydantic's is, such as `[2]`; nothing for the whole value."""
    return "".join(f"[{at}]" for at in error["loc"])


def error_text(error: Any) -> str:
    """Return an error of pydantic's in words."""
    value = error["input"]
    if error["type"] in ("enum", "literal_error"):
        choices = [text or number for text, number in _CHOICE.findall(error["ctx"]["expected"])]
        near = nearest(value, choices) if isinstance(value, str) else []
        meant = f": did you mean {' or '.join(near)}?" if near else ""
        return f"{short(value)} is not one of {', '.join(choices)}{meant}"
    if error["type"] == "float_type" and type(value) is int:  # one of hundreds of digits
        return _WORDS["finite_number"].format(short(value))
    if error["type"] in _WORDS:
        return _WORDS[error["type"]].format(short(value))
    return str(error["msg"])
