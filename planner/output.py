"""Whole files or none: results appear complete under their names, or not at all.

A file is written beside its place and moved there in one step, so a reader, or a run that breaks off, never
sees half of it. A run that writes a folder builds it aside and moves its files when all of them are there.

What is there already: a file of the same name is replaced, since a second run of the same plan is the usual
case; other files in the folder are never touched. What must not be replaced (a site file that someone
has edited) is written with `new_text`.
"""

import os
import shutil
import signal
import tempfile
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from geometry.errors import InputError


@contextmanager
def output_folder(folder: Path, *, within: Path | None = None) -> Iterator[Path]:
    """Collect the files of one run and put them into a folder together.

    Parameters
    ----------
    folder : Path
        Where the files go; made when the run has succeeded.
    within
        Where they are collected, on the same disk; default: above the folder. What a run that was killed left
        there can be removed with it.

    Yields
    ------
    Path
        An empty folder to write into. If the block raises, it is removed and nothing else has changed.

    Raises
    ------
    InputError
        If the folder cannot be written to: said before the block runs.
    """
    require_folder(folder)
    parent = _nearest_folder(folder) if within is None else within
    try:
        parent.mkdir(parents=True, exist_ok=True)
        staging = Path(tempfile.mkdtemp(prefix=f".{folder.name}-", dir=parent))
    except OSError as error:
        raise _refusal(folder, error) from error
    try:
        yield staging
        _move_all(staging, folder)
    finally:
        shutil.rmtree(staging, ignore_errors=True)


def require_folder(folder: Path) -> None:
    """Refuse a folder for results that cannot be made or written to, before any work is done for it.

    Raises
    ------
    InputError
        If it, or what stands in its place above it, is a file or closed to writing. Nothing is left behind.
    """
    place = folder if folder.is_dir() else _nearest_folder(folder)
    try:
        Path(tempfile.mkdtemp(prefix=f".{folder.name}-", dir=place)).rmdir()
    except OSError as error:
        raise _refusal(folder, error) from error


def write_text(path: Path, text: str) -> None:
    """Write a text file in UTF-8, whole or not at all; replaces a file of that name.

    Raises
    ------
    InputError
        If it cannot be written.
    """
    write_bytes(path, text.encode("utf-8"))


def write_bytes(path: Path, data: bytes) -> None:
    """Write a file, whole or not at all; replaces a file of that name.

    Raises
    ------
    InputError
        If it cannot be written.
    """
    with _sibling(path, data) as temporary:
        temporary.replace(path)


def new_text(path: Path, text: str) -> None:
    """Write a text file in UTF-8 that must not exist yet, whole or not at all.

    Raises
    ------
    InputError
        If something of that name exists, or it cannot be written.
    """
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        file = path.open("x", encoding="utf-8")
    except FileExistsError:
        hint = "It stays as it is: give another folder, or remove it first."
        raise InputError(f"{path}: something of that name exists already. {hint}") from None
    except OSError as error:
        raise _refusal(path, error) from error
    try:
        with file:
            file.write(text)
    except BaseException:
        path.unlink(missing_ok=True)
        raise


@contextmanager
def _sibling(path: Path, data: bytes) -> Iterator[Path]:
    """Yield a temporary file with the data, beside the path; gone at the end."""
    temporary: Path | None = None
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        handle, name = tempfile.mkstemp(prefix=f".{path.name}-", dir=path.parent)
        temporary = Path(name)
        with os.fdopen(handle, "wb") as file:
            file.write(data)
        temporary.chmod(0o666 & ~_umask())
        yield temporary
    except OSError as error:
        raise _refusal(path, error) from error
    finally:
        if temporary is not None:
            temporary.unlink(missing_ok=True)


def _move_all(staging: Path, folder: Path) -> None:
    files = sorted(path for path in staging.rglob("*") if path.is_file())
    places = [folder / path.relative_to(staging) for path in files]
    try:
        for place in places:  # every refusal that can be foreseen comes before the first move
            if place.is_dir():
                raise IsADirectoryError(21, "a folder of that name is in the way", str(place))
            place.parent.mkdir(parents=True, exist_ok=True)
        folder.mkdir(parents=True, exist_ok=True)
        with _uninterrupted():
            for path, place in zip(files, places, strict=True):
                path.replace(place)
    except OSError as error:
        raise _refusal(folder, error) from error


@contextmanager
def _uninterrupted() -> Iterator[None]:
    """Let Ctrl-C wait until a block is done: half of the files in place would be half a result."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    waiting: list[int] = []
    before = signal.signal(signal.SIGINT, lambda number, _: waiting.append(number))
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)
    if waiting:
        signal.raise_signal(signal.SIGINT)


def _nearest_folder(folder: Path) -> Path:
    """Find the nearest existing folder above a folder: on the same disk as the folder will be."""
    if folder.exists() and not folder.is_dir():
        raise InputError(f"{folder} is a file; a folder is needed for the results. Give another place.")
    above = next((parent for parent in folder.absolute().parents if parent.exists()), Path())
    if not above.is_dir():
        raise InputError(f"{folder} cannot be made: {above} is a file, not a folder. Give another place.")
    return above


def _umask() -> int:
    mask = os.umask(0)
    os.umask(mask)
    return mask


def _refusal(path: Path, error: OSError) -> InputError:
    return InputError(f"{path} cannot be written ({error.strerror or error}). Give another place.")
