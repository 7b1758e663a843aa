"""Batches of work on this machine's processes or on a dask cluster: the same answers either way, nothing lost.

A batch is a tuple of integers and a pure function of it and of what all batches share; results come back in the order of
the batches, whoever worked on them. What is done is kept in a file, so that a run that breaks off goes on from there.
"""

import hashlib
import os
import pickle
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, NamedTuple

from geometry.errors import InputError, UnavailableError
from planner.output import write_bytes

Batch = tuple[int, ...]
Work = Callable[[Any, Batch], Any]
Progress = Callable[[float], None]

# A batch of less than this costs more to hand out than to work on.
LEAST_BATCH_S = 0.1

# Starting a process and importing numpy and scipy there costs about a second: less work than this stays here.
WORTH_PROCESSES_S = 3.0

# Hand-outs of one batch before it is given up: each can meet a dying worker.
RETRIES = 5

# How often what is done is written, in batches.
SAVE_EVERY = 8

# Steps of one search that a checkpoint holds: pairs, sets, refinement with turbulence.
MOST_STEPS = 3

CONNECT_S = 10.0  # how long a scheduler has to answer

_shared: Any = None  # in a worker process: what all batches share


class How(NamedTuple):
    """Where batches are worked on."""

    scheduler: str | None = None  # address of a dask scheduler, such as tcp://host:8786
    processes: int | None = None  # default: one for each core; 1: this one
    checkpoint: Path | None = None  # file that keeps what is done
    progress: Progress | None = None  # called with the share that is done


def run(
    work: Work,
    shared: Any,
    batches: Sequence[Batch],
    *,
    how: How | None = None,
    expected_s: float = 0.0,
    known_as: str = "",
) -> list[Any]:
    """Work on all batches.

    Parameters
    ----------
    work
        A function of a module: what is shared and the batch -> the result; no state, no randomness.
    shared
        What every batch needs; sent once.
    batches
        The batches, all different.
    how
        Where.
    expected_s
        How long all of it takes on one core, about; short work stays in this process.
    known_as
        What tells `shared` from that of other work, for the checkpoint. Default: its own bytes, which has to be arrays,
        numbers and text then: those of a site differ from run to run.

    Returns
    -------
    list
        Results in the order of the batches.

    Raises
    ------
    UnavailableError
        If a scheduler is named and dask is not installed, or it does not answer.

    Examples
    --------
    >>> run(_times, 3, [(1,), (2,)])
    [3, 6]
    """
    chosen = how or How()
    key = _key(work, known_as or shared, batches) if chosen.checkpoint else ""
    done = _load(chosen.checkpoint, key)
    rest = [batch for batch in batches if batch not in done]
    for number, (batch, result) in enumerate(_worked(work, shared, rest, chosen, expected_s), start=1):
        done[batch] = result
        if chosen.checkpoint and (number % SAVE_EVERY == 0 or number == len(rest)):
            _save(chosen.checkpoint, key, done)
        if chosen.progress:
            chosen.progress(len(done) / len(batches))
    return [done[batch] for batch in batches]


def _times(shared: int, batch: Batch) -> int:
    """For the example."""
    return shared * batch[0]


def _worked(
    work: Work, shared: Any, batches: list[Batch], how: How, expected_s: float
) -> Iterator[tuple[Batch, Any]]:
    if how.scheduler is not None:
        return _on_cluster(work, shared, batches, how.scheduler)
    processes = how.processes or os.cpu_count() or 1
    if processes == 1 or len(batches) < 2 or expected_s < WORTH_PROCESSES_S:
        return ((batch, work(shared, batch)) for batch in batches)
    return _in_processes(work, shared, batches, processes)


def _in_processes(
    work: Work, shared: Any, batches: list[Batch], processes: int
) -> Iterator[tuple[Batch, Any]]:
    """Results as they come; when a worker dies its batches are handed out again."""
    from concurrent.futures import ProcessPoolExecutor, as_completed
    from concurrent.futures.process import BrokenProcessPool
    from multiprocessing import get_context

    rest = list(batches)
    with TemporaryDirectory() as folder:
        # in a file: a pipe to a child that dies before it reads is never written to its end
        file = Path(folder) / "shared"
        file.write_bytes(pickle.dumps(shared))
        for _ in range(RETRIES):
            with ProcessPoolExecutor(
                min(processes, len(rest)), get_context("spawn"), _receive, (str(file),)
            ) as pool:
                futures = {pool.submit(_work_on_shared, work, batch): batch for batch in rest}
                with suppress(BrokenProcessPool):
                    for future in as_completed(futures):
                        result = future.result()
                        rest.remove(futures[future])
                        yield futures[future], result
            if not rest:
                return
    raise UnavailableError(
        f"the processes of this search died {RETRIES} times; a script needs the usual `if __name__ == '__main__':` around "
        "what it calls, and memory may be short"
    )


def _receive(file: str) -> None:
    global _shared
    _shared = pickle.loads(Path(file).read_bytes())


def _work_on_shared(work: Work, batch: Batch) -> Any:
    return work(_shared, batch)


def require_scheduler(address: str) -> None:
    """Meet a dask scheduler, whether or not the work will need it.

    Raises
    ------
    UnavailableError
        If dask is not installed, or it does not answer.
    """
    _client(address).close()


def _client(address: str) -> Any:
    try:
        from distributed import Client
    except ImportError:
        raise UnavailableError(
            "--scheduler needs dask, which is not installed: pip install '.[cluster]'"
        ) from None
    try:
        return Client(address, timeout=CONNECT_S)  # type: ignore[no-untyped-call]
    except (OSError, ValueError) as error:
        raise UnavailableError(
            f"no dask scheduler answers at {address} ({error}); start one with `dask scheduler` and give its tcp:// address"
        ) from error


def _on_cluster(work: Work, shared: Any, batches: list[Batch], address: str) -> Iterator[tuple[Batch, Any]]:
    """Results as they come from a dask cluster; a batch whose worker dies is worked on by another."""
    with _client(address) as client:
        from distributed import as_completed

        # not scattered: what is scattered to one worker dies with it
        sent = client.submit(_give, pickle.dumps(shared), pure=False, retries=RETRIES)
        futures = {
            client.submit(_work_on_sent, work, sent, batch, retries=RETRIES, pure=False): batch
            for batch in batches
        }
        for future in as_completed(list(futures)):  # type: ignore[no-untyped-call]
            yield futures[future], future.result()


def _give(data: bytes) -> Any:
    return pickle.loads(data)


def _work_on_sent(work: Work, shared: Any, batch: Batch) -> Any:
    return work(shared, batch)


def _key(work: Work, shared: Any, batches: Sequence[Batch]) -> str:
    """What a checkpoint has to be of: the same work, shared data and batches."""
    parts = (work.__module__, work.__qualname__, shared, list(batches))
    return hashlib.sha256(pickle.dumps(parts)).hexdigest()


def _load(path: Path | None, key: str) -> dict[Batch, Any]:
    """What an earlier run has done of this work; nothing if the file is of other work."""
    return dict(_parts(path).get(key, {}))


def _parts(path: Path | None) -> dict[str, dict[Batch, Any]]:
    """The steps of a search by key, oldest first. The file is this program's own."""
    if path is None or not path.is_file():
        return {}
    try:
        return dict(pickle.loads(path.read_bytes()))
    except (
        pickle.UnpicklingError,
        EOFError,
        AttributeError,
        ImportError,
        IndexError,
        TypeError,
        ValueError,
    ) as error:
        raise InputError(
            f"{path}: the progress file cannot be read ({error}); remove it to start anew"
        ) from error


def _save(path: Path, key: str, done: dict[Batch, Any]) -> None:
    """Add what is done to the file; a search has few steps, and of what is older nothing is kept."""
    others = [item for item in _parts(path).items() if item[0] != key]
    write_bytes(path, pickle.dumps(dict([*others[-(MOST_STEPS - 1) :], (key, done)])))
