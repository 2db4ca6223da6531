"""Recordings as NumPy arrays."""

from __future__ import annotations

import os
import re
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from mcap.records import Channel, Message, Metadata, Schema
from mcap.stream_reader import StreamReader
from numpy.typing import NDArray

from .samples import Sliced

Bytes = NDArray[np.uint8]
Run = tuple[int, int, int]
"""Offset in a message, offset in a struct, number of bytes."""

NUMBERS = {"uint8": "u1", "uint16": "u2", "uint32": "u4", "uint64": "u8", "int32": "i4", "int64": "i8", "float32": "f4", "float64": "f8"}


def _dtype(name: str, structs: dict[str, list[str]]) -> np.dtype[Any]:
    """Return the C struct of a message, by the definition in the recording, thus of the version that wrote it."""
    if name in NUMBERS:
        return np.dtype(NUMBERS[name])
    fields: list[Any] = []
    for line in structs[name]:
        match = re.fullmatch(r"([\w/]+?)(?:\[(\d*)\])? (\w+)", line)
        if match is None:
            raise ValueError(f"the recording has an unknown field: {line!r}")
        kind, length, field = match.groups()
        if kind == "uint8" and length:
            fields.append((field, f"S{length}"))
        elif length != "":
            element = _dtype(kind, structs)
            fields.append((field, element, (int(length),)) if length else (field, element))
    return np.dtype(fields, align=True)


def _runs(dtype: np.dtype[Any], at: int, into: int, runs: list[Run]) -> int:
    """Append the places of a struct's bytes in a message, whose numbers are aligned to their size. Return the end."""
    if dtype.subdtype is not None:
        element, count = dtype.subdtype[0], int(np.prod(dtype.shape))
        first: list[Run] = []
        start = at
        end = _runs(element, at, into, first)
        if len(first) == 1 and first[0][2] == element.itemsize:
            start = first[0][0]
            _add((start, into, count * element.itemsize), runs)
            return start + count * element.itemsize if count else at
        for number in range(count):
            at = _runs(element, at, into + number * element.itemsize, runs)
        return at
    if dtype.names is not None:
        for name in dtype.names:
            kind, offset = dtype.fields[name][:2]  # type: ignore[index]
            at = _runs(kind, at, into + offset, runs)
        return at
    if dtype.kind != "S":
        at += -at % dtype.itemsize
    _add((at, into, dtype.itemsize), runs)
    return at + dtype.itemsize


def _add(run: Run, runs: list[Run]) -> None:
    at, into, count = run
    if runs and (at, into) == (runs[-1][0] + runs[-1][2], runs[-1][1] + runs[-1][2]):
        at, into, before = runs.pop()
        count += before
    runs.append((at, into, count))


def _decoded(messages: Bytes, dtype: np.dtype[Any], at: int = 0) -> Bytes:
    """Return the bytes of each row's struct."""
    runs: list[Run] = []
    if _runs(dtype, at, 0, runs) > messages.shape[1]:
        raise ValueError("a message of the recording is shorter than its definition")
    into = np.zeros((len(messages), dtype.itemsize), np.uint8)
    for start, place, count in runs:
        into[:, place : place + count] = messages[:, start : start + count]
    return into


class Slices(Sequence["Sliced[Any]"]):
    """Samples of a topic with slices: `headers`, a structured array, and `slices[i]`, a header with its array."""

    def __init__(self, headers: NDArray[Any], element: np.dtype[Any], begin: int, messages: list[bytes]) -> None:
        self.headers = headers
        self._element, self._begin, self._messages = element, begin, messages

    def __len__(self) -> int:
        return len(self._messages)

    def __getitem__(self, index: Any) -> Any:
        if isinstance(index, slice):
            return Slices(self.headers[index], self._element, self._begin, self._messages[index])
        data = np.frombuffer(self._messages[index], np.uint8)
        begin = self._begin + 4
        count = int(data[self._begin : begin].view("<u4")[0])
        # The message may state any length, but each element takes at least a byte.
        if count > len(data) - begin:
            raise ValueError("a message of the recording is shorter than its definition")
        row = _decoded(data[None], np.dtype((self._element, (count,))), begin)
        return Sliced(self.headers[index], row.reshape(-1).view(self._element))

    def __repr__(self) -> str:
        return f"Slices({len(self)} of {self._element})"


class Recording(Mapping[str, Any]):
    """Topics of a recording: `recording["pose"]["x_m"]`.

    A topic is a structured array, whose first column `t_s` is mission time; one with slices is `Slices`. A topic is read when it is
    asked for, and then kept.
    """

    def __init__(self, path: str | os.PathLike[str]) -> None:
        where = Path(path)
        number = re.compile(r"recording(?:-(\d+))?\.mcap")
        found = [(int(match[1] or 1), where / match[0]) for name in (os.listdir(where) if where.is_dir() else []) if (match := number.fullmatch(name))]
        self.files = [file for _, file in sorted(found)] if where.is_dir() else [where]
        if not self.files:
            raise FileNotFoundError(f"no recording.mcap in {where}")
        self.run: dict[str, str] = {}
        """Robot, mission, seed, build, machine and run file."""
        self.is_complete = True
        """False if the recording is cut off, because the recorder was killed or its disk was full."""
        self._counts: dict[str, int] = {}
        for channel, schema, _ in self._messages():
            if schema.encoding == "ros2msg" and schema.name.startswith("firsthand/"):
                self._counts[channel.topic] = self._counts.get(channel.topic, 0) + 1
        self._read: dict[str, Any] = {}

    def _messages(self) -> Iterator[tuple[Channel, Schema, Message]]:
        for file in self.files:
            channels: dict[int, Channel] = {}
            schemas: dict[int, Schema] = {}
            begun = False
            with open(file, "rb") as stream:
                try:
                    for record in StreamReader(stream, validate_crcs=True).records:
                        if isinstance(record, Schema):
                            schemas[record.id] = record
                        elif isinstance(record, Channel):
                            channels[record.id] = record
                        elif isinstance(record, Metadata) and record.name == "run":
                            self.run = record.metadata
                        elif isinstance(record, Message):
                            begun = True
                            channel = channels[record.channel_id]
                            if channel.schema_id in schemas:
                                yield channel, schemas[channel.schema_id], record
                except Exception:
                    # The reader and its decompressors have no common error for data that end.
                    if not begun:
                        raise
                    self.is_complete = False

    def __iter__(self) -> Iterator[str]:
        return iter(self._counts)

    def __len__(self) -> int:
        return len(self._counts)

    def __repr__(self) -> str:
        return f"Recording({', '.join(f'{topic}: {count}' for topic, count in self._counts.items())})"

    def __getitem__(self, topic: str) -> Any:
        if topic not in self._counts:
            raise KeyError(topic)
        if topic not in self._read:
            self._read[topic] = self._topic(topic)
        return self._read[topic]

    def _topic(self, topic: str) -> Any:
        found = [(schema, message.data[4:]) for channel, schema, message in self._messages() if channel.topic == topic]
        messages = [data for _, data in found]
        own, *parts = found[0][0].data.decode().split("=" * 80 + "\n")
        lines = {"": own.splitlines()[1:]}
        for part in parts:
            name, *fields = part.splitlines()
            lines[name.removeprefix("MSG: ")] = fields
        has_slice = lines[""][-1].endswith("[] elements")
        header = _dtype(lines[""][0].split()[0] if has_slice else "", lines)
        runs: list[Run] = []
        end = _runs(header, 0, 0, runs)
        if any(len(data) < end for data in messages):
            raise ValueError(f"a message of {topic!r} is shorter than its definition")
        rows = np.frombuffer(b"".join(data[:end] for data in messages), np.uint8).reshape(len(messages), end)
        structs = _decoded(rows, header).reshape(-1).view(header)
        columns = [(name, header.fields[name][0]) for name in header.names]  # type: ignore[index, union-attr]
        array = np.zeros(len(messages), np.dtype((np.record, np.dtype([("t_s", "f8"), *columns], align=True))))
        array["t_s"] = structs["stamp"]["stamp_ns"] * 1e-9
        for name, _ in columns:
            array[name] = structs[name]
        if not has_slice:
            return array
        return Slices(array, _dtype(lines[""][-1].split("[")[0], lines), end + -end % 4, messages)


def recording(path: str | os.PathLike[str]) -> Recording:
    """Open the recording in a file, or all recordings in the directory of a run."""
    return Recording(path)
