"""``rigwright keys``: who may ask a service that others can reach."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from service.cli.options import DataOption, JsonOption

if TYPE_CHECKING:
    from service.keys.keyfile import Key

keys = typer.Typer(
    name="keys", help="Say who may use a service on a network.", no_args_is_help=True
)

NameArgument = Annotated[
    str, typer.Argument(metavar="NAME", help="Whose key it is.", show_default=False)
]


@keys.command("add")
def keys_add(
    name: NameArgument,
    scope: Annotated[
        Literal["read", "configure", "hardware"],
        typer.Option(
            help="read: look and stop; configure: work that fires nothing too; hardware: all."
        ),
    ] = "read",
    expires: Annotated[
        float | None,
        typer.Option(
            metavar="DAYS", help="Days until it ends; never without it.", show_default=False
        ),
    ] = None,
    data: DataOption = None,
    as_json: JsonOption = False,
) -> None:
    """Make a key and show it, once: only its hash is kept. A running service knows it at once.

    Example:  rigwright keys add anna --scope hardware --expires 90
    """
    from service.cli.output import print_json
    from service.cli.running import one_line_errors

    with one_line_errors():
        folder = _folder(data)
        from common.errors import InputError
        from common.files.writing import with_parents
        from service.keys.keyfile import add_key
        from service.keys.scope import Scope
        from service.store import refuse_foreign

        try:
            with with_parents(folder):
                refuse_foreign(folder)
                key, token = add_key(folder, name, Scope(scope), expires)
        except OSError as error:
            raise InputError(
                "data-folder",
                f"the data folder {folder} cannot be used ({error.strerror})",
                "give a folder you may write to with --data",
            ) from error
        if as_json:
            print_json({**_told(key), "key": token})
            return
        sys.stdout.write(f"{token}\n")
        sys.stderr.write(
            f"This is the key of {name} ({scope}, {_until(key)}). It is not shown again.\n"
        )


@keys.command("list")
def keys_list(data: DataOption = None, as_json: JsonOption = False) -> None:
    """List the keys: whose, what they may do, until when.

    Example:  rigwright keys list
    """
    from service.cli.output import print_json
    from service.cli.running import one_line_errors

    with one_line_errors():
        from service.keys.keyfile import read_keys

        found = read_keys(_folder(data))
        if as_json:
            print_json({"keys": [_told(key) for key in found]})
            return
        for key in found:
            sys.stdout.write(f"{key.name}: {key.scope}, {_until(key)}\n")
        if not found:
            sys.stdout.write("no keys\n")


@keys.command("revoke")
def keys_revoke(name: NameArgument, data: DataOption = None) -> None:
    """Take a key away, and all sign-ins with it. A running service knows at once.

    Example:  rigwright keys revoke anna
    """
    from service.cli.running import one_line_errors

    with one_line_errors():
        from service.keys.keyfile import revoke_key

        revoke_key(_folder(data), name)
        sys.stdout.write(f"the key of {name} is revoked\n")


def _folder(data: Path | None) -> Path:
    from service.settings import read_settings

    return read_settings(data_dir=data).data_dir


def _until(key: Key) -> str:
    if key.expires_at is None:
        return "never expires"
    return f"{'until' if key.valid() else 'expired'} {key.expires_at:%Y-%m-%d %H:%M} UTC"


def _told(key: Key) -> dict[str, object]:
    shown = key.model_dump(mode="json", exclude={"sha256"})
    return {**shown, "valid": key.valid()}
