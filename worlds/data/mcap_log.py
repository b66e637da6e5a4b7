"""Samples of named fields from an MCAP log."""

import struct
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from bns.errors import BnsError, FormatError, MissingDependencyError, install
from bns.storage import reading

STAMPS = ("log_time", "publish_time")  # [ns], of the message itself


def samples(
    path: Path, columns: Mapping[str, str], *, clock: str, stamped: str = ""
) -> dict[str, np.ndarray]:
    """Fields at the moments of one topic's messages.

    Args:
        path: of the MCAP file.
        columns: by channel, ``/topic:field.of.message``, or one of `STAMPS` for the
            clock topic's own stamps.
        clock: the channel whose topic gives the moments; the other topics' last
            message before each holds, NaN before the first.

    Returns:
        One array per channel, all of the same length.

    Raises:
        MissingDependencyError: the package `mcap` (or what decodes its messages).
        FormatError: no such file, no MCAP, a topic or field missing.
        BnsError: a column that is not written as above.
    """
    places = {
        name: _place(name, text)
        for name, text in columns.items()
        if text not in STAMPS or name == clock
    }
    logs = messages(path, {topic for topic, _ in places.values()})
    moments = np.array([stamps[0] for stamps, _ in logs[places[clock][0]]], float)
    arrays = {}
    for name, text in columns.items():
        if text in STAMPS:
            index = STAMPS.index(text)
            log = logs[places[clock][0]]
            first = log[0][0][index]  # exact in nanoseconds, before it is a float
            arrays[name] = np.array([stamps[index] - first for stamps, _ in log], float)
            continue
        topic, field = places[name]
        log = logs[topic]
        values = np.array([_field(message, field, path) for _, message in log])
        when = np.array([stamps[0] for stamps, _ in log], float)
        last = np.searchsorted(when, moments, side="right") - 1
        arrays[name] = np.where(last >= 0, values[last], np.nan)
        if topic == places[clock][0]:
            arrays[name] = values
        if name == stamped:
            index = STAMPS.index(columns["time"])
            zero = logs[places[clock][0]][0][0][index]
            own = np.array([stamps[index] - zero for stamps, _ in log], float)
            arrays["command_time"] = np.where(last >= 0, own[last], np.nan)
    return arrays


def _place(name: str, text: str) -> tuple[str, tuple[str, ...]]:
    topic, colon, field = text.partition(":")
    if not (topic and colon and field):
        raise BnsError(
            f"{name} = {text!r} is no field of an MCAP log: write /topic:field, or "
            f"for the time {' or '.join(STAMPS)}."
        )
    return topic, tuple(field.split("."))


def messages(path: Path, wanted: set[str]) -> dict[str, list]:
    """Per topic, in order of log time: ((log time, publish time) [ns], message).

    Raises:
        MissingDependencyError: the package `mcap`, or what decodes its messages.
        FormatError: no such file, no MCAP, or a topic without messages.
    """
    make_reader, broken = _mcap()
    found: dict[str, list] = {topic: [] for topic in wanted}
    decoders: dict[int, Callable[[bytes], Any]] = {}
    try:
        with reading.regular(path) as file:
            reader = make_reader(file, validate_crcs=True)
            _small(reader.get_summary(), path)
            log = reader.iter_messages(topics=sorted(wanted))
            for schema, channel, message in log:
                if channel.id not in decoders:
                    decoders[channel.id] = _decoder(schema, channel)
                stamps = (message.log_time, message.publish_time)
                value = decoders[channel.id](message.data)
                found[channel.topic].append((stamps, value))
    except BnsError:
        raise
    except broken as error:
        raise FormatError(f"{path} cannot be read as MCAP: {error}.") from error
    for topic, heard in found.items():
        if not heard:
            raise FormatError(f"{path} has no message on the topic {topic!r}.")
    return found


def _mcap() -> tuple[Callable[..., Any], tuple[type[Exception], ...]]:
    """What reads a log; what damaged records, and chunks in their compressions, raise.

    Raises:
        MissingDependencyError: the package `mcap`.
    """
    try:
        from mcap.exceptions import McapError
        from mcap.reader import make_reader
    except ImportError:
        raise MissingDependencyError(
            "Reading MCAP logs", "the package mcap", install("mcap")
        ) from None
    broken = (*reading.UNREADABLE, struct.error, McapError)
    try:
        from zstandard import ZstdError
    except ImportError:
        return make_reader, broken
    return make_reader, (*broken, ZstdError)


def _small(summary: Any, path: Path) -> None:
    """Stop at a log whose chunks claim too much.

    Raises:
        FormatError: they do.
    """
    chunks = summary.chunk_indexes if summary else ()
    claimed = sum(chunk.uncompressed_size for chunk in chunks)
    if claimed > reading.DATA:
        raise FormatError(
            f"{path} claims {reading.size(claimed)}, {reading.size(reading.DATA)} is "
            "the most that is unpacked."
        )


def _decoder(schema: Any, channel: Any) -> Callable[[bytes], Any]:
    if channel.message_encoding == "json":
        return lambda data: reading.json(data, f"A message on {channel.topic}")
    try:
        from mcap_ros2.decoder import DecoderFactory
    except ImportError:
        raise MissingDependencyError(
            f"Decoding {channel.message_encoding!r} messages on {channel.topic}",
            "the package mcap-ros2-support",
            install("mcap"),
        ) from None
    decoder = DecoderFactory().decoder_for(channel.message_encoding, schema)
    if decoder is None:
        raise FormatError(
            f"Messages on {channel.topic} are {channel.message_encoding!r}; JSON and "
            "ROS 2 (cdr) are understood."
        )
    return decoder


def _field(message: Any, names: tuple[str, ...], path: Path) -> float:
    """A number inside a message; objects and dictionaries are looked into alike."""
    value = message
    for name in names:
        known = value if isinstance(value, dict) else getattr(value, "__dict__", {})
        if isinstance(value, dict) and name in value:
            value = value[name]
        elif not isinstance(value, dict) and hasattr(value, name):
            value = getattr(value, name)
        else:
            raise FormatError(
                f"{path} has no field {'.'.join(names)!r}; at {name!r} there are "
                f"{', '.join(sorted(known)) or 'none'}."
            )
    if value is None:
        return float("nan")
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise FormatError(f"{path}: field {'.'.join(names)!r} holds {value!r}.")
    return float(value)


def topics(path: Path) -> dict[str, tuple[str, int]]:
    """The topics of a log that have messages, each with the name of its schema and how
    many messages it has; 1 if the file does not say.

    Raises:
        MissingDependencyError: the package `mcap`.
        FormatError: no such file, or no MCAP.
    """
    make_reader, broken = _mcap()
    try:
        with reading.regular(path) as file:
            found = make_reader(file, validate_crcs=True).get_summary()
    except BnsError:
        raise
    except broken as error:
        raise FormatError(f"{path} cannot be read as MCAP ({error}).") from None
    if found is None:
        raise FormatError(f"{path} has no summary: mend it with `mcap recover`.")
    names = {number: schema.name for number, schema in found.schemas.items()}
    said = found.statistics
    made: dict[str, tuple[str, int]] = {}
    for number, channel in found.channels.items():
        count = said.channel_message_counts.get(number, 0) if said else 1
        if count:
            others = made[channel.topic][1] if said and channel.topic in made else 0
            made[channel.topic] = names.get(channel.schema_id, ""), count + others
    return made
