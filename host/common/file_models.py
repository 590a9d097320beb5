"""Read tables of files that users write by models, with pydantic: robot files, programs and the like.

A model is a frozen dataclass that derives from `FileTable`. Its fields are the keys of the table, their types say what
the values are, and the `Attributes:` of its docstring describe them in the JSON schema. Checks of one table stand in
its `__post_init__`, which raises InputError with the key in front.

A file is read to its end, whatever is wrong in it. A table with a wrong value becomes a part of the model: reading a
field that it lacks raises UnreadError (`steptwin.host.common.findings`), so that no other check complains about it.
"""

import re
from collections.abc import Callable, Collection, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import MISSING, dataclass, fields
from enum import Enum
from functools import cache, lru_cache, partial
from math import isnan
from reprlib import repr as short
from types import NoneType, UnionType
from typing import Annotated, Any, ClassVar, Final, TypeVar, Union, get_args, get_origin, get_type_hints

from pydantic import GetCoreSchemaHandler, GetJsonSchemaHandler, Strict, TypeAdapter, ValidationError
from pydantic_core import CoreSchema, PydanticCustomError, core_schema

from steptwin.host.common.bad_input import nearest, nearest_within, outside, shortened, unknown
from steptwin.host.common.errors import InputError
from steptwin.host.common.findings import Findings, UnreadError, check_all, judged
from steptwin.host.common.numbers import LARGEST
from steptwin.host.common.tables import check_name, toml_table

Made = TypeVar("Made")

SCHEMA_DIALECT: Final = "https://json-schema.org/draft/2020-12/schema"


def read_model(model: type[Made], values: object, findings: Findings, known: object = None) -> Made:
    """Return the model of a table's values; what is wrong goes to the findings.

    Parameters
    ----------
    model
        The `FileTable`.
    values
        The table, as tomllib or json return it.
    findings
        If they get messages, the model is only a part: what could be read.
    known
        What `FileTable.made_of` may ask for in `FileReading.known`.

    Raises
    ------
    UnreadError
        The values are no table. The findings say so.
    """
    with findings.collecting():
        try:
            hint: Any = model
            made: Made = _adapter(hint).validate_python(values, context=FileReading(findings, values, known))
        except ValidationError as error:
            raise InputError(*(_text(each) for each in error.errors(include_url=False))) from error
        return made
    raise UnreadError(model.__name__)


def read_toml(model: type[Made], text: str, known: object = None) -> Made:
    """Return the model of a TOML text; the InputError's messages are all that is wrong, each with its key."""
    findings = Findings()
    values = toml_table(text).values
    try:
        return read_model(model, values, findings, known)
    finally:
        findings.raise_first()


def json_schema(model: type[Any]) -> dict[str, Any]:
    """Return the JSON schema of a model's table."""
    return {"$schema": SCHEMA_DIALECT, **table_schema(model)}


@dataclass(frozen=True, slots=True)
class _As:
    """Annotates what is read by a type, in the way of the keys of tables."""

    hint: Any

    def __get_pydantic_core_schema__(self, _: object, handler: GetCoreSchemaHandler) -> CoreSchema:
        return _of(self.hint, handler)


@cache
def _adapter(hint: Any) -> TypeAdapter[Any]:
    return TypeAdapter(Annotated[Any, _As(hint)])


class FileReading:
    """One reading of a file, which pydantic hands to all validators.

    Attributes
    ----------
    findings
        Where the errors of the present table go: it puts the table's place in front.
    file
        The whole file, unchecked.
    known
        What the tables must know that is not theirs, such as the joints of the mechanism.
    table
        The present table, unchecked.
    name
        The name of the present table, where tables stand under names that the file gives.
    """

    def __init__(self, findings: Findings, file: object = None, known: Any = None) -> None:
        self.findings = findings
        self.file: Mapping[str, Any] = file if isinstance(file, dict) else {}
        self.known = known
        self.table: Mapping[str, Any] = {}
        self.name = ""

    @contextmanager
    def under(self, place: str, name: str = "") -> Iterator[None]:
        """Put a place in front of the messages from the block; its tables stand under a name."""
        outer = self.findings, self.name
        self.findings, self.name = self.findings.under(place), name
        try:
            yield
        finally:
            self.findings, self.name = outer


class FileTable:
    """Base of the models: frozen dataclasses whose fields are the keys of a table. Other keys are refused.

    Attributes:
        may_lack: keys that a file may leave out though their fields have no defaults.
    """

    __slots__ = ()
    may_lack: ClassVar[tuple[str, ...]] = ()

    @classmethod
    def made_of(cls, values: dict[str, Any], reading: FileReading) -> Any:
        """Return the model with these values of its fields, a part of it, or what else the table means.

        Values that could not be read are not there; None stands for a key that is missing and may be.
        """
        return judged(cls, values, reading.findings)

    @classmethod
    def strange(cls, key: str, value: object, keys: Collection[str]) -> str:
        """Return what to say of a key that the table does not have."""
        del value
        return f"{shortened(key)}: {unknown('key', key, keys)}"

    @classmethod
    def tells_missing(cls, reading: FileReading) -> bool:
        """Return whether a missing key of the present table is an error of its own."""
        del reading
        return True

    @classmethod
    def __get_pydantic_core_schema__(cls, _: object, handler: GetCoreSchemaHandler) -> CoreSchema:
        """Return how pydantic reads the table: each key for itself, so that a wrong one leaves the others."""
        hints = get_type_hints(cls, include_extras=True)
        keys = {
            field.name: core_schema.typed_dict_field(
                _of_key(field.name, hints[field.name], handler),
                required=field.default is MISSING
                and field.default_factory is MISSING
                and field.name not in cls.may_lack,
            )
            for field in fields(cls)  # type: ignore[arg-type]
            if field.init
        }
        config = core_schema.CoreConfig(strict=True, allow_inf_nan=False)
        table = core_schema.typed_dict_schema(keys, extra_behavior="forbid", config=config)
        return core_schema.with_info_wrap_validator_function(partial(_read_table, cls, tuple(keys)), table)

    @classmethod
    def __get_pydantic_json_schema__(cls, schema: CoreSchema, handler: GetJsonSchemaHandler) -> dict[str, Any]:
        """Return the table's JSON schema, with the descriptions of the docstring, units and defaults."""
        summary, described = documented(cls)
        made = handler(schema)
        for field in fields(cls):  # type: ignore[arg-type]
            if field.name in made["properties"]:
                each = made["properties"][field.name]
                each.pop("title", None)
                meaning = field.metadata.get("meaning") or described.get(field.name, "")
                if told := ". ".join(filter(None, (meaning.rstrip("."), _unit_text(field.name)))):
                    each["description"] = told
                if isinstance(field.default, int | float | str) and field.default != "":
                    each["default"] = field.default
        return {**made, "description": summary}


_ENTRY: Final = re.compile(r"^ {4,8}(\w+): (.*(?:\n {9,}.*)*)", re.MULTILINE)
"""An entry of `Attributes:`, which may go on in lines that are indented further."""


def documented(model: type[Any]) -> tuple[str, dict[str, str]]:
    """Return the summary of a model's docstring, and what it and those of its bases say of each attribute."""
    found: dict[str, str] = {}
    for each in reversed(model.__mro__):
        _, _, attributes = (each.__doc__ or "").partition("Attributes:\n")
        entries = attributes.partition("\n\n")[0]
        found |= {name: " ".join(text.split()) for name, text in _ENTRY.findall(entries)}
    return (model.__doc__ or "").split("\n")[0], found


_UNITS: Final = {
    "_mm_s": "mm/s",
    "_deg_s": "deg/s",
    "_mm": "mm",
    "_deg": "degrees",
    "_percent": "%",
    "_gcm2": "g cm2",
    "_kgm2": "kg m2",
    "_nm_rad": "Nm/rad",
    "_nm_s": "Nm s",
    "_nm": "Nm",
    "_ohm": "ohm",
    "_mh": "mH",
    "_uf": "uF",
    "_pf": "pF",
    "_ns": "ns",
    "_us": "us",
    "_ms": "ms",
    "_hz": "Hz",
    "_kg": "kg",
    "_ppm": "ppm",
    "_ma": "mA",
    "_a": "A",
    "_v": "V",
    "_s": "s",
}
"""Units by the ends of keys; a longer end comes before those that it ends in."""


def _unit_text(key: str) -> str:
    """Return a key's unit in words; nothing without one."""
    return next((f"Unit: {unit}" for end, unit in _UNITS.items() if key.endswith(end)), "")


class _Unread(Enum):
    UNREAD = 0
    MISSING = 1


_UNREAD: Final = _Unread.UNREAD
"""Stands for a value that could not be read."""
_MISSING: Final = _Unread.MISSING
"""Stands for the value of a key that is missing and must be there."""


def _of_key(key: str, hint: Any, handler: GetCoreSchemaHandler) -> CoreSchema:
    """Return how the value of a key is read, so that an error in it goes to the findings."""
    if get_origin(hint) in (Union, UnionType):  # TOML has no null: a key is left out
        others = [each for each in get_args(hint) if each is not NoneType]
        hint = Union[tuple(others)]  # noqa: UP007
    args = get_args(hint)
    if get_origin(hint) is tuple and args[1:] == (...,) and _is_table(args[0]):
        rows = core_schema.list_schema(handler.generate_schema(args[0]))
        return core_schema.with_info_wrap_validator_function(partial(_read_rows, key), rows)
    return core_schema.with_info_wrap_validator_function(partial(_read_key, key), _of(hint, handler))


def _is_table(hint: Any) -> bool:
    kinds = (hint, *get_args(hint))
    return any(isinstance(each, OneOf) or (isinstance(each, type) and issubclass(each, FileTable)) for each in kinds)


def _of(hint: Any, handler: GetCoreSchemaHandler) -> CoreSchema:
    if get_origin(hint) in (Mapping, dict):
        names, each = get_args(hint)
        named = core_schema.dict_schema(handler.generate_schema(names), _of(each, handler))
        return core_schema.with_info_wrap_validator_function(_read_named, named)
    if isinstance(hint, type) and issubclass(hint, Enum):
        choices = core_schema.literal_schema([each.value for each in hint])
        return core_schema.no_info_after_validator_function(hint, choices)
    return handler.generate_schema(_bounded(hint))


def _bounded(hint: Any) -> Any:
    """Return a type whose numbers are at most LARGEST in size, and whose tuples are lists of a file."""
    if hint is float or hint is int:
        return Annotated[hint, Within()]
    if get_origin(hint) is tuple:
        return Annotated[tuple.__class_getitem__(tuple(map(_bounded, get_args(hint)))), Strict(False)]
    if get_origin(hint) is Annotated:
        kind, *validators = get_args(hint)
        if any(isinstance(each, Within) for each in validators):
            return hint
        return Annotated.__class_getitem__((_bounded(kind), *validators))
    return hint


def _told(key: str, value: _Unread, reading: FileReading) -> _Unread:
    """Say that a key is missing if it must be there."""
    if value is _MISSING:
        reading.findings.add(f"{key}: is missing")
    return _UNREAD


def _read_key(key: str, value: object, handler: Any, info: Any) -> object:
    """Return the value of a key; a wrong one adds its error to the findings."""
    reading: FileReading = info.context
    if isinstance(value, _Unread):
        return _told(key, value, reading)
    with reading.findings.collecting(f"{key}: "):
        try:
            with reading.under(f"{key}."):
                return handler(value)
        except ValidationError as error:
            reading.findings.add(*(f"{key}{_place(each)}: {_text(each)}" for each in error.errors(include_url=False)))
    return _UNREAD


def _read_rows(key: str, value: object, handler: Any, info: Any) -> object:
    """Return the tables of a list; their places are such as `step 2`. Wrong ones are parts of their models."""
    reading: FileReading = info.context
    if isinstance(value, _Unread):
        return _told(key, value, reading)
    if isinstance(value, dict):
        reading.findings.add(f"{key}: is a table, not a list: begin each with [[{key}]], in two pairs of brackets")
        return _UNREAD
    if not isinstance(value, list):
        reading.findings.add(f"{key}: {short(value)} is not a list")
        return _UNREAD
    rows = []
    for number, each in enumerate(value, start=1):
        with reading.under(f"{key} {number}: "), reading.findings.collecting():
            try:
                rows += handler([each])
            except ValidationError as error:
                reading.findings.add(*(_text(each) for each in error.errors(include_url=False)))
    return tuple(rows)


def _read_named(value: object, handler: Any, info: Any) -> object:
    """Return what stands under each name, without what is wrong; if nothing is right, it could not be read."""
    if not isinstance(value, dict):
        raise wrong(f"{short(value)} is not a table")
    reading: FileReading = info.context
    named: dict[str, object] = {}
    for name, each in value.items():
        with reading.findings.collecting(f"{shortened(name)}: "):
            try:
                with reading.under(f"{shortened(name)}.", name):
                    read = handler({name: each})
                named |= {name: made for name, made in read.items() if made is not _UNREAD}
            except ValidationError as error:
                for found in error.errors(include_url=False):
                    _, *within = found["loc"]
                    place = "" if within == ["[key]"] else f"{shortened(name)}{_place({'loc': within})}: "
                    reading.findings.add(f"{place}{_text(found)}")
    return named if named or not value else _UNREAD


def _read_table(model: type[FileTable], keys: tuple[str, ...], value: object, handler: Any, info: Any) -> object:
    """Return what the model makes of a table, or of a part of it if something is wrong."""
    if isinstance(value, model):
        return value
    if not isinstance(value, dict):
        raise wrong(f"{short(value)} is not a table")
    reading: FileReading = info.context
    outer, reading.table = reading.table, value
    try:
        values = _keys_read(model, keys, value, handler, reading)
        return model.made_of({key: values.get(key) for key in keys if values.get(key) is not _UNREAD}, reading)
    finally:
        reading.table = outer


def _keys_read(
    model: type[FileTable], keys: tuple[str, ...], value: dict[str, Any], handler: Any, reading: FileReading
) -> dict[str, Any]:
    found = len(reading.findings.messages)
    try:
        values: dict[str, Any] = handler(value)
    except ValidationError as error:  # of keys that are missing or unknown: wrong values do not come here
        del reading.findings.messages[found:]  # they are found once more
        strange = [key for key in value if key not in keys]
        reading.findings.add(*(model.strange(key, value[key], keys) for key in strange))
        meant = {name for key in strange for name in nearest(key, keys)} - value.keys()
        missing = [str(each["loc"][0]) for each in error.errors() if each["type"] == "missing"]
        known = {key: value[key] for key in keys if key in value}
        told = _MISSING if model.tells_missing(reading) else _UNREAD
        values = handler({**known, **dict.fromkeys(missing, told), **dict.fromkeys(meant, _UNREAD)})
    return values


# --- what is wrong, in words


def wrong(message: str) -> PydanticCustomError:
    """Return the error by which a validator refuses a value; the value's key is put in front."""
    return PydanticCustomError("wrong", "{message}", {"message": message})


_WORDS: Final = {
    "missing": "is missing",
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


def _place(error: Any) -> str:
    return "".join(f"[{at}]" for at in error["loc"])


def _text(error: Any) -> str:
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


# --- types of values


class ValueLimit:
    """Base of what annotates the type of a value that must keep a limit."""

    __slots__ = ()

    def complaint(self, value: Any) -> str:
        """Return what is wrong with a value, with limit and nearest right one; nothing if it keeps it."""
        raise NotImplementedError

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
            most = "" if self.most == LARGEST else f" and up to {self.most:g}"
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
        for each in (hint, *get_args(hint)):  # of `Positive | None` as well
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


class OneOf:
    """Annotates a table of which one key, the verb, says what the others are.

    `Annotated[Any, OneOf(lambda: {"go": Go, "line": Line})]` is read by the model of the one verb that it has.
    """

    def __init__(self, models: Any, what: str) -> None:
        self.models = models
        self.what = what
        """What has one of the verbs, such as `a step`."""

    def __get_pydantic_core_schema__(self, _: object, handler: GetCoreSchemaHandler) -> CoreSchema:
        models = self.models()

        def verbs_in(value: Any) -> list[str]:
            return [key for key in value if key in models]

        def check(value: object) -> object:
            if not isinstance(value, dict):
                raise wrong(f"{short(value)} is not a table")
            verbs = verbs_in(value)
            if len(verbs) != 1:
                strange = [(key, near) for key in value if (near := nearest(key, models))]
                if strange and not verbs:
                    key, near = strange[0]
                    raise wrong(f"{shortened(key)!r} is unknown: did you mean {' or '.join(near)}?")
                raise wrong(f"{self.what} has exactly one of {', '.join(models)}, not {' and '.join(verbs) or 'none'}")
            return value

        choices = {verb: handler.generate_schema(model) for verb, model in models.items()}
        one = core_schema.tagged_union_schema(choices, lambda value: verbs_in(value)[0])
        return core_schema.no_info_before_validator_function(check, one)


@dataclass(frozen=True, slots=True)
class ReadBy:
    """Annotates a value that a function reads when the file has it.

    Attributes:
        read: makes it of the value in the file; raises InputError, or adds to the reading's findings, what is wrong.
        schema: returns its JSON schema.
    """

    read: Callable[[Any, FileReading], object]
    schema: Callable[[], dict[str, Any]]

    def __get_pydantic_core_schema__(self, _: object, handler: GetCoreSchemaHandler) -> CoreSchema:
        del handler
        return core_schema.with_info_plain_validator_function(lambda value, info: self.read(value, info.context))

    def __get_pydantic_json_schema__(self, _: CoreSchema, handler: GetJsonSchemaHandler) -> dict[str, Any]:
        del handler
        return self.schema()


def read_table(model: Any, value: object, reading: FileReading) -> Any:
    """Return what a model, or a mapping of names to models, makes of the present value, in a reading that goes on."""
    try:
        return _adapter(model).validate_python(value, context=reading)
    except ValidationError as error:
        raise InputError(*(_text(each) for each in error.errors(include_url=False))) from error


def table_schema(model: type[Any]) -> dict[str, Any]:
    """Return the JSON schema of a model as a part of another one."""
    hint: Any = model
    return _adapter(hint).json_schema()
