"""The exceptions and warnings of splatblur."""

from __future__ import annotations

from os import PathLike, fspath
from typing import Any

from . import _native


class SplatblurError(Exception):
    """The base of all exceptions that splatblur defines.

    Attributes:
        message: The whole text.
        file: The file that is wrong, or `None`.
        line: The line in it, from 1, or `None`.
        column: The column in it, in characters, from 1, or `None`.
        field: The value that is wrong, as in `objects[2].opacity`, or `None`.
        found: What was found there, or `None`.
        expected: What would be right, or `None`.
    """

    def __init__(
        self,
        message: str,
        *,
        file: str | PathLike[str] | None = None,
        line: int | None = None,
        column: int | None = None,
        field: str | None = None,
        found: str | None = None,
        expected: str | None = None,
    ) -> None:
        super().__init__(message)
        self.message = message
        self.file = None if file is None else fspath(file)
        self.line = line
        self.column = column
        self.field = field
        self.found = found
        self.expected = expected


class InvalidValue(SplatblurError, ValueError):
    """A value is out of its bounds, or an array has a wrong shape. `field`, `found` and `expected` say which."""


class SceneError(SplatblurError, ValueError):
    """A scene file was refused. `file`, `line`, `found` and `expected` say where and why."""


class ModelError(SplatblurError, ValueError):
    """A model was refused. `file`, `line`, `found` and `expected` say where and why."""


class ImageError(SplatblurError, ValueError):
    """A picture cannot be written or read."""


class RenderError(SplatblurError, RuntimeError):
    """A frame cannot be rendered: it needs too much memory, the device fails, or the scene holds what a mode cannot
    show."""


class ForkError(SplatblurError, RuntimeError):
    """splatblur was used before `fork`, and again in the child. Start workers by spawn."""


class NoteWarning(UserWarning):
    """A note of splatblur: what was estimated, dropped or ignored."""


class ForkedLazily:
    """What a forked process unpickled, which can do nothing there: what uses it raises `ForkError`. An error while
    unpickling would end a worker of a pool, and the pool would start another one for ever."""

    def __getattr__(self, name: str) -> Any:
        if name in ("_native", "native"):
            _native.check_fork()
        raise AttributeError(f"a {type(self).__name__} has no attribute {name!r}")


class Fixed:
    """A class that has the attributes it says: a name that is misspelt is an error, and not a new attribute."""

    _attributes: tuple[str, ...] = ()

    def __setattr__(self, name: str, value: object) -> None:
        own = type(self)
        if not (name.startswith("_") or name in self._attributes or hasattr(own, name)):
            settable = [word for word in dir(own) if getattr(getattr(own, word), "fset", None) is not None]
            known = ", ".join(sorted([*self._attributes, *settable]))
            raise AttributeError(f"a {own.__name__} has no attribute {name!r} that can be set (there are: {known})")
        object.__setattr__(self, name, value)


def invalid(field: str, found: object, expected: str) -> InvalidValue:
    """The exception that says what a value is and what it should be."""
    return InvalidValue(
        f"`{field}` is {found}, expected {expected}", field=field, found=str(found), expected=expected
    )
