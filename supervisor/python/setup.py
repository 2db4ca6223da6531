"""Adds the version and the structs of all topics, which the executable of firsthand prints, and their stubs.

It is the one that FIRSTHAND names, or is in target/release or target/debug of this repository, or on PATH.
"""

import ctypes
import enum
import os
import shutil
import subprocess
import types
from pathlib import Path

from setuptools import setup
from setuptools.command.build_py import build_py

TARGET = Path(__file__).resolve().parents[2] / "target"
FOUND = [os.environ.get("FIRSTHAND"), TARGET / "release/firsthand", TARGET / "debug/firsthand", shutil.which("firsthand")]
EXECUTABLE = next((path for path in FOUND if path and Path(path).is_file()), None)
if EXECUTABLE is None:
    raise SystemExit("no firsthand executable; run `cargo build -p firsthand`, or name one with FIRSTHAND=")


def said(*arguments):
    return subprocess.run([EXECUTABLE, *arguments], check=True, capture_output=True, text=True).stdout


def python(kind):
    """The type that a field of the kind has in Python."""
    if issubclass(kind, ctypes.Array):
        return "builtins.bytes" if kind._type_ is ctypes.c_char else f"ctypes.Array[{ctyped(kind._type_)}]"
    if issubclass(kind, ctypes.Structure):
        return kind.__name__
    return "float" if kind in (ctypes.c_float, ctypes.c_double) else "int"


def ctyped(kind):
    # Names of ctypes differ by machine, and its stubs know those that the text of the module uses.
    return kind.__name__ if issubclass(kind, ctypes.Structure) else f"ctypes.{kind.__name__}"


HEAD = """\
import builtins
import ctypes
import enum
from collections.abc import Iterator
from typing import Any, Literal, Protocol, TypeVar, overload

from .samples import Sliced

_S = TypeVar("_S", bound=Struct)

class Struct(ctypes.Structure):
    def copy(self: _S) -> _S: ...

TOPICS: dict[str, tuple[type[Struct], Any]]

def places() -> list[str]: ...

class Follower:
    robot: str
    node: Any
    topics: dict[str, tuple[type[Struct], Any]]
    def __init__(self, robot: str = ..., topics: tuple[str, ...] | list[str] = ..., name: str = ...) -> None: ...
    def __iter__(self) -> Iterator[tuple[str, Any]]: ...
    def publish(self, topic: str, sample: Struct) -> None: ...
    @property
    def directory(self) -> str: ...
    def _wait_for(self, listener: Any) -> Any: ...
    def _take(self, subscribers: Any) -> Iterator[tuple[str, Any]]: ...
    def _instance(self) -> str | None: ...
    def _supervised(self) -> bool: ...
    def _join(self, instance: str) -> Any: ...
"""


def stubs(text):
    module = types.ModuleType("topics")
    exec(text, module.__dict__)
    lines = [HEAD]
    for name, it in vars(module).items():
        if isinstance(it, type) and issubclass(it, enum.IntEnum) and it is not enum.IntEnum:
            lines += [f"class {name}(enum.IntEnum):", *(f"    {value.name} = {value.value}" for value in it)]
        elif isinstance(it, type) and issubclass(it, module.Struct) and it is not module.Struct:
            fields = [(field, python(kind)) for field, kind in it._fields_]
            lines += [f"class {name}(Struct):", *(f"    {field}: {kind}" for field, kind in fields)]
            lines += [f"    def __init__(self, {', '.join(f'{field}: {kind} = ...' for field, kind in fields)}) -> None: ..."]
            lines += ["    @staticmethod", "    def type_name() -> str: ..."]
    topics = ", ".join(f'"{topic}"' for topic in module.TOPICS)
    lines += [f"Topic = Literal[{topics}]", "class Follow(Protocol):"]
    for topic, (payload, element) in module.TOPICS.items():
        sample = payload.__name__ if element is None else f"Sliced[{payload.__name__}]"
        parameters = f'self, robot: str, topic: Literal["{topic}"], /, *, events: Literal[False] = ..., name: str = ...'
        lines += ["    @overload", f"    def __call__({parameters}) -> Iterator[{sample}]: ..."]
    for parameters in ["topic: Topic, other: Topic, /, *topics: Topic, events: bool = ...", "*topics: Topic, events: Literal[True]"]:
        lines += ["    @overload", f"    def __call__(self, robot: str, {parameters}, name: str = ...) -> Iterator[tuple[str, Any]]: ..."]
    return "\n".join(lines) + "\n"


class Build(build_py):
    def run(self):
        super().run()
        package = Path(self.build_lib) / "firsthand"
        text = said("topic", "list", "--python")
        (package / "topics.py").write_text(text)
        (package / "topics.pyi").write_text(stubs(text))


setup(version=said("--version").split()[1], cmdclass={"build_py": Build})
