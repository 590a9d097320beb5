"""Read tables of files that users write by models, with pydantic: robot files, programs and the like.

A model is a frozen dataclass that derives from `FileTable`. Its fields are the keys of the table, their types say what
the values are, and the `Attributes:` of its docstring describe them in the JSON schema. Checks of one table stand in
its `__post_init__`, which raises InputError with the key in front.

A file is read to its end, whatever is wrong in it. A table with a wrong value becomes a part of the model: reading a
field that it lacks raises UnreadError (`steptwin.host.common.findings`), so that no other check complains about it.
"""

import re
from collections.abc import Collection, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import MISSING, Field, dataclass, fields
from enum import Enum
from functools import cache, partial
from math import inf
from reprlib import repr as short
from types import NoneType, UnionType
from typing import Annotated, Any, ClassVar, Final, TypeVar, Union, get_args, get_origin, get_type_hints

from pydantic import GetCoreSchemaHandler, GetJsonSchemaHandler, Strict, TypeAdapter, ValidationError
from pydantic_core import CoreSchema, core_schema

from steptwin.host.common.bad_input import nearest, shortened, unknown
from steptwin.host.common.errors import InputError
from steptwin.host.common.file_errors import error_place, error_text, wrong
from steptwin.host.common.file_values import OneOf, TableList, Within, check_limits
from steptwin.host.common.findings import Findings, UnreadError, judged
from steptwin.host.common.tables import toml_table

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
            raise InputError(*(error_text(each) for each in error.errors(include_url=False))) from error
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
    read
        What the keys of the whole file have been read as so far, in the order of its model.
    """

    def __init__(self, findings: Findings, file: object = None, known: Any = None) -> None:
        self.findings = findings
        self.file: Mapping[str, Any] = file if isinstance(file, dict) else {}
        self.known = known
        self.table: Mapping[str, Any] = {}
        self.name = ""
        self.read: dict[str, Any] = {}
        self._rows: Findings | None = None

    @property
    def header(self) -> str:
        """The place of the present value as a header of tables; empty within a list of tables."""
        return "" if self._rows else self.findings.place.removesuffix(".")

    def named(self, key: str, name: object, what: str = "") -> Any:
        """Return what stands under a name in a table of the file, which has been read before.

        Raises InputError for a name that is not there, UnreadError if what stands there is wrong.
        """
        table = self.read.get(key, {})
        if key in self.file and key not in self.read:
            raise UnreadError(key)
        if not isinstance(name, str):
            raise InputError(f"{short(name)} is not a text")
        if name not in table:
            raise InputError(str(unknown(what, name, table)).lstrip())
        if table[name] is None:
            raise UnreadError(key)
        return table[name]

    @contextmanager
    def row(self, what: str, number: int) -> Iterator[None]:
        """Put the number of a table in a list in front of the messages from the block, such as `step 2: `."""
        outer = self.findings, self._rows
        place = self.header if self.header.endswith(what) else f"{self.header} {what}"
        rows = self._rows or Findings(self.findings.messages, f"{place} ")
        self.findings, self._rows = rows.under(f"{number}: "), rows.under(f"{number}.")
        try:
            yield
        finally:
            self.findings, self._rows = outer

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

    A field whose key is a word of Python ends in an underscore, such as `from_`. Keys of keyword-only fields come last.

    Attributes:
        may_lack: keys that a file may leave out though their fields have no defaults.
    """

    __slots__ = ()
    may_lack: ClassVar[tuple[str, ...]] = ()

    def __post_init__(self) -> None:
        """Raise InputError unless the values are within their limits, also of a table that no file has."""
        check_limits(self)

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
    def missing(cls, key: str, reading: FileReading) -> str:
        """Return what to say of a missing key of the present table; nothing if it is no error of its own."""
        del key, reading
        return "is missing"

    @classmethod
    def __get_pydantic_core_schema__(cls, _: object, handler: GetCoreSchemaHandler) -> CoreSchema:
        """Return how pydantic reads the table: each key for itself, so that a wrong one leaves the others."""
        hints = get_type_hints(cls, include_extras=True)
        keys = {_key_of(field): field for field in _key_fields(cls)}
        read = {
            key: core_schema.typed_dict_field(
                _of_key(key, hints[field.name], handler), required=_is_required(cls, field)
            )
            for key, field in keys.items()
        }
        config = core_schema.CoreConfig(strict=True, allow_inf_nan=False)
        table = core_schema.typed_dict_schema(read, extra_behavior="forbid", config=config)
        return core_schema.with_info_wrap_validator_function(partial(_read_table, cls, keys), table)

    @classmethod
    def __get_pydantic_json_schema__(cls, schema: CoreSchema, handler: GetJsonSchemaHandler) -> dict[str, Any]:
        """Return the table's JSON schema, with the descriptions of the docstring, units and defaults."""
        summary, described = documented(cls)
        made = handler(schema)
        for field in _key_fields(cls):
            if each := made["properties"].get(_key_of(field)):
                each.pop("title", None)
                meaning = field.metadata.get("meaning") or described.get(field.name, "")
                if told := ". ".join(filter(None, (meaning.rstrip("."), _unit_text(field.name)))):
                    each["description"] = told
                if field.default != "" and isinstance(field.default, str | int | float) and field.default != inf:
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


def _key_fields(model: Any) -> list[Field[Any]]:
    return sorted((field for field in fields(model) if field.init), key=lambda field: field.kw_only is True)


def _key_of(field: Field[Any]) -> str:
    return field.name.removesuffix("_")


def _is_required(model: type[FileTable], field: Field[Any]) -> bool:
    return field.default is MISSING and field.default_factory is MISSING and field.name not in model.may_lack


@dataclass(frozen=True, slots=True)
class _Unread:
    """Stands for a value that could not be read; for one that is missing, it says so."""

    message: str = ""


_UNREAD: Final = _Unread()


def _of_key(key: str, hint: Any, handler: GetCoreSchemaHandler) -> CoreSchema:
    """Return how the value of a key is read, so that an error in it goes to the findings."""
    return core_schema.with_info_wrap_validator_function(partial(_read_key, key), _of(hint, handler))


def _of(hint: Any, handler: GetCoreSchemaHandler) -> CoreSchema:
    """Return how a value is read: names and lists of tables as `_read_named` and `_read_rows`."""
    hint = _given(hint)
    kind, *annotations = get_args(hint) if get_origin(hint) is Annotated else (hint,)
    rows = next((each for each in annotations if isinstance(each, TableList)), None)
    if get_origin(kind) is tuple and (rows or (get_args(kind)[1:] == (...,) and _is_table(get_args(kind)[0]))):
        listed = core_schema.list_schema(handler.generate_schema(get_args(kind)[0]))
        return core_schema.with_info_wrap_validator_function(partial(_read_rows, rows or TableList()), listed)
    if get_origin(hint) in (Mapping, dict):
        names, each = get_args(hint)
        named = core_schema.dict_schema(handler.generate_schema(names), _of(each, handler))
        return core_schema.with_info_wrap_validator_function(partial(_read_named, NoneType in get_args(each)), named)
    if isinstance(hint, type) and issubclass(hint, Enum):
        choices = core_schema.literal_schema([each.value for each in hint])
        return core_schema.no_info_after_validator_function(hint, choices)
    return handler.generate_schema(_bounded(hint))


def _given(hint: Any) -> Any:
    """Return the type of a value that is there: TOML has no null, a key is left out."""
    if get_origin(hint) not in (Union, UnionType):
        return hint
    return Union[tuple(each for each in get_args(hint) if each is not NoneType)]  # noqa: UP007


def _is_table(hint: Any) -> bool:
    kinds = (hint, *get_args(hint))
    return any(isinstance(each, OneOf) or (isinstance(each, type) and issubclass(each, FileTable)) for each in kinds)


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


def _read_key(key: str, value: object, handler: Any, info: Any) -> object:
    """Return the value of a key; a wrong one adds its error to the findings."""
    reading: FileReading = info.context
    if isinstance(value, _Unread):
        reading.findings.add(*([f"{key}: {value.message}"] if value.message else []))
        return _UNREAD
    with reading.findings.collecting(f"{key}: "):
        try:
            with reading.under(f"{key}."):
                made = handler(value)
        except ValidationError as error:
            errors = error.errors(include_url=False)
            reading.findings.add(*(f"{key}{error_place(each)}: {error_text(each)}" for each in errors))
        else:
            if reading.table is reading.file:
                reading.read[key] = made
            return made
    return _UNREAD


def _read_rows(rows: TableList, value: Any, handler: Any, info: Any) -> object:
    """Return the tables of a list. Wrong ones are parts of their models."""
    reading: FileReading = info.context
    rows.check(value, reading.header)
    made: list[object] = []
    for number, table in enumerate(value, start=1):
        row = None
        with reading.row(rows.what, number), reading.findings.collecting():
            try:
                (row,) = handler([table])
            except ValidationError as error:
                reading.findings.add(*(error_text(each) for each in error.errors(include_url=False)))
        made.append(rows.read(row))
    return tuple(row for row in made if row is not None)


def _read_named(keeps_names: bool, value: object, handler: Any, info: Any) -> object:
    """Return what stands under each name, without what is wrong; if nothing is right, it could not be read.

    With `keeps_names` None stands in place of what is wrong.
    """
    if not isinstance(value, dict):
        raise wrong(f"{short(value)} is not a table")
    reading: FileReading = info.context
    named: dict[str, object] = dict.fromkeys(value) if keeps_names else {}
    for name, each in value.items():
        with reading.findings.collecting(f"{shortened(name)}: "):
            try:
                with reading.under(f"{shortened(name)}.", name):
                    read = handler({name: each})
                named |= {name: made for name, made in read.items() if made is not _UNREAD}
            except ValidationError as error:
                for found in error.errors(include_url=False):
                    _, *within = found["loc"]
                    if within == ["[key]"]:
                        place = reading.findings.place.removesuffix(".")
                        Findings(reading.findings.messages, f"{place}: ").add(error_text(found))
                    else:
                        reading.findings.add(f"{shortened(name)}{error_place({'loc': within})}: {error_text(found)}")
    return named if named or not value else _UNREAD


def _read_table(
    model: type[FileTable], keys: Mapping[str, Field[Any]], value: object, handler: Any, info: Any
) -> object:
    """Return what the model makes of a table, or of a part of it if something is wrong.

    Unknown keys are told first. The key that one of them should
    probably be is not called missing.
    """
    if isinstance(value, model):
        return value
    if not isinstance(value, dict):
        raise wrong(f"{short(value)} is not a table")
    reading: FileReading = info.context
    outer, reading.table = reading.table, value
    try:
        strange = [key for key in value if key not in keys]
        reading.findings.add(*(model.strange(key, value[key], keys) for key in strange))
        meant = {name for key in strange for name in nearest(key, keys)}
        required = [key for key, field in keys.items() if key in meant or _is_required(model, field)]
        missing = {key: "" if key in meant else model.missing(key, reading) for key in required if key not in value}
        given = {key: value[key] for key in keys if key in value}
        values = handler(given | {key: _Unread(message) for key, message in missing.items()})
        read = {field.name: values.get(key) for key, field in keys.items()}
        return model.made_of({name: each for name, each in read.items() if not isinstance(each, _Unread)}, reading)
    finally:
        reading.table = outer


def read_table(model: Any, value: object, reading: FileReading) -> Any:
    """Return what a model, or a mapping of names to models, makes of the present value, in a reading that goes on."""
    try:
        return _adapter(model).validate_python(value, context=reading)
    except ValidationError as error:
        raise InputError(*(error_text(each) for each in error.errors(include_url=False))) from error


def table_schema(model: type[Any]) -> dict[str, Any]:
    """Return the JSON schema of a model as a part of another one."""
    hint: Any = model
    return _adapter(hint).json_schema()
