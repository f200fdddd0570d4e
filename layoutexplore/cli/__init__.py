"""The command line: `layoutexplore COMMAND`.

Each group of commands lives in its own file and registers itself here.

Nothing heavy is imported before a command runs, so that `--help` answers at once.
"""

from __future__ import annotations

import contextlib
import io
import re
import sys
import warnings
from importlib import import_module
from pathlib import Path
from typing import Annotated, Any

import typer
from typer.core import TyperGroup

import layoutexplore
from layoutexplore.errors import LayoutExploreError, MapWarning, shortened

GROUPS = (
    *("benchmark", "replay", "leaderboard", "explore", "train"),
    *("maps", "layout", "frontiers", "evaluate", "names", "warm_up", "speed", "docs"),
)
"""Modules of this package with commands, in the order in which the help shows them."""

MEANT = {"--config": ".toml", "--plans": "", "--agent": ""}
"""Options by which a word too many may be meant if it ends so: the first one that the command has."""

QUOTED = 'corners stand in one pair of quotes: --region "0,0 12,0 12,9"'
"""What is said of a corner that stands alone."""


class Commands(TyperGroup):
    """All commands; of a word too many it is said by which option it may be meant.

    An option of one value may be given again, as in other programs: that the last one counts is said.
    """

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Take the command line apart, whole as it is here."""
        if not ctx.resilient_parsing:
            for option in _given_again(self, args):
                typer.echo(f"layoutexplore: warning: {option} takes one value: the last one counts", err=True)
        return super().parse_args(ctx, args)

    def invoke(self, ctx: Any) -> Any:
        """Run the command that was named."""
        try:
            return super().invoke(ctx)
        except Exception as error:  # Typer has Click's errors under different names in different versions
            told, context = str(getattr(error, "message", "")), getattr(error, "ctx", None)
            if context and (surplus := re.match(r"Got unexpected extra argument\S* \((\S+?)[ )]", told)):
                word = surplus[1]
                known = {name for option in context.command.params for name in option.opts}
                meant = [
                    f"perhaps {name} {word}"
                    for name, end in MEANT.items()
                    if name in known and word.endswith(end)
                ]
                if "--region" in known and re.fullmatch(r"[\d.]+,[-\d.]+", word):
                    meant = [QUOTED]
                vars(error)["message"] = ": ".join([told, *meant[:1]])
            raise


def _given_again(command: Any, words: list[str]) -> list[str]:
    """The options of the command that words name that take one value, and are given more."""
    while words and (inner := getattr(command, "commands", {}).get(words[0])):
        command, words = inner, words[1:]
    if "--" in words:
        words = words[: words.index("--")]
    given = [word.partition("=")[0] for word in words]
    single = [
        option
        for option in command.params
        if option.param_type_name == "option" and not (option.multiple or option.is_flag or option.count)
    ]
    return [option.opts[0] for option in single if sum(map(given.count, option.opts)) > 1]


app = typer.Typer(
    name="layoutexplore",
    cls=Commands,
    help="Explore unknown buildings with a simulated lidar and a predicted layout.",
    epilog="Start with: [bold]layoutexplore benchmark[/bold]  or  [bold]layoutexplore explore office-01 "
    "--agent tour[/bold]",
    rich_markup_mode="rich",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)


def _show_version(wanted: bool) -> None:
    if wanted:
        typer.echo(f"layoutexplore {layoutexplore.__version__}")
        raise typer.Exit


@app.callback()
def _options(
    version: Annotated[
        bool,
        typer.Option("--version", callback=_show_version, is_eager=True, help="Show the version and exit."),
    ] = False,
) -> None:
    """Options of all commands."""


for _group in GROUPS:
    import_module(f"layoutexplore.cli.{_group}").register(app)


def _one_line(
    message: Warning | str, category: type[Warning], filename: str, lineno: int, line: str | None = None
) -> str:
    """A warning about a map as one line without its place in the code, any other as Python shows it."""
    if issubclass(category, MapWarning):
        return f"layoutexplore: warning: {message}\n"
    return f"{filename}:{lineno}: {category.__name__}: {message}\n"


def _without_folder() -> str:
    """What is said where the folder that this process is in has been removed."""
    with contextlib.suppress(OSError):
        Path.cwd()
        return ""
    return ": the folder in which this command was given is no longer there: go into another"


def main() -> None:
    """Run the command line; what goes wrong on purpose becomes one clear line and exit status 2."""
    warnings.formatwarning = _one_line
    if isinstance(sys.stdout, io.TextIOWrapper):
        sys.stdout.reconfigure(errors="backslashreplace")  # as stderr: names of files may be no text
    try:
        app()
    except LayoutExploreError as error:
        print(f"layoutexplore: {error}", *getattr(error, "__notes__", ()), sep="\n", file=sys.stderr)
        sys.exit(2)
    except BrokenPipeError:
        # The reader has gone (`layoutexplore ... | head`): that is not an error, but nothing more can be
        # written.
        sys.stdout = None
        sys.exit(0)
    except OSError as error:  # a full disk, a folder that is not ours
        name = str(error.filename or "")
        where = f"{shortened(name) if len(name) > 500 else name}: " if name else ""
        print(f"layoutexplore: {where}{error.strerror or error}{_without_folder()}", file=sys.stderr)
        sys.exit(2)
    except (Exception, SystemExit) as error:  # in a user's own code: told without the frames around it
        from layoutexplore.plugins.tracebacks import own_frames, told

        if not own_frames(error):
            raise
        print(told(error), file=sys.stderr)
        sys.exit(1)
