"""What `--help` shows of each command, words such as FILE instead of Python types; options that may stand alone."""

from collections.abc import Iterator, Sequence
from typing import Any, Final

from typer.core import TyperArgument, TyperCommand, TyperGroup

VALUES_ALONE: Final[dict[str, dict[str, str]]] = {}
"""By command, the options that may stand without a value, and the value that they have then."""


class _Argument(TyperArgument):
    """An argument that usage shows by its metavar alone."""

    def get_usage_pieces(self, *_: Any, **__: Any) -> list[str]:
        return [self.display_name_raw]


def _by_metavar(parameters: list[Any]) -> list[Any]:
    """Turn arguments that typer has built into the class above, which typer cannot be told to use."""
    for parameter in parameters:
        if isinstance(parameter, TyperArgument):
            parameter.__class__ = _Argument
    return parameters


class CliCommand(TyperCommand):
    """A command whose help names values by words such as FILE."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        return super().parse_args(ctx, list(_with_values(args, VALUES_ALONE.get(self.name or "", {}))))

    def get_params(self, ctx: Any) -> list[Any]:
        return _by_metavar(super().get_params(ctx))

    def format_help(self, ctx: Any, _formatter: Any) -> None:
        _print_help(self, ctx)


class Commands(TyperGroup):
    """The program itself, `steptwin`, with the same help."""

    def get_params(self, ctx: Any) -> list[Any]:
        return _by_metavar(super().get_params(ctx))

    def format_help(self, ctx: Any, _formatter: Any) -> None:
        _print_help(self, ctx)


def _with_values(words: Sequence[str], alone: dict[str, str]) -> Iterator[str]:
    """Yield the words of a command line; an option that stands alone gets its value."""
    for index, word in enumerate(words):
        if word == "--":
            yield from words[index:]
            return
        yield f"{word}={alone[word]}" if word in alone else word


def _print_help(command: TyperCommand | TyperGroup, context: Any) -> None:
    from steptwin.host.cli.help_layout import print_help

    print_help(command, context)


def paragraphs(docstring: str) -> str:
    """Return a docstring's text with each paragraph in one line, for help to wrap as the terminal is wide."""
    return "\n\n".join(" ".join(paragraph.split()) for paragraph in docstring.split("\n\n"))
