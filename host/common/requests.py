"""What requests of the control port may ask for: their keys in JSON, the same as words of a command, and what they do.

`steptwin inject` reads its words by this table, scenarios and the control port their keys; help and docs show it. What
makes a harm of a request, and the limits of its values, are in `host/twin/control/`.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from enum import StrEnum
from reprlib import repr as short
from typing import Final

from steptwin.host.common import numbers
from steptwin.host.common.bad_input import prefixed, unknown
from steptwin.host.common.control import SWITCHES, Do, Stuck, SwitchWiring, Wiring
from steptwin.host.common.errors import InputError
from steptwin.host.common.levels import LEVELS
from steptwin.host.common.tables import Reading, Table

# --- the kinds of values


@dataclass(frozen=True, slots=True)
class Value:
    """A kind of value.

    Attributes:
        metavar: stands for it in help.
        says: what it is in JSON, in words.
        of_word: returns the value that a word means, None if it means that the key is missing; raises InputError.
        read: reads it from a table.
    """

    metavar: str
    says: str
    of_word: Callable[[str], object]
    read: Reading


def _level(word: str) -> bool:
    if word not in LEVELS:
        raise InputError(f"{word!r} is neither on nor off")
    return LEVELS[word]


def _whole(word: str, base: int = 10) -> int:
    try:
        return numbers.whole(word, base)
    except ValueError:
        raise InputError(f"{short(word)} is not a whole number") from None


def _identifier(word: str) -> int:
    return _whole(word, 0)


def _frames(word: str) -> str | list[int]:
    """Return a name, or the identifiers of a list such as 0x510,0x77F."""
    return [_identifier(each) for each in word.split(",")] if word[:1].isdigit() else word


def _joint_or_host(word: str) -> str | None:
    return None if word == _HOST else word


def _number(metavar: str) -> Value:
    return Value(metavar, "number", numbers.finite_number, Table.number)


def _whole_number(metavar: str) -> Value:
    return Value(metavar, "whole number", _whole, Table.integer)


def _one_of(*names: str) -> Value:
    """Return the kind of value that is one of these words; the board knows them, and so does the table of its kind."""
    return Value("|".join(names), " or ".join(f"`{name}`" for name in names), str, Table.text)


def _member_of(kind: type[StrEnum]) -> Value:
    names = " or ".join(f"`{name}`" for name in kind)
    return Value("|".join(kind), names, str, lambda table, key: table.choice(key, kind))


_HOST: Final = "host"
_ON: Final = Value("on|off", "true or false", _level, Table.truth)
_JOINT: Final = Value("JOINT", "name of a joint", str, Table.text)
_STATION: Final = Value(f"JOINT|{_HOST}", "name of a joint", _joint_or_host, Table.text)
_INPUT: Final = Value("NAME", "name of an input", str, Table.text)
_SWITCH: Final = _one_of(*SWITCHES)
_SEED: Final = _whole_number("SEED")
_COUNT: Final = _whole_number("N")
_MS: Final = _whole_number("MS")
_US: Final = _whole_number("US")
_SECONDS: Final = _number("SECONDS")
_ID: Final = Value("ID", "identifier", _identifier, Table.integer)
_DATA: Final = Value("HEX", "up to 8 bytes in hexadecimal digits", str, Table.text)
_FRAMES: Final = Value("FRAMES", "name of frames, or list of identifiers", _frames, Table.text)
_OFTEN: Final = {"joint": _JOINT, "rate": _number("PART"), "skip": _COUNT, "count": _COUNT}
"""How often, and with whose frames, a fault of the bus strikes."""

# --- the requests


@dataclass(frozen=True, slots=True)
class Form:
    """What a kind of request looks like.

    Attributes:
        does: what it does, in words; Markdown.
        required: the keys that it has beside `do`.
        optional: the keys that it may have.
    """

    does: str
    required: Mapping[str, Value]
    optional: Mapping[str, Value]

    @property
    def keys(self) -> dict[str, Value]:
        """All keys beside `do`, in the order of a command's words."""
        return {**self.required, **self.optional}

    @property
    def usage(self) -> str:
        """What stands behind the name in a command: the words that are needed, then those that are not, in brackets."""
        needed = [value.metavar for value in self.required.values()]
        return " ".join([*needed, *(f"[{key}={value.metavar}]" for key, value in self.optional.items())])


def _form(does: str, optional: Mapping[str, Value] | None = None, /, **required: Value) -> Form:
    return Form(does, required, optional or {})


FORMS: Final[Mapping[Do, Form]] = {
    Do.ESTOP: _form("the emergency stop is pressed, or pulled out", pressed=_ON),
    Do.SUPPLY: _form("the motor supply has this voltage", supply_v=_number("VOLTS")),
    Do.TEMPERATURE: _form("the board has this temperature", temperature_degc=_number("DEGC")),
    Do.PROTECT: _form(
        "the Protect pin of a driver is held low, as by a chip that is too hot, or released", joint=_JOINT, held=_ON
    ),
    Do.INPUT: _form("a sensor of the robot's file is active, or not", input=_INPUT, on=_ON),
    Do.SWITCH: _form(
        "a switch `-`, `+` or `home` sticks `closed` or `open`, or is `free`",
        joint=_JOINT,
        switch=_SWITCH,
        stuck=_member_of(Stuck),
    ),
    Do.SWITCH_WIRE: _form(
        "a switch's wire is `whole`, or broken at a contact that is `normally-open` or `normally-closed`",
        joint=_JOINT,
        switch=_SWITCH,
        broken=_member_of(SwitchWiring),
    ),
    Do.BOUNCE: _form(
        "a switch is worn: it bounces so often with each change, within 5 ms; 0: no more",
        {"within_us": _US, "seed": _SEED},
        joint=_JOINT,
        switch=_SWITCH,
        bounces=_whole_number("BOUNCES"),
    ),
    Do.MODE: _form(
        "a driver is set to another microstep mode, or as it was",
        {"microsteps": Value("1|2|8|16", "1, 2, 8 or 16", _whole, Table.integer)},
        joint=_JOINT,
    ),
    Do.OSC: _form("the capacitor at a driver chip's OSC pin has another value", joint=_JOINT, osc_pf=_number("PF")),
    Do.SLIP: _form(
        "a motor falls out of step by whole electrical cycles: a multiple of 4 full steps",
        joint=_JOINT,
        full_steps=_whole_number("FULL_STEPS"),
    ),
    Do.PAYLOAD: _form(
        "the payload has another mass; only with motors that turn with the board (`run --motors=loop`,"
        " `serve --motors`)",
        payload_kg=_number("KG"),
    ),
    Do.WIRE: _form(
        "the wire `step`, `dir` or `enable` to a driver is `broken`, shorted `low` or `high`, `noisy` or `whole`;"
        " a noisy one has `rate_hz` and `width_us`",
        {"rate_hz": _number("HZ"), "width_us": _number("US"), "count": _COUNT, "seed": _SEED},
        joint=_JOINT,
        wire=_one_of("step", "dir", "enable"),
        condition=_member_of(Wiring),
    ),
    Do.BROWN_OUT: _form(
        "the logic of a board, or of all boards, is without supply for a time, or until `power-up`",
        {"for_ms": _MS, "joint": _JOINT},
    ),
    Do.WATCHDOG: _form(
        "the watchdog resets a board's processor, or that of all boards, while the drivers keep their supply",
        {"for_ms": _MS, "joint": _JOINT},
    ),
    Do.POWER_UP: _form("a board that is down starts again", {"joint": _JOINT}),
    Do.STRANGER: _form("a foreign station, such as a second master, sends a frame", id=_ID, data=_DATA),
    Do.BABBLE: _form(
        "the same station sends a frame again and again",
        id=_ID,
        data=_DATA,
        period_us=_whole_number("PERIOD_US"),
        count=_whole_number("COUNT"),
    ),
    Do.LOSS: _form("frames are acknowledged and do not arrive", {**_OFTEN, "receiver": _COUNT}, frames=_FRAMES),
    Do.CORRUPTION: _form("frames are disturbed: CAN sends them again", _OFTEN, frames=_FRAMES),
    Do.DUPLICATE: _form("frames come twice, as after an error in their last bit", _OFTEN, frames=_FRAMES),
    Do.DELAY: _form("the sender of a frame waits before it sends it", _OFTEN, frames=_FRAMES, by_s=_SECONDS),
    Do.BUS_OFF: _form("the board of a joint, or without `joint` the host, goes into bus-off", {"joint": _STATION}),
    Do.BUS_OK: _form("all faults of the bus end"),
    Do.HOST: _form(
        "something goes wrong with the host: only in scenarios",
        {"by_s": _SECONDS},
        how=_one_of("hang", "death", "restart", "late", "disorder"),
    ),
    Do.STATE: _form("nothing: it asks how the machine is"),
}
"""Every kind of request, in the order of help and docs."""

INJECTED: Final = tuple(do for do in FORMS if do is not Do.HOST)
"""What may be asked of a served board, whose hosts are programs of their own."""


def request_of_words(words: Sequence[str]) -> tuple[Do, dict[str, object]]:
    """Return the kind of request that the words of a command ask for, and its keys beside `do`.

    A word such as `rate=0.1` is the value of this key; the other words are those of the remaining keys, in order.

    Raises:
        InputError: there is no such request, values are missing, too many, unknown, or not of their kind.
    """
    names = [str(do) for do in INJECTED]
    if not words:
        raise InputError(f"WHAT is missing: {', '.join(names)}")
    name, *rest = words
    if name not in names:
        raise unknown("WHAT", name, names)
    do = Do(name)
    given = _by_key(do, rest)
    form = FORMS[do]
    if not {*form.required} <= {*given}:
        raise _other_usage(do, rest)
    values = {}
    for key, word in given.items():
        with prefixed(f"{key}: "):
            values[key] = form.keys[key].of_word(word)
    return do, {key: value for key, value in values.items() if value is not None}


def _by_key(do: Do, words: Sequence[str]) -> dict[str, str]:
    """Return the words by the keys whose values they are."""
    keys = FORMS[do].keys
    named: dict[str, str] = {}
    for word in words:
        key, equals, value = word.partition("=")
        if equals and key not in keys:
            raise unknown(f"key of {do}", key, keys)
        if equals and key in named:
            raise InputError(f"{key}: is given twice")
        if equals:
            named[key] = value
    alone = [word for word in words if "=" not in word]
    free = [key for key in keys if key not in named]
    if len(alone) > len(free):
        raise _other_usage(do, words)
    return dict(zip(free, alone, strict=False)) | named


def _other_usage(do: Do, words: Sequence[str]) -> InputError:
    return InputError(f"after {do}: {FORMS[do].usage or 'nothing'}, not {' '.join(words) or 'nothing'}")
