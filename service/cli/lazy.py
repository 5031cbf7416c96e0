"""A program of many commands that builds only the one that is asked for.

To build a command is to evaluate the type of every option that it has. For all commands that
takes longer than all else that the help does, which shows their names and first lines only.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable, Iterator, Mapping
from typing import TYPE_CHECKING, Any, cast

import typer
from typer.core import TyperCommand, TyperGroup

if TYPE_CHECKING:
    from typer._click import Command, Context, HelpFormatter

Listed = Callable[..., Any] | typer.Typer


class LazyCommands(Mapping[str, "Command"]):
    """Commands by name, in the order of ``listed``: functions, and groups with their names."""

    def __init__(self, *listed: Listed) -> None:
        self._listed = {_name(one): one for one in listed}
        self._built: dict[str, Command] = {}

    def __getitem__(self, name: str) -> Command:
        if name not in self._built:
            self._built[name] = _built(name, self._listed[name])
        return self._built[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._listed)

    def __len__(self) -> int:
        return len(self._listed)

    @property
    def built(self) -> list[str]:
        """Names of the commands that somebody asked for."""
        return list(self._built)

    def first_lines(self) -> dict[str, Command]:
        """Each by its name with its help and no options: enough to list it, not to run it."""
        return {
            name: TyperCommand(name, help=_help(one), rich_markup_mode=None)
            for name, one in self._listed.items()
        }


def group_of(commands: LazyCommands) -> type[TyperGroup]:
    """The class of a group that has these commands, for ``typer.Typer(cls=...)``."""

    class LazyGroup(TyperGroup):
        def __init__(self, **settings: Any) -> None:  # noqa: ANN401
            super().__init__(**settings)
            self.commands = commands  # type: ignore[assignment]

        def list_commands(self, ctx: Context) -> list[str]:  # noqa: ARG002
            return list(commands)

        def format_commands(self, ctx: Context, formatter: HelpFormatter) -> None:
            TyperGroup(commands=commands.first_lines()).format_commands(ctx, formatter)

    return LazyGroup


def _name(listed: Listed) -> str:
    if isinstance(listed, typer.Typer):
        return str(listed.info.name)
    return listed.__name__.replace("_", "-")


def _help(listed: Listed) -> str | None:
    if isinstance(listed, typer.Typer):
        return str(listed.info.help)
    return inspect.getdoc(listed)


def _built(name: str, listed: Listed) -> Command:
    """The command as a program of its own has it, which a callback makes a group."""
    program = typer.Typer(add_completion=False, rich_markup_mode=None)
    program.callback()(lambda: None)
    if isinstance(listed, typer.Typer):
        program.add_typer(listed)
    else:
        program.command(name)(listed)
    group = cast("TyperGroup", typer.main.get_command(program))
    return group.commands[name]
