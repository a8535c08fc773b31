"""The public interface as api.json: names with signatures, variables of datasets, keys of files, commands.

    python .ci/interface.py                 writes api.json; needs both distributions, and CasADi
    python .ci/interface.py --check COMMIT  fails where api.json is out of date, and where the first section of
                                            CHANGELOG.md does not name a removal or a change since that commit

Further arguments with defaults are no change. Annotations are left out: types may become narrower in any version.
"""

from __future__ import annotations

import inspect
import json
import re
import subprocess
import sys
from collections.abc import Callable, Iterator, Mapping
from dataclasses import MISSING, fields, is_dataclass
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from types import FunctionType, ModuleType
from typing import Any

ROOT = Path(__file__).resolve().parents[1]
FILE, CHANGES = ROOT / "api.json", ROOT / "CHANGELOG.md"
OWN = ("coadjoint", "coadjoint_vehicles")
STATUSES = {
    "0": "done",
    "1": "a step failed, or the audit found a claim that does not hold",
    "2": "the request cannot be carried out",
    "130": "interrupted by Ctrl-C",
    "143": "interrupted by SIGTERM",
}
"""Those that `coadjoint.cli.main.main` describes."""


def interface() -> dict[str, Any]:
    """All of it, as JSON has it."""
    return {
        "names": {package: names(package) for package in packages()},
        "dataset": dataset(),
        "files": files(),
        "commands": commands(),
        "exit statuses": STATUSES,
    }


def packages() -> list[str]:
    """The packages whose `__all__` is public; no name of theirs is loaded."""
    from coadjoint.lazy import homes

    inner = [f"{own}.{name}" for own in OWN for name, (module, _) in homes(own).items() if module == own]
    sources = {one: Path(str(spec.origin)) for one in inner if (spec := find_spec(one)) is not None}
    listing = [one for one, source in sources.items() if "__all__" in source.read_text("utf-8")]
    return sorted({*OWN, *listing, "coadjoint.extending"})


def names(package: str) -> dict[str, Any]:
    """What each public name of a package is: a signature, of a class also those of its methods, or a value."""
    module = import_module(package)
    return {name: described(getattr(module, name)) for name in sorted(module.__all__)}


def described(made: object) -> Any:
    """A name: text, or for a class a table of its members."""
    if isinstance(made, ModuleType):
        return f"module {made.__name__}"
    if isinstance(made, type):
        return {"()": signature(made), **dict(sorted(members(made)))}
    if callable(made) and hasattr(made, "__name__"):
        return signature(made)
    return f"a {type(made).__name__}"


def members(made: type) -> Iterator[tuple[str, str]]:
    """Public methods, properties and fields that classes of the library give to a class."""
    for kind in reversed(made.__mro__):
        if kind.__module__.partition(".")[0] in OWN:
            declared = {one.name for one in fields(kind)} if is_dataclass(kind) else set()
            for name, value in vars(kind).items():
                if not name.startswith("_") and name not in declared and (words := member(value)):
                    yield name, words
    if is_dataclass(made):
        yield from ((one.name, "field") for one in fields(made) if not one.name.startswith("_"))


def member(value: object) -> str:
    """A member of a class; "" where it is not public."""
    if isinstance(value, FunctionType):
        return signature(value)
    if isinstance(value, classmethod | staticmethod):
        return f"{type(value).__name__}{signature(value.__func__)}"
    return "property" if isinstance(value, property) or type(value).__name__ == "cached_property" else ""


def signature(function: Callable[..., Any]) -> str:
    """Arguments with their defaults."""
    try:
        given = inspect.signature(function)
    except (TypeError, ValueError):
        return "(…)"
    plain = [one.replace(annotation=inspect.Parameter.empty, default=default(one)) for one in given.parameters.values()]
    return str(given.replace(parameters=plain, return_annotation=inspect.Signature.empty))


class Written:
    """A default that is printed as this text."""

    def __init__(self, text: str) -> None:
        self.text = text

    def __repr__(self) -> str:
        return self.text


def default(parameter: inspect.Parameter) -> object:
    """A default as text that is the same in each process."""
    value = parameter.default
    return value if value is inspect.Parameter.empty else Written(shown(value))


def shown(value: object) -> str:
    """A value as text, without addresses in memory."""
    if isinstance(value, type | FunctionType):
        return value.__qualname__
    words = " ".join(repr(value).split())
    if words == "<factory>":  # of a dataclass
        return "a default()"
    return f"<{type(value).__name__}>" if " at 0x" in words or len(words) > 200 else words


def dataset() -> list[str]:
    """Variables that datasets of runs may have; those of groups and of forces have more names behind an underscore."""
    from coadjoint.simulation import dataset as made
    from coadjoint.simulation.monitors import watched

    own = {*made._MEANINGS, *made._MEANINGS_RIGHT, *(one.name for one in watched())}
    return sorted(own | {"time", "step", "member", "code", "steps_done", "balance", "newton_residual"})


def files() -> dict[str, Any]:
    """Sections and keys of run, sweep and mission files; kinds of parts, sensors and controllers with their keys."""
    from coadjoint.runs.run_file import RunFile
    from coadjoint.sweeps.file import ResultsSection, SweepSection
    from coadjoint_vehicles.files.file import SECTIONS
    from coadjoint_vehicles.files.kinds import kinds
    from coadjoint_vehicles.missions.mission_section import MissionSection
    from coadjoint_vehicles.missions.sections import MissionSections
    from coadjoint_vehicles.missions.sensors import SensorsSection
    from coadjoint_vehicles.model.vehicle import Vehicle

    tables = {
        "run": {**dict.fromkeys(RunFile.FREE), **RunFile.SECTIONS},
        "sweep": {"vary": None, "sweep": SweepSection, "results": ResultsSection},
        "mission": {
            **dict.fromkeys(MissionSections.FREE),
            **MissionSections.SECTIONS,
            "mission": MissionSection,
            "sensors": SensorsSection,
        },
        "vehicle": {**dict.fromkeys(SECTIONS), "body": Vehicle},
        **{kind: dict(sorted(kinds(kind).items())) for kind in ("parts", "sensors", "controllers")},
    }
    return {
        file: {name: "a table" if kind is None else keys(kind) for name, kind in sections.items()}
        for file, sections in tables.items()
    }


def keys(kind: type) -> dict[str, str]:
    """The keys of a section, with their dimensions and defaults."""
    from coadjoint.sections import keys as declared

    found = {}
    of = {one.name: one for one in fields(kind)}
    for name, key in declared(kind).items():
        one = of[name]
        usual = "needed" if one.default is one.default_factory is MISSING else shown(one.default)
        if one.default_factory is not MISSING:
            usual = f"{getattr(one.default_factory, '__name__', 'a default')}()"
        found[name] = f"{key.dimension.si if key.dimension else '–'}, {usual}"
    return found


def commands() -> dict[str, dict[str, str]]:
    """The commands with their arguments and defaults; an argument without a default is positional or needed."""
    from typing import get_args

    from coadjoint.cli.main import every_command

    found = {}
    for one in get_args(every_command()):
        kind, conf = get_args(one)[:2]
        of = {}
        for argument in fields(kind):
            usual = "needed" if argument.default is argument.default_factory is MISSING else shown(argument.default)
            of[argument.name] = usual
        found[conf.name] = of
    return dict(sorted(found.items()))


def flat(table: object, above: str = "") -> dict[str, str]:
    """The leaves of a table by their paths."""
    if isinstance(table, list):
        return {f"{above}/{one}": "" for one in table}
    if not isinstance(table, Mapping):
        return {above: str(table)}
    return {path: leaf for name, inner in table.items() for path, leaf in flat(inner, f"{above}/{name}").items()}


def unmentioned(before: object, now: object, changes: str) -> list[str]:
    """Names that were removed or changed, and that no line of the changes has; of a class that went, it alone.

    A signature that takes all that it took before has not changed.
    """
    old, new = flat(before), flat(now)
    words = set(re.findall(r"\w+", changes))
    other = [path for path, leaf in old.items() if new.get(path) != leaf and not wider(leaf, new.get(path, ""))]
    gone = tuple(path.removesuffix("()") for path in other if path.endswith("/()") and path not in new)
    other = [path for path in other if path.endswith("/()") or not path.startswith(gone)]
    return [path for path in other if path.removesuffix("/()").rpartition("/")[2] not in words]


def wider(before: str, now: str) -> bool:
    """Whether a signature only adds arguments that have defaults, behind those that have positions."""
    if not before.endswith(")") or not now.endswith(")") or before.partition("(")[0] != now.partition("(")[0]:
        return False
    old, new = arguments(before), arguments(now)
    places = old[: old.index("*")] if "*" in old else old
    added = [one for one in new if one not in old]
    return (
        [one for one in new if one in old] == old
        and new[: len(places)] == places
        and all("=" in one or one == "*" for one in added)
    )


def arguments(signature: str) -> list[str]:
    """The arguments of a signature as text, split at commas outside of brackets."""
    found, depth = [""], 0
    for letter in signature.partition("(")[2][:-1]:
        depth += (letter in "([{") - (letter in ")]}")
        if letter == "," and depth == 0:
            found.append("")
        else:
            found[-1] += letter
    return [one.strip() for one in found if one.strip()]


def moved() -> set[str]:
    """Names that `coadjoint` does not list and still gives, with a warning."""
    from coadjoint import MOVED

    return set(" ".join(MOVED.values()).split())


def text(found: Mapping[str, Any]) -> str:
    """api.json: a line for each name."""
    return json.dumps(found, indent=1, ensure_ascii=False, sort_keys=False) + "\n"


def main(arguments: list[str]) -> int:
    found = text(interface())
    if arguments[:1] != ["--check"]:
        FILE.write_text(found, "utf-8")
        return 0
    if found != FILE.read_text("utf-8"):
        print(
            f"{FILE.name} is not what the library has: run `python .ci/interface.py`, and see `git diff {FILE.name}`."
        )
        return 1
    before = subprocess.run(["git", "show", f"{arguments[1]}:{FILE.name}"], cwd=ROOT, capture_output=True, text=True)
    if before.returncode != 0:
        print(f"{arguments[1]} has no {FILE.name}.")
        return 0
    newest = CHANGES.read_text("utf-8").partition("\n## ")[2].partition("\n## ")[0]
    old = json.loads(before.stdout)
    for name in moved():
        old["names"]["coadjoint"].pop(name, None)
    missing = unmentioned(old, json.loads(found), newest)
    for path in missing:
        print(f"{path} is gone or changed: say so in {CHANGES.name}.")
    return 1 if missing else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
