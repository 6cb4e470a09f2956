"""Exceptions of biscale."""

from __future__ import annotations


class Error(Exception):
    """Base class of the exceptions of biscale."""


class InputError(Error, ValueError):
    """The input is wrong: where, what was found, and what was expected."""

    def __init__(
        self,
        message: str,
        *,
        file: str | None = None,
        field: str = "",
        found: str = "",
        expected: str = "",
        hint: str | None = None,
    ) -> None:
        super().__init__(message)
        self.file = file
        """The file, if the error is in one."""
        self.field = field
        """The key (``tile.geometry.depth``), the argument, or the place in the file (``line 12``)."""
        self.found = found
        """What stood there, in words."""
        self.expected = expected
        """What would have been valid, in words."""
        self.hint = hint
        """What would correct the input, if that is known."""

    def __reduce__(self) -> tuple[object, ...]:
        return (_input_error, (str(self), self.file, self.field, self.found, self.expected, self.hint))


def _input_error(
    message: str, file: str | None, field: str, found: str, expected: str, hint: str | None
) -> InputError:
    return InputError(message, file=file, field=field, found=found, expected=expected, hint=hint)


class Cancelled(Error):
    """A progress callback returned False."""


class DeviceError(Error, RuntimeError):
    """A GPU failed."""


class InternalError(Error, RuntimeError):
    """An error of biscale that is no fault of the input."""
