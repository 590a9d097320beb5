"""Types of values in the models of files (`file_models`): numbers within limits, names, choices, lists of tables.

Each annotates the type of a field: it says what is wrong with a value, and what the JSON schema tells of it.
"""

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import lru_cache, partial
from math import inf, isnan
from reprlib import repr as short
from types import UnionType
from typing import TYPE_CHECKING, Annotated, Any, Union, get_args, get_origin, get_type_hints

from pydantic import GetCoreSchemaHandler, GetJsonSchemaHandler
from pydantic_core import CoreSchema, core_schema

from steptwin.host.common.bad_input import nearest, nearest_within, outside, shortened, unknown
from steptwin.host.common.errors import InputError
from steptwin.host.common.file_errors import wrong
from steptwin.host.common.findings import check_all
from steptwin.host.common.numbers import LARGEST
from steptwin.host.common.tables import check_name

if TYPE_CHECKING:
    from steptwin.host.common.file_models import FileReading


class ValueLimit(ABC):
    """Base of what annotates the type of a value that must keep a limit."""

    __slots__ = ()

    @abstractmethod
    def complaint(self, value: Any) -> str:
        """Return what is wrong with a value, with limit and nearest right one; nothing if it keeps it."""

    def check(self, value: Any) -> Any:
        """Return a value; raise pydantic's error if it does not keep the limit."""
        if text := self.complaint(value):
            raise wrong(text)
        return value

    def __get_pydantic_core_schema__(self, source: object, handler: GetCoreSchemaHandler) -> CoreSchema:
        return core_schema.no_info_after_validator_function(self.check, handler(source))


@dataclass(frozen=True, slots=True)
class Within(ValueLimit):
    """Annotates a number that must be within limits.

    Attributes:
        least: lower limit.
        most: upper limit.
        unit: unit of the value in messages and in the schema.
        open: True if the number must be above the lower limit.
    """

    least: float = -LARGEST
    most: float = LARGEST
    unit: str = ""
    open: bool = False

    def complaint(self, value: Any) -> str:
        """Return what is wrong with a number, with the nearest right one; nothing for one within the limits."""
        unit = f" {self.unit}" if self.unit else ""
        if (isinstance(value, float) and isnan(value)) or abs(value) > LARGEST >= self.most:
            kind = "whole" if isinstance(value, int) else "finite"
            return f"{short(value)} is not a {kind} number up to {LARGEST:g}"
        if self.least < value <= self.most or (value == self.least and not self.open):
            return ""
        if self.open:
            most = "" if self.most == LARGEST else f" and up to {self.most:g}{unit}"
            return f"{value:g}{unit} is not above {self.least:g}{most}"
        if self.most == LARGEST:
            return f"{value:g}{unit} is {f'below {self.least:g}{unit}' if self.least else 'negative'}"
        if isinstance(value, int):
            limits = f"outside {self.least}..{self.most}{unit}" if unit else f"not from {self.least} to {self.most}"
            return f"{value}{unit} is {limits}"
        near = nearest_within(value, self.least, self.most, self.unit).rstrip()
        return f"{outside(value, self.least, self.most, self.unit)}{near}"

    def __get_pydantic_json_schema__(self, schema: CoreSchema, handler: GetJsonSchemaHandler) -> dict[str, Any]:
        made = handler(schema)
        if self.least > -LARGEST:
            made["exclusiveMinimum" if self.open else "minimum"] = self.least
        if self.most < LARGEST:
            made["maximum"] = self.most
        return made


Positive = Annotated[float, Within(0.0, open=True)]
"""A number above 0."""
NotNegative = Annotated[float, Within(0.0)]
"""A number of at least 0."""


@dataclass(frozen=True, slots=True)
class Name(ValueLimit):
    """Annotates a text that is a name: printable, not empty, of a greatest length."""

    chars_max: int

    def complaint(self, value: Any) -> str:
        """Return why a text is no name; nothing if it is one."""
        if not value:
            return f"{value!r} is empty"
        try:
            check_name(value, self.chars_max)
        except InputError as error:
            return str(error)
        return ""

    def __get_pydantic_json_schema__(self, schema: CoreSchema, handler: GetJsonSchemaHandler) -> dict[str, Any]:
        return {**handler(schema), "minLength": 1, "maxLength": self.chars_max}


@dataclass(frozen=True, slots=True)
class Choice(ValueLimit):
    """Annotates a text or a whole number that is one of some; a message offers the nearest names, or all numbers.

    Attributes:
        what: what they are, such as `model`; empty where the key says it.
        choices: the names or numbers, or what returns them when a value is read.
    """

    what: str
    choices: tuple[Any, ...] | Callable[[], tuple[Any, ...]]

    def _choices(self) -> tuple[Any, ...]:
        return self.choices() if callable(self.choices) else self.choices

    def complaint(self, value: Any) -> str:
        """Return what to say of a value that is none of the choices; nothing for one of them."""
        choices = self._choices()
        if value in choices:
            return ""
        if isinstance(value, str):
            return str(unknown(self.what, value, choices)).lstrip()
        return f"{value} is not one of {', '.join(map(str, choices))}"

    def __get_pydantic_json_schema__(self, schema: CoreSchema, handler: GetJsonSchemaHandler) -> dict[str, Any]:
        return {**handler(schema), "enum": list(self._choices())}


def check_limits(settings: object) -> None:
    """Raise InputError, with a message for each, unless the values of a dataclass are within their annotated limits.

    pydantic has checked those of a file; this is for `__post_init__`, since programs make the dataclasses as well.
    """
    model: Any = type(settings)
    check_all(*(partial(_check_limit, settings, name, limit) for name, limit in _limits(model)))


def _check_limit(settings: Any, name: str, limit: ValueLimit) -> None:
    value, default = getattr(settings, name), type(settings).__dataclass_fields__[name].default
    if value not in (None, default) and (text := limit.complaint(value)):
        raise InputError(f"{name}: {text}")


@lru_cache(maxsize=100)
def _limits(model: Any) -> list[tuple[str, ValueLimit]]:
    found: list[tuple[str, ValueLimit]] = []
    for name, hint in get_type_hints(model, include_extras=True).items():
        for each in get_args(hint) if get_origin(hint) in (Union, UnionType) else (hint,):  # `Positive | None` as well
            found += [(name, limit) for limit in getattr(each, "__metadata__", ()) if isinstance(limit, ValueLimit)]
    return found


@dataclass(frozen=True, slots=True)
class Values:
    """Annotates a list of a fixed number of values; `told` says what they are, as in `a point has three: [x, y, z]`."""

    told: str

    def __get_pydantic_core_schema__(self, source: Any, handler: GetCoreSchemaHandler) -> CoreSchema:
        count = len(get_args(source))

        def check(values: object) -> object:
            if not isinstance(values, list | tuple):
                raise wrong(f"{short(values)} is not a list")
            if len(values) != count:
                raise wrong(f"has {len(values)} values, but {self.told}")
            return values

        return core_schema.no_info_before_validator_function(check, handler(source))


@dataclass(frozen=True, slots=True)
class TableList:
    """Annotates a list of tables, whose places are such as `step 2`, and `step 2.1` for a list in one of them.

    Attributes:
        what: what they are, if there must be at least one; empty: the list's key says it.
        most: largest number of them.
        read: returns what stands for a table, from its model, a `Part` of it, or None if nothing of it could be read.
    """

    what: str = ""
    most: float = inf
    read: Callable[[Any], Any] = lambda row: row

    def check(self, value: object, place: str) -> None:
        """Raise pydantic's error unless a value is a list of so many; `place` is its header, empty in another list."""
        if isinstance(value, dict) and place:
            each = f"each {self.what}".rstrip()
            raise wrong(f"is a table, not a list: begin {each} with [[{place}]], in two pairs of brackets")
        if not isinstance(value, list):
            raise wrong(f"{short(value)} is not a list")
        if self.what and not value:
            raise wrong(f"has no {self.what}s")
        if len(value) > self.most:
            raise wrong(f"has {len(value)} {self.what}s, more than {self.most:g}")


class OneOf:
    """Annotates a table of which one key, the verb, says what the others are.

    `Annotated[Any, OneOf("step", lambda: {"go": Go, "line": Line})]` is read by the model of the one verb that it has.
    Such tables may be in each other.

    Attributes:
        what: what has one of the verbs.
        models: returns the models by their verbs.
        meant: verbs that are meant by other words.
    """

    def __init__(self, what: str, models: Callable[[], Mapping[str, Any]], meant: Mapping[str, str] | None = None):
        self.what, self.models, self.meant = what, models, meant or {}
        self._is_open = False

    def __get_pydantic_core_schema__(self, _: object, handler: GetCoreSchemaHandler) -> CoreSchema:
        schema = classmethod(lambda _cls, _source, inner: self._schema(inner))
        return handler.generate_schema(type(self.what, (), {"__get_pydantic_core_schema__": schema}))

    def _schema(self, handler: GetCoreSchemaHandler) -> CoreSchema:
        if self._is_open:
            return core_schema.definition_reference_schema(self.what)
        self._is_open = True
        try:
            models = self.models()
            choices = {verb: handler.generate_schema(model) for verb, model in models.items()}
        finally:
            self._is_open = False
        one = core_schema.tagged_union_schema(choices, lambda value: next(key for key in value if key in models))
        return core_schema.no_info_before_validator_function(partial(self._check, tuple(models)), one, ref=self.what)

    def _check(self, verbs: tuple[str, ...], value: object) -> object:
        if not isinstance(value, dict):
            raise wrong(f"{short(value)} is not a table")
        given = [key for key in value if key in verbs]
        if len(given) != 1:
            meant = {key: self.meant.get(key) or " or ".join(nearest(key, verbs)) for key in value}
            strange = [f"{shortened(key)!r} is unknown: did you mean {near}?" for key, near in meant.items() if near]
            if strange and not given:
                raise wrong(strange[0])
            told = " and ".join(given) or "none"
            raise wrong(f"a {self.what} has exactly one of {', '.join(verbs)}, not {told}")
        return value


@dataclass(frozen=True, slots=True)
class ReadBy:
    """Annotates a value that a function reads when the file has it.

    Attributes:
        read: makes it of the value in the file; raises InputError, or adds to the reading's findings, what is wrong.
        schema: returns its JSON schema.
    """

    read: "Callable[[Any, FileReading], object]"
    schema: Callable[[], dict[str, Any]]

    def __get_pydantic_core_schema__(self, _: object, handler: GetCoreSchemaHandler) -> CoreSchema:
        del handler

        def read(value: object, info: Any) -> object:
            try:
                return self.read(value, info.context)
            except InputError as error:
                if len(error.messages) > 1:
                    raise
                raise wrong(error.messages[0]) from error  # which has its place in a list

        return core_schema.with_info_plain_validator_function(read)

    def __get_pydantic_json_schema__(self, _: CoreSchema, handler: GetJsonSchemaHandler) -> dict[str, Any]:
        del handler
        return self.schema()
