"""Scenes of files, in a form that can be pickled: workers read the file again."""

from __future__ import annotations

import os
import weakref
from typing import Any

from . import _native
from ._errors import ForkedLazily


class LoadedScene(ForkedLazily):
    """A scene file as it was read."""

    native: _native.Scene

    def __init__(self, path: str, size: tuple[int, int] | None, lenient: bool) -> None:
        self.key = (path, size, lenient)
        if not _native.is_forked():
            self.native = _native.Scene.load(path, size, lenient)
        self.stamp = _stamp(path)

    def __reduce__(self) -> tuple[Any, ...]:
        path, size, lenient = self.key
        return _again, (os.path.abspath(path), size, lenient)


_READ: weakref.WeakValueDictionary[Any, LoadedScene] = weakref.WeakValueDictionary()


def _stamp(path: str) -> tuple[int, int]:
    status = os.stat(path)
    return status.st_mtime_ns, status.st_size


def _again(path: str, size: tuple[int, int] | None, lenient: bool) -> LoadedScene:
    """The scene, read once for all objects that come from it."""
    key = (path, size, lenient)
    found = _READ.get(key)
    if found is None or found.stamp != _stamp(path):
        found = _READ[key] = LoadedScene(*key)
    return found
