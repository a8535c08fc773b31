"""The command line: `coadjoint reproduce`, `run`, `resume`, `plot`, `info`, `models`, …, and those of extensions."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Annotated, Any, Literal

import tyro

from coadjoint.cli import commands, terminal
from coadjoint.cli.comparing import Compare
from coadjoint.cli.installation import Doctor, versions
from coadjoint.cli.keys import Keys
from coadjoint.cli.metavars import called
from coadjoint.cli.reporting import Report
from coadjoint.cli.sweeping import Sweep
from coadjoint.cli.termination import status, stoppable, word
from coadjoint.cli.verifying import Verify
from coadjoint.cli.viewing import View
from coadjoint.errors import ArgumentError, CoadjointError, StepError, printable
from coadjoint.extensions import Registry, absent, extensions, import_string
from coadjoint.interrupts import deferred_interrupts
from coadjoint.log import phase
from coadjoint.texts import read_table

USAGE = 2


@dataclass(frozen=True)
class Completion:
    """Print a script that completes commands and options in a shell: `coadjoint completion bash >> ~/.bashrc`."""

    shell: Annotated[tyro.conf.Positional[Literal["bash", "zsh", "tcsh"]], called("{bash,zsh,tcsh}")]
    """The shell."""

    def __call__(self) -> int:
        with suppress(SystemExit):  # by which tyro ends where it has printed
            tyro.cli(every_command(), prog="coadjoint", args=["--tyro-print-completion", self.shell])
        return 0


Command = (
    Annotated[commands.Reproduce, tyro.conf.subcommand("reproduce")]
    | Annotated[commands.Run, tyro.conf.subcommand("run")]
    | Annotated[commands.Resume, tyro.conf.subcommand("resume")]
    | Annotated[commands.Plot, tyro.conf.subcommand("plot")]
    | Annotated[View, tyro.conf.subcommand("view")]
    | Annotated[Report, tyro.conf.subcommand("report")]
    | Annotated[commands.Info, tyro.conf.subcommand("info")]
    | Annotated[Verify, tyro.conf.subcommand("verify")]
    | Annotated[Compare, tyro.conf.subcommand("compare")]
    | Annotated[commands.Models, tyro.conf.subcommand("models")]
    | Annotated[Keys, tyro.conf.subcommand("keys")]
    | Annotated[commands.Audit, tyro.conf.subcommand("audit")]
    | Annotated[Sweep, tyro.conf.subcommand("sweep")]
    | Annotated[Doctor, tyro.conf.subcommand("doctor")]
    | Annotated[Completion, tyro.conf.subcommand("completion")]
)

"""The commands of the core."""

COMMANDS: Registry[str] = Registry("COMMANDS")
"""Those of packages above: the dataclass of each, as "module:name", by the word for it."""


VEHICLES, RUN_FILE = "coadjoint_vehicles", "run.toml"

OF_VEHICLES = ("identify", "import", "serve", "stability", "vehicles")
"""Commands of coadjoint-vehicles, which may not be installed."""


def every_command() -> Any:
    """The commands of the core and those of packages above, as a union for tyro."""
    found: Any = Command
    for name, place in COMMANDS.items():
        found = found | Annotated[import_string(place), tyro.conf.subcommand(name)]
    return found


def main(arguments: Sequence[str] | None = None, alone: bool = False) -> int:
    """Run a command and return the exit status. alone: whether the process is this command, which shows its phases.

    0: done. 1: a step failed; what was computed is kept. 2: the request cannot be carried out; one sentence on stderr
    says why. 130: interrupted by Ctrl-C; 143: by SIGTERM. With COADJOINT_TRACEBACK set, unexpected errors show where
    they arose.
    """
    with stoppable() as came:
        try:
            with deferred_interrupts(), terminal.warned():
                return _run(sys.argv[1:] if arguments is None else list(arguments), alone)
        except KeyboardInterrupt as stop:
            folder = [f"; `coadjoint resume {part}` continues the run" for part in stop.args if _is_folder(part)]
            terminal.complain(f"{word(came)}{''.join(folder)}.")
            return status(came)
        except BrokenPipeError:
            # The reader has closed the pipe, as in `coadjoint info DIR | head`: nothing more can be written.
            os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
            return commands.OK
        except CoadjointError as error:
            terminal.complain(str(error))
            return commands.FAILED if isinstance(error, StepError) else USAGE
        except Exception as error:
            if os.environ.get("COADJOINT_TRACEBACK"):
                raise
            if came:  # other libraries may turn an interrupt into this
                terminal.complain(f"{word(came)}.")
                return status(came)
            terminal.complain(unexpected(error))
            return commands.FAILED


def _is_folder(part: object) -> bool:
    return isinstance(part, os.PathLike)


def _run(given: list[str], alone: bool) -> int:
    if given == ["--version"]:
        terminal.line(versions())
        return commands.OK
    if given and given[0] in OF_VEHICLES and given[0] not in COMMANDS:
        raise ArgumentError(absent(f"The command `{given[0]}`"))
    command = _parsed(given or ["--help"])
    with terminal.phases(alone and not getattr(command, "json", False)):
        if begins := getattr(command, "BEGINS", ""):
            phase(begins.format(**vars(command)))
        if alone and not _may_use_dask(command):
            sys.modules.setdefault("dask", None)  # pyright: ignore[reportArgumentType]
        status = command()
    sys.stdout.flush()
    return status


def _may_use_dask(command: object) -> bool:
    """Whether a command runs sweeps, files of Python or packages of others, which may use dask.

    xarray imports dask, if it is installed, for half a second to see that no array is one of its arrays.
    """
    core = type(command).__module__.startswith("coadjoint.cli.")
    if not core or isinstance(command, Sweep) or any(name.partition(".")[0] != VEHICLES for name in extensions()):
        return True
    named = getattr(command, "file", None) or Path(getattr(command, "folder", "")) / RUN_FILE
    if not isinstance(command, (commands.Run, commands.Resume)):
        return False
    try:  # its comments may name files of Python, which nothing reads
        return ".py" in str(read_table(named.read_text(errors="replace"), named))
    except (OSError, CoadjointError):
        return True


def _parsed(given: Sequence[str]) -> Callable[[], int]:
    """The command of the arguments; messages on names that hold control characters show these as escapes.

    Names of files come as arguments as well, where the shell expands `*`.
    """
    parse = partial(
        tyro.cli,
        every_command(),
        prog="coadjoint",
        description="Variational integrators on Lie groups from a reduced Lagrangian. `coadjoint --version` prints the "
        "versions that it runs with, `coadjoint COMMAND --help` all options of a command.",
        config=(tyro.conf.FlagCreatePairsOff,),
    )
    shown = [printable(argument) for argument in given]
    if shown == [*given]:
        return parse(args=given)
    try:
        return parse(args=given, console_outputs=False)
    except SystemExit:
        parse(args=shown)
        raise


def run() -> None:
    """The entry of `python -m coadjoint`."""
    sys.exit(main())


if __name__ == "__main__":
    run()


def unexpected(error: Exception) -> str:
    """The message on an unexpected error: the error, the versions, and what to report."""
    first = (str(error).strip().split("\n") or [""])[0]
    what = f"{type(error).__name__}: {first}" if first else type(error).__name__
    return (
        f"coadjoint met an error that it did not expect, {what}\n"
        f"This is {versions()}.\n"
        "Please report it: these lines, the command, the file that it was given, and what it prints with "
        "COADJOINT_TRACEBACK=1 set, which tells where."
    )
