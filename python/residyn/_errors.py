"""Errors about files that are Python's own classes as well; the compiled half raises them."""

import errno
import os
from typing import ClassVar

from ._residyn import ResidynError


class _OfFile(OSError):
    code: ClassVar[int]

    @classmethod
    def of_file(cls, message: str, path: str | os.PathLike[str]) -> "_OfFile":
        """The error with the message of the program, about a file."""
        return cls(cls.code, message, os.fspath(path))

    def __str__(self) -> str:
        # The message names the file already.
        return str(self.strerror)


class ResidynFileNotFoundError(_OfFile, FileNotFoundError, ResidynError):
    """A file or folder that does not exist."""

    code = errno.ENOENT


class ResidynPermissionError(_OfFile, PermissionError, ResidynError):
    """A file or folder that may not be read or written."""

    code = errno.EACCES


class ResidynIsADirectoryError(_OfFile, IsADirectoryError, ResidynError):
    """A folder where a file is expected."""

    code = errno.EISDIR
