"""What requests of the control port may ask for: their keys in JSON, the same as words of a command, and what they do.

`steptwin inject` reads its words by this table, scenarios and the control port their keys; help and docs show it. What
makes a harm of a request, and the limits of its values, are in `host/twin/control/`.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from enum import StrEnum
from functools import partial
from reprlib import repr as short
from typing import Final

from steptwin.host.common import numbers
from steptwin.host.common.bad_input import prefixed, unknown
from steptwin.host.common.choices import LEVELS
from steptwin.host.common.control import SWITCHES, Do, Stuck, SwitchWiring, Wiring
from steptwin.host.common.errors import InputError
from steptwin.host.common.tables import Reading, Table

# --- the kinds of values


@dataclass(frozen=True, slots=True)
class ValueKind:
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


def _number(metavar: str) -> ValueKind:
    return ValueKind(metavar, "number", numbers.finite_number, Table.number)


def _whole_number(metavar: str) -> ValueKind:
    return ValueKind(metavar, "whole number", _whole, Table.integer)


def _one_of(*names: str) -> ValueKind:
    """Return the kind of value that is one of these words; the board knows them, and so does the table of its kind."""
    return ValueKind("|".join(names), " or ".join(f"`{name}`" for name in names), str, Table.text)


def _member_of(kind: type[StrEnum]) -> ValueKind:
    names = " or ".join(f"`{name}`" for name in kind)
    return ValueKind("|".join(kind), names, str, lambda table, key: table.choice(key, kind))


_HOST: Final = "host"
_ON: Final = ValueKind("on|off", "true or false", _level, Table.truth)
_JOINT: Final = ValueKind("JOINT", "name of a joint", str, Table.text)
_STATION: Final = ValueKind(f"JOINT|{_HOST}", "name of a joint", _joint_or_host, Table.text)
_INPUT: Final = ValueKind("NAME", "name of an input", str, Table.text)
_SWITCH: Final = _one_of(*SWITCHES)
_SEED: Final = _whole_number("SEED")
_COUNT: Final = _whole_number("N")
_MS: Final = _whole_number("MS")
_US: Final = _whole_number("US")
_SECONDS: Final = _number("SECONDS")
_ID: Final = ValueKind("ID", "identifier", _identifier, Table.integer)
_DATA: Final = ValueKind("HEX", "up to 8 bytes in hexadecimal digits", str, Table.text)
_FRAMES: Final = ValueKind("FRAMES", "name of frames, or list of identifiers", _frames, Table.text)
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
    required: Mapping[str, ValueKind]
    optional: Mapping[str, ValueKind]

    @property
    def keys(self) -> dict[str, ValueKind]:
        """All keys beside `do`, in the order of a command's words."""
        return {**self.required, **self.optional}

    @property
    def usage(self) -> str:
        """What stands behind the name in a command: the words that are needed, then those that are not, in brackets."""
        needed = [value.metavar for value in self.required.values()]
        return " ".join([*needed, *(f"[{key}={value.metavar}]" for key, value in self.optional.items())])


def _form(does: str, optional: Mapping[str, ValueKind] | None = None, /, **required: ValueKind) -> Form:
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
        {"microsteps": ValueKind("1|2|8|16", "1, 2, 8 or 16", _whole, Table.integer)},
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
        "the same station sends a frame again and again, up to 1000000 times; 0: no more",
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
    Do.BUS_OK: _form("all faults of the bus end, and so does babble"),
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


# --- what ends a harm


def _bus_end(values: Mapping[str, object]) -> str:
    return f"strike {values['count']} or `bus-ok`" if "count" in values else "`bus-ok`"


def _babble_end(values: Mapping[str, object]) -> str | None:
    period_us, count = values["period_us"], values["count"]
    if not count or not isinstance(period_us, int) or not isinstance(count, int):
        return None
    return f"{period_us * count / 1e6:g} s or `bus-ok`"


def _wire_end(values: Mapping[str, object]) -> str | None:
    if values["condition"] == Wiring.WHOLE:
        return None
    whole = f"`wire {values['joint']} {values['wire']} whole`"
    return f"{values['count']} disturbances or {whole}" if "count" in values else whole


def _switch_end(do: Do, free: str, values: Mapping[str, object]) -> str | None:
    ended = f"{do} {values['joint']} {values['switch']} {free}"
    return None if str(values[_CHANGED[do]]) == free else f"`{ended}`"


_CHANGED: Final = {Do.SWITCH_WIRE: "broken", Do.BOUNCE: "bounces"}
_ENDS: Final[Mapping[Do, Callable[[Mapping[str, object]], str | None]]] = {
    **dict.fromkeys((Do.LOSS, Do.CORRUPTION, Do.DUPLICATE, Do.DELAY), _bus_end),
    Do.BABBLE: _babble_end,
    Do.WIRE: _wire_end,
    Do.SWITCH_WIRE: partial(_switch_end, Do.SWITCH_WIRE, SwitchWiring.WHOLE),
    Do.BOUNCE: partial(_switch_end, Do.BOUNCE, "0"),
    Do.MODE: lambda values: f"`mode {values['joint']}`" if "microsteps" in values else None,
    Do.OSC: lambda values: f"`osc {values['joint']}` with the capacitor of before",
    Do.PAYLOAD: lambda _: "another `payload`",
    Do.BROWN_OUT: lambda values: None if "for_ms" in values else "`power-up`",
}
"""What ends the harms that last and that the state of the machine does not show."""


def end_of(do: Do, values: Mapping[str, object]) -> str | None:
    """Return what ends a harm that lasts, in words; None if it is over at once, or itself the end of one."""
    words = _ENDS.get(do)
    return None if words is None else words(values)
