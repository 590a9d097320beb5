"""Show arguments and options in `--help` by words such as FILE instead of Python types."""

from typing import Any

from typer.core import TyperArgument, TyperCommand, TyperGroup, TyperOption


class _Argument(TyperArgument):
    """An argument that help and usage show by its metavar alone."""

    def display_type_rich(self, *_: Any, **__: Any) -> None:
        return None

    def get_usage_pieces(self, *_: Any, **__: Any) -> list[str]:
        return [self.display_name_raw]


class _Option(TyperOption):
    """An option whose value is shown by its metavar; a flag has neither."""

    def display_type_rich(self, *_: Any, **__: Any) -> str | None:
        return self.metavar


def _by_metavar(parameters: list[Any]) -> list[Any]:
    """Turn parameters that typer has built into the classes above, which typer cannot be told to use."""
    for parameter in parameters:
        parameter.__class__ = _Argument if isinstance(parameter, TyperArgument) else _Option
    return parameters


class Command(TyperCommand):
    """A command whose help names values by words such as FILE."""

    def get_params(self, ctx: Any) -> list[Any]:
        return _by_metavar(super().get_params(ctx))


class Commands(TyperGroup):
    """The program itself, `steptwin`, with the same help."""

    def get_params(self, ctx: Any) -> list[Any]:
        return _by_metavar(super().get_params(ctx))


def paragraphs(docstring: str) -> str:
    """Return a docstring's text with each paragraph in one line, for help to wrap as the terminal is wide."""
    return "\n\n".join(" ".join(paragraph.split()) for paragraph in docstring.split("\n\n"))
