"""The sensors of a vehicle file: `[sensors.NAME]`, with a section for the errors of each channel."""

from __future__ import annotations

from coadjoint_vehicles import axes as border
from coadjoint_vehicles.files.kinds import kinds
from coadjoint_vehicles.files.read_parts import built, read_fields
from coadjoint_vehicles.files.table import Notebook, Section, axes_of
from coadjoint_vehicles.sensors.errors import Channel, Errors, dimensions
from coadjoint_vehicles.sensors.sensor import Sensor


def read_sensors(book: Notebook, given: object, axes: border.Axes) -> tuple[Sensor, ...]:
    """The sensors of [sensors], each a separate section, in the order of the file; raises ArgumentError."""
    if not isinstance(given, dict):
        raise book.fail("sensors are sections with names of their own, as in [sensors.imu], and no list.")
    return tuple(
        _sensor(Section(book, f"[sensors.{name}]", f"sensors.{name}", given[name]), name, axes) for name in given
    )


def _sensor(section: Section, name: str, axes: border.Axes) -> Sensor:
    if not name.isidentifier():
        raise section.fail(f"the name of a sensor must be one word of letters, digits and _, but is {name!r}.")
    cls = kinds("sensors")[section.text("kind", None, tuple(sorted(kinds("sensors"))))]
    section.text("note", "")
    values = read_fields(section, cls, axes_of(section, axes))
    for channel in cls.channels:
        if channel.name in section:
            values[channel.name] = _errors(section, channel)
    section.done()
    return built(section, lambda: cls(name=name, **values))


def _errors(section: Section, channel: Channel) -> Errors:
    """The errors of a channel, of the section [sensors.NAME.CHANNEL]."""
    found = section.given[channel.name]
    if isinstance(found, dict) and "value" in found:
        raise section.fail(
            f"{channel.name} has several errors, each with its name: write {channel.name}.noise = {{ … }}, of one "
            f"reading, or another of {', '.join(dimensions(channel))}."
        )
    inner = section.inner(channel.name)
    inner.title = f"{section.title[:-1]}.{channel.name}]"
    values = {
        name: inner.quantity(name, measures)[0] for name, measures in dimensions(channel).items() if name in inner
    }
    inner.done()
    return Errors(**values)
