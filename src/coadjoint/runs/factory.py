"""Systems written in a Python file in the folder of the run file: `factory = "file.py:function"`."""

from __future__ import annotations

import inspect
import sys
import traceback
from collections.abc import Callable
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path
from typing import TYPE_CHECKING, Any

from coadjoint import checks
from coadjoint.checks import unknown
from coadjoint.errors import ArgumentError, CoadjointError, FileError, rephrased
from coadjoint.postponed import load
from coadjoint.report.companion_files import keep_beside, kept_that_is_read
from coadjoint.runs.initial import initial_values
from coadjoint.sections import in_si, of_section
from coadjoint.texts import Table

if TYPE_CHECKING:
    from coadjoint.mechanics.state import State
    from coadjoint.mechanics.system import System

STATE = ("g", "q", "xi", "qdot", "a0", "t")
"""The arguments of `System.state` that a file can hold."""
ORIENTATION = ("rotation", "euler_zxz", "euler_zyx", "angular_velocity", "euler_rates")
"""Ways to give g and xi of a group of rotations; see `coadjoint.models.orientation`."""


def maker(factory: str, source: Path) -> Callable[[Table, Table], tuple[System, State]]:
    """A maker of a system and its start from sections [parameters] and [initial], by a function in the file `source`.

    The function takes [parameters] and returns a System, or a pair of it and a State. A system alone starts from
    [initial]: keywords of `System.state`, or an attitude in another form. Raises FileError for a file or function that
    does not exist; the maker raises ArgumentError for keys that do not fit and for a factory that raises or returns
    something else.
    """
    function = _function(source, factory.split(":")[1])

    def make(parameters: dict[str, object], initial: dict[str, object]) -> tuple[System, State]:
        from coadjoint.mechanics.start import StartGiven
        from coadjoint.mechanics.state import State
        from coadjoint.mechanics.system import System

        made = _called(function, source, _keywords(function, parameters))
        pair = isinstance(made, tuple) and len(made) == 2 and isinstance(made[0], System)
        if pair and isinstance(made[1], (State, StartGiven)):
            checks.leave_out(initial, "section [initial]", f"The factory {factory} returns its own start")
            return made
        if not isinstance(made, System):
            raise ArgumentError(
                f"The factory {factory} must return a co.System, or a pair of it and a state, but returned "
                f"{type(made).__name__}."
            )
        return made, start(made, initial)

    return make


def start(system: System, initial: Table) -> State:
    """The state of a system from a section [initial]; raises ArgumentError."""
    import jax

    from coadjoint.kernels.trace.evaluate import evaluate
    from coadjoint.models.orientation import orientation

    identity = evaluate(system.group.identity)
    turning = ORIENTATION if getattr(identity, "shape", None) == (3, 3) else ()
    values = initial_values(initial, [*STATE, *turning])
    ways = {name: values.pop(name) for name in turning if name in values}
    if ways:
        with rephrased(f"[initial] {', '.join(ways)}", ValueError, kind=ArgumentError):
            R, omega = orientation(**ways)
        said = [("g", R, ways.keys() & {"rotation", "euler_zxz", "euler_zyx"})]
        said.append(("xi", omega, ways.keys() & {"angular_velocity", "euler_rates"}))
        for name, value, given in said:
            if given and name in values:
                raise ArgumentError(f"[initial] gives both `{name}` and `{sorted(given)[0]}`: leave one out.")
            if given:
                values[name] = value
    if isinstance(values.get("g"), list) and len(jax.tree.leaves(identity)) > 1:
        values["g"] = tuple(values["g"])
    with of_section("initial"):
        return system.state(**values)


def _function(source: Path, name: str) -> Callable[..., Any]:
    specification = spec_from_file_location(f"coadjoint_factory_{source.stem}", source)
    if specification is None or specification.loader is None:
        raise FileError(f"The file {source} is not a Python file: its name must end in .py.")
    module = module_from_spec(specification)
    home = source.parent.resolve()
    sys.path.insert(0, str(home))
    load("jax")  # A file of a user has all of it, and none of `coadjoint.before_jax`.
    before = set(sys.modules)
    try:
        with kept_that_is_read(source):
            specification.loader.exec_module(module)
    except CoadjointError:
        raise
    except (Exception, SystemExit) as error:
        raise ArgumentError(f"The file {source} could not be run: {_error_line(error, source)}") from error
    finally:
        sys.path.pop(0)
    for file in (getattr(sys.modules[name], "__file__", None) for name in set(sys.modules) - before):
        if file and (path := Path(file).resolve()).is_relative_to(home) and "site-packages" not in path.parts:
            keep_beside(source, path.relative_to(home).as_posix(), path)
    found = getattr(module, name, None)
    if not callable(found):
        functions = [key for key, value in vars(module).items() if inspect.isfunction(value)]
        raise FileError(unknown(f"function `{name}`", f"The file {source}", name, functions))
    return found


def _keywords(function: Callable[..., object], parameters: dict[str, object]) -> dict[str, object]:
    """[parameters] as keywords of the factory, in SI units where its signature has the names."""
    taken = inspect.signature(function).parameters.values()
    if any(p.kind is p.VAR_KEYWORD for p in taken):
        return parameters
    found = in_si("parameters", parameters, [p.name for p in taken if p.kind is not p.VAR_POSITIONAL], {})
    lacking = [p.name for p in taken if p.default is p.empty and p.kind is not p.VAR_POSITIONAL and p.name not in found]
    if lacking:
        raise ArgumentError(f"Section [parameters] needs {', '.join(f'`{name}`' for name in lacking)}.")
    return found


def _called(function: Callable[..., object], source: Path, keywords: dict[str, object]) -> Any:
    try:
        with kept_that_is_read(source):
            return function(**keywords)
    except CoadjointError:
        raise
    except (Exception, SystemExit) as error:
        name = getattr(function, "__name__", "factory")
        raise ArgumentError(f"The factory {source}:{name} raised an error: {_error_line(error, source)}") from error


def _error_line(error: BaseException, source: Path) -> str:
    """The error in one line, with the last line of the user's file in its traceback."""
    lines = [frame.lineno for frame in traceback.extract_tb(error.__traceback__) if Path(frame.filename) == source]
    if isinstance(error, SyntaxError) and error.lineno:
        lines = [error.lineno]
    where = f" (line {lines[-1]})" if lines else ""
    first = (str(error.msg if isinstance(error, SyntaxError) else error).strip().split("\n") or [""])[0]
    return f"{type(error).__name__}: {first.rstrip('.')}{where}."
