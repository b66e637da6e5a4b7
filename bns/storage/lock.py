"""Who may write in a directory: one process at a time, all others are refused."""

import os
from contextlib import suppress
from pathlib import Path
from types import TracebackType

from bns.errors import BnsError
from bns.storage import files


class Lock:
    """Only one process writes in a directory.

    Taken before anything is written or computed, by whoever writes: a run, a campaign,
    a diagnosis. The directory is made for it; where it is still empty when the lock is
    released it goes again. The lock ends with the process, however that ends.

    Args:
        directory: to write in.
        make: make the directory where it is not there.
    """

    def __init__(self, directory: Path | str, *, make: bool = True):
        self.directory = Path(directory)
        self.make = make
        self._descriptor: int | None = None
        self._made: list[Path] = []

    def take(self) -> "Lock":
        """Keep other processes from writing here.

        Raises:
            BnsError: another process is writing here, or the place is a file.
            StorageError: the directory cannot be made.
        """
        while not self._taken():
            pass
        return self

    def release(self) -> None:
        """Let others write here; a directory made for nothing is removed."""
        if self._descriptor is None:
            return
        for path in self._made:
            with suppress(OSError):  # something is in it
                path.rmdir()
        self._made = []
        os.close(self._descriptor)
        self._descriptor = None

    def __enter__(self) -> "Lock":
        return self if self.held else self.take()

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.release()

    @property
    def held(self) -> bool:
        """Whether this process may write."""
        return self._descriptor is not None

    def _taken(self) -> bool:
        """Try once; False where the directory was removed meanwhile."""
        if self.make:
            self._make()
        try:
            descriptor = os.open(self.directory, os.O_RDONLY)
        except FileNotFoundError:
            if self.make:
                return False
            raise BnsError(f"There is no directory {self.directory}.") from None
        except OSError as error:
            raise files.storage_error(self.directory, error) from error
        if os.name == "posix" and not self._locked(descriptor):
            os.close(descriptor)
            return False
        self._descriptor = descriptor
        return True

    def _locked(self, descriptor: int) -> bool:
        """Lock what is open; False where it is no longer the directory of that name."""
        import fcntl

        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError as error:
            os.close(descriptor)
            raise BnsError(
                f"{self.directory} is being written by another process: "
                "wait for it, or give another --out."
            ) from error
        try:
            named, opened = os.stat(self.directory), os.fstat(descriptor)
        except FileNotFoundError:
            return False
        return (named.st_dev, named.st_ino) == (opened.st_dev, opened.st_ino)

    def _make(self) -> None:
        """Make the directory and its parents; remember which, the innermost first."""
        if self.directory.exists():
            if not self.directory.is_dir():
                raise BnsError(f"{self.directory} is a file: give another --out.")
            return
        absent = [self.directory]
        absent += [path for path in self.directory.parents if not path.exists()]
        files.make_directory(self.directory)
        self._made = absent
