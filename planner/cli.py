"""The command line: ties the commands together and turns the user's mistakes into one message.

Exit code 0, also where the reader of the output went away; 1 where `check` finds an error; 2 bad input, or
an output that cannot be written; 130 interrupted. Nothing heavy is imported here or in the head of a
command's module: a command imports what it needs when it runs, so that `--help` comes at once.

A command is a module in `planner.commands` with a function `register(app)`; it is listed in `COMMANDS`.
"""

import errno
import os
import sys
from importlib import import_module
from typing import Annotated

import typer

from geometry.errors import LidarplanError, UnavailableError

COMMANDS = (
    "new",
    "point",
    "crossings",
    "check",
    "wakes",
    "errors",
    "view",
    "report",
    "tradeoff",
    "place",
    "stay",
    "share",
    "simulate",
    "retrieve",
    "compare",
    "tour",
    "export",
    "cnr_map",
)  # modules of planner.commands, in the order of the help

BAD_INPUT = 2
INTERRUPTED = 130
PIPE_CLOSED = 0
OUTPUT_ERRORS = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EIO, errno.EBADF)  # of a write, not of a name


def build() -> typer.Typer:
    """Make the application with all of its commands."""
    app = typer.Typer(
        name="lidarplan",
        help="Plan scanning Doppler lidar campaigns.",
        no_args_is_help=True,
        add_completion=False,
        pretty_exceptions_enable=False,
        rich_markup_mode=None,  # rich costs as much again as all the rest of `--help`
    )
    app.callback()(_root)  # keeps `lidarplan new` a command of its own while there is only one
    for name in COMMANDS:
        import_module(f"planner.commands.{name}").register(app)
    return app


def _tell_version(wanted: bool) -> None:
    """Print the version and leave, where it is asked for."""
    if wanted:
        typer.echo(f"lidarplan {_version()}")
        raise typer.Exit


def _version() -> str:
    """The installed version, or in a clone that is not installed its own."""
    import tomllib
    from importlib.metadata import PackageNotFoundError, version
    from pathlib import Path

    try:
        return version("lidarplan")
    except PackageNotFoundError:
        project = Path(__file__).resolve().parents[1] / "pyproject.toml"
    if not project.is_file():
        raise UnavailableError("the version of a lidarplan that is not installed is not known")
    return str(tomllib.loads(project.read_text(encoding="utf-8"))["project"]["version"])


VersionOption = Annotated[
    bool,
    typer.Option("--version", callback=_tell_version, is_eager=True, help="Print the version and leave."),
]


def _root(version: VersionOption = False) -> None:
    """Plan scanning Doppler lidar campaigns: where beams go, what they see, how wrong the wind will be."""


def main() -> None:
    """Run the command line and leave with its exit code."""
    sys.exit(run(sys.argv[1:]))


def run(arguments: list[str]) -> int:
    """Run the command line.

    Parameters
    ----------
    arguments : list of str
        Without the program's name.

    Returns
    -------
    int
        The exit code. A mistake of the user is told on stderr in one message; any other exception is a defect
        and comes out as it is.
    """
    if sys.stdout is None:  # closed from the start: files that are opened would take its place
        print("lidarplan: standard output is closed; send it somewhere, to /dev/null say", file=sys.stderr)  # noqa: T201
        return BAD_INPUT
    code = PIPE_CLOSED
    try:
        code = _exit_code(arguments)
        sys.stdout.flush()
    except LidarplanError as error:
        print(f"lidarplan: {error}", file=sys.stderr)  # noqa: T201
        return BAD_INPUT
    except KeyboardInterrupt:
        code = INTERRUPTED
    except BrokenPipeError:
        _drop_output()  # the reader (`| head`) has gone
    except OSError as error:
        if error.filename is not None or error.errno not in OUTPUT_ERRORS:
            raise
        _drop_output()
        print(f"lidarplan: the output cannot be written ({error.strerror})", file=sys.stderr)  # noqa: T201
        return BAD_INPUT
    if code == INTERRUPTED:
        print("lidarplan: interrupted", file=sys.stderr)  # noqa: T201
    return code


def _exit_code(arguments: list[str]) -> int:
    try:
        build()(args=arguments, prog_name="lidarplan")
    except SystemExit as leaving:
        if isinstance(leaving.__context__, BrokenPipeError):
            raise leaving.__context__ from None  # typer makes it a 1, which here means a finding
        return leaving.code if isinstance(leaving.code, int) else int(leaving.code is not None)
    return 0


def _drop_output() -> None:
    """Send what is still to be written nowhere: the interpreter must not try again on its way out."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


if __name__ == "__main__":
    main()
