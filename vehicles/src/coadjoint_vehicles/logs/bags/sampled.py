"""The measurements of a topic of a bag, at its times, in the library's axes."""

from __future__ import annotations

from collections.abc import Collection

import numpy as np

from coadjoint.clocks import REFUSED, Choices
from coadjoint.errors import FileError
from coadjoint_vehicles.logs.bags.converted import along_body, converted
from coadjoint_vehicles.logs.bags.merged import Actuation, Samples
from coadjoint_vehicles.logs.bags.messages import Topic
from coadjoint_vehicles.logs.bags.mounting import along_the_body, positions
from coadjoint_vehicles.logs.bags.sensors import CommandTopic, SensorTopic, Stamp
from coadjoint_vehicles.logs.turned import turned

DISORDER = 100_000_000
"""By how many ns a message may be logged before the one ahead of it."""

SECONDS, NANOSECONDS = "header.stamp.sec", "header.stamp.nanosec"


def samples(
    topic: Topic, sensor: SensorTopic, ignore: Collection[str] = (), choices: Choices = REFUSED
) -> tuple[Samples, list[str]]:
    """The samples of a sensor, and notes; raises FileError for messages that do not fit and stamps that decrease."""
    own = {name: number for name, number in sensor.columns.items() if name not in ignore}
    unless = {sensor.unless[name] for name in own if name in sensor.unless}
    found = topic.numbers([*{number.path for number in own.values()}, *unless, *_stamped(topic, sensor.stamp)])
    times, kept, pieces, notes = _times(topic, sensor.stamp, sensor.offset, found, choices)
    if sensor.every > 0 and len(kept):
        bins = np.floor((times - times[0]) / (sensor.every * 1e9))
        first = np.sort(np.unique(bins + pieces * (np.ptp(bins) + 1), return_index=True)[1])
        times, kept, pieces = times[first], kept[first], pieces[first]
    given = {name: found[number.path][kept] * number.factor for name, number in own.items()}
    for name, values in given.items():
        if name in sensor.unless:
            values[found[sensor.unless[name]][kept] == -1] = np.nan
    for name, values in given.items():
        if np.any(np.isinf(values)):
            at = int(np.flatnonzero(np.isinf(values))[0])
            raise FileError(f"{topic.where}: `{own[name].path}` of {topic.name} is infinite in sample {at + 1}.")
    where = f"{topic.where}: {topic.name}"
    plain, more = converted(given, sensor.water, sensor.origin, where)
    columns = along_the_body(turned(where, plain, sensor.axes), sensor.mounting, where)
    columns |= along_body(given, columns, where)
    kept_columns = {n: v for n, v in columns.items() if n not in ignore}
    places = positions(kept_columns, sensor.mounting)
    own = Samples(topic.name, times, kept_columns, sensor.rank, _lag(topic, found), places, pieces)
    return own, [*notes, *more]


def driving(topic: Topic, command: CommandTopic, choices: Choices = REFUSED) -> tuple[Actuation, list[str]]:
    """The commands or actual values of an actuator, and notes; raises FileError as `samples` and for missing values."""
    paths = [number.path for number in command.numbers]
    found = topic.numbers([*paths, *_stamped(topic, command.stamp)])
    times, kept, pieces, notes = _times(topic, command.stamp, command.offset, found, choices)
    values = np.stack([found[number.path][kept] * number.factor for number in command.numbers], axis=-1)
    if bad := np.count_nonzero(~np.isfinite(values).all(axis=1)):
        raise FileError(f"{topic.where}: {bad} of {len(values)} messages of {topic.name} lack numbers of a command.")
    values = values[:, 0] if len(paths) == 1 else values
    lag = _lag(topic, found)
    return Actuation(topic.name, command.name, times, values, command.unit, command.did, lag, pieces), notes


def _lag(topic: Topic, found: dict[str, np.ndarray]) -> float | None:
    """The median of the times of logging less the stamps, s; None where times are those of logging."""
    if SECONDS not in found or not len(topic):
        return None
    stamps = found[SECONDS].astype(np.int64) * 1_000_000_000 + found[NANOSECONDS].astype(np.int64)
    return float(np.median(topic.times - stamps)) * 1e-9


def _stamped(topic: Topic, stamp: Stamp | None) -> tuple[str, ...]:
    """The paths of the stamp in the head of messages; none where times are those of the log."""
    has = any(field.name == "header" for field in topic.definition.types[topic.definition.name])
    if stamp == "header" and not has:
        raise FileError(
            f'{topic.where}: messages of {topic.name} ({topic.definition.name}) have no head with a stamp: stamp="log" '
            "takes when they were logged."
        )
    return (SECONDS, NANOSECONDS) if has and stamp != "log" else ()


def _times(
    topic: Topic, stamp: Stamp | None, offset: float, found: dict[str, np.ndarray], choices: Choices
) -> tuple[np.ndarray, np.ndarray, np.ndarray, list[str]]:
    """Times, ns, which messages are kept, in their order, the number of the piece between jumps of the clock to which
    each belongs, and notes."""
    stamped = SECONDS in found
    times = topic.times
    if stamped:
        times = found[SECONDS].astype(np.int64) * 1_000_000_000 + found[NANOSECONDS].astype(np.int64)
        if len(times) > 1 and not np.any(times):
            raise FileError(
                f'{topic.where}: messages of {topic.name} have no stamps, but 0 in all heads: stamp="log" takes when '
                "they were logged."
            )
    # Messages may be logged a little out of order, but are stamped in order.
    back = np.diff(times) < (0 if stamped else -DISORDER)
    if back.any() and choices.unsorted == "refuse" and choices.jumps == "refuse":
        raise FileError(_goes_back(topic, times, int(np.argmax(back)), stamped))
    pieces = np.append(0, np.cumsum(back)) if choices.unsorted == "refuse" else np.zeros(len(times), int)
    pieces = pieces[: len(times)]
    order = np.lexsort((times, pieces))
    sorted_times, sorted_pieces = times[order] + round(offset * 1e9), pieces[order]
    again = np.zeros(len(order), bool)
    again[1:] = (np.diff(sorted_times) == 0) & (np.diff(sorted_pieces) == 0)
    notes = [f"{int(again.sum())} messages of {topic.name} are of the time of the one before, and are left out."]
    return sorted_times[~again], order[~again], sorted_pieces[~again], notes if again.any() else []


def _goes_back(topic: Topic, times: np.ndarray, at: int, stamped: bool) -> str:
    by = (times[at] - times[at + 1]) * 1e-9
    said = "stamped" if stamped else "logged"
    remedy = ', or take when they were logged by stamp="log"' if stamped else ""
    return (
        f"{topic.where}: messages of {topic.name} go back in time: message {at + 2} is {said} {by:.9g} s before "
        "the one "
        'ahead of it: where they are out of order, unsorted="sort" sorts them (--unsorted sort); where the clock '
        "was set "
        f'back, jumps="split" begins a new stretch of the log there (--jumps split); or correct them{remedy}.'
    )
