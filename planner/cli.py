"""The command line: ties the commands together and turns the user's mistakes into one message.

Exit code 0; 1 where `check` finds an error, or the reader of the output went away; 2 bad input; 130
interrupted. Nothing heavy is imported here or in the head of a command's module: a command imports what it
needs when it runs, so that `--help` comes at once.

A command is a module in `planner.commands` with a function `register(app)`; it is listed in `COMMANDS`.
"""

import os
import sys
from importlib import import_module

import typer

from geometry.errors import LidarplanError

COMMANDS = (
    "new",
    "point",
    "check",
    "wakes",
    "errors",
    "view",
    "report",
    "tradeoff",
    "place",
    "simulate",
    "retrieve",
    "compare",
    "tour",
    "export",
    "cnr_map",
)  # modules of planner.commands, in the order of the help

BAD_INPUT = 2
INTERRUPTED = 130
PIPE_CLOSED = 1


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


def _root() -> None:
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
    try:
        code = _exit_code(arguments)
        sys.stdout.flush()
    except LidarplanError as error:
        print(f"lidarplan: {error}", file=sys.stderr)  # noqa: T201
        return BAD_INPUT
    except KeyboardInterrupt:
        code = INTERRUPTED
    except BrokenPipeError:
        # the reader (`| head`) has gone: the interpreter must not try again on its way out
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return PIPE_CLOSED
    if code == INTERRUPTED:
        print("lidarplan: interrupted", file=sys.stderr)  # noqa: T201
    return code


def _exit_code(arguments: list[str]) -> int:
    try:
        build()(args=arguments, prog_name="lidarplan")
    except SystemExit as leaving:
        return leaving.code if isinstance(leaving.code, int) else int(leaving.code is not None)
    return 0


if __name__ == "__main__":
    main()
