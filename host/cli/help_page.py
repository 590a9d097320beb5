"""What `--help` shows of each command: words such as FILE instead of Python types."""

from typing import Any

from typer.core import TyperArgument, TyperCommand, TyperGroup


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


class Command(TyperCommand):
    """A command whose help names values by words such as FILE."""

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


def _print_help(command: TyperCommand | TyperGroup, context: Any) -> None:
    from steptwin.host.cli.help_layout import print_help

    print_help(command, context)


def paragraphs(docstring: str) -> str:
    """Return a docstring's text with each paragraph in one line, for help to wrap as the terminal is wide."""
    return "\n\n".join(" ".join(paragraph.split()) for paragraph in docstring.split("\n\n"))
