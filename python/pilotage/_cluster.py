"""Calls of the command on a Dask cluster.

A call is its words, the files that it reads, and those that it writes. Which files it reads is found in its words and, as
quoted names, in the texts that they name. Files that several calls read go to each worker once, by their hash, and stay there
as long as it lives. A worker puts the files of a call into a folder, with the paths that they have here, so that the
command says there what it would say here.
"""

from __future__ import annotations

import hashlib
import os
import re
import shutil
import tempfile
import time
import uuid
import warnings
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from distributed import Client, Worker, WorkerPlugin, as_completed, get_worker

from . import _pilotage
from ._call import FOLDER
from ._errors import Error, Interrupted

# Files with names of others in quotes: problems, systems, models, systems of other tools.
TEXTS = {".toml", ".ssd", ".ssv", ".ssm", ".xml"}
# What tells that a folder is an unpacked FMU or SSP.
ROOTS = ("modelDescription.xml", "SystemStructure.ssd")
# How often a call is made that raised no error of pilotage; one whose worker died is made again by Dask itself.
RETRIES = 2


@dataclass(frozen=True)
class Call:
    """A call for a worker: words, working folder, hashes of its files by their paths, folders to make, and the contents that
    no other call needs, by hash."""

    words: list[str]
    folder: str
    files: dict[str, str]
    folders: list[str]
    contents: dict[str, bytes]
    version: str


@dataclass(frozen=True)
class Done:
    """What a call left: what native code gives, the files that it wrote, by their paths, and its time [s]."""

    left: _pilotage._Left
    written: dict[str, bytes]
    seconds: float


class Contents(WorkerPlugin):  # type: ignore[misc, unused-ignore]
    """A file for all workers, those that come later included."""

    def __init__(self, key: str, content: bytes) -> None:
        self.key, self.content = key, content

    def setup(self, worker: Worker) -> None:
        file = kept(worker, self.key)
        if not file.exists():
            part = file.with_suffix(f".{uuid.uuid4().hex}")
            part.write_bytes(self.content)
            part.replace(file)


def run(client: Client, every: Sequence[list[str]]) -> Iterator[tuple[int, Done | Exception]]:
    """Calls the command on the workers with each of these words; gives the number of a call and what it left, or why there is
    nothing, as they end. Those that have not begun are taken back when nobody asks for more."""
    store = Store()
    calls = [store.call(words) for words in every]
    uses = Counter(key for files in calls for key in set(files.values()))
    shared = {key for key, count in uses.items() if count > 1 or len(every) == 1}
    send(client, {key: store.contents[key] for key in shared})
    made = [
        Call(
            words,
            os.getcwd(),
            files,
            [folder for word in words for folder in folders(word)],
            {key: store.contents[key] for key in files.values() if key not in shared},
            _pilotage.version(),
        )
        for words, files in zip(every, calls, strict=True)
    ]
    study = uuid.uuid4().hex
    keys = [f"pilotage-{study}-{k}" for k in range(len(made))]
    with warnings.catch_warnings():
        # Files that one call alone needs travel with it.
        warnings.filterwarnings("ignore", message="Sending large graph")
        futures = client.map(perform, made, key=keys, pure=False, retries=RETRIES)
    numbers = {key: k for k, key in enumerate(keys)}
    try:
        for future in as_completed(futures):
            try:
                ended = future.result()
            except Exception as error:  # Of Dask, or of pilotage on the worker.
                yield numbers[future.key], error
                continue
            for path, content in ended.written.items():
                Path(path).parent.mkdir(parents=True, exist_ok=True)
                Path(path).write_bytes(content)
            yield numbers[future.key], ended
    except KeyboardInterrupt:
        raise Interrupted("stopped by Ctrl-C") from None
    finally:
        client.cancel(futures)


def send(client: Client, contents: dict[str, bytes]) -> None:
    """Gives all workers the files that they have not yet."""
    known = client.run_on_scheduler(lambda dask_scheduler: list(dask_scheduler.worker_plugins))
    for key, content in contents.items():
        name = f"pilotage-{key}"
        if name not in known:
            client.register_plugin(Contents(key, content), name=name)


def perform(call: Call) -> Done:
    """Makes a call on a worker."""
    if _pilotage.version() != call.version:
        raise Error(f"a worker has pilotage {_pilotage.version()}, and {call.version} calls it")
    begun = time.perf_counter()
    worker = get_worker()
    home = Path(worker.local_directory).resolve()
    with tempfile.TemporaryDirectory(prefix="call-", dir=home) as stage:
        for folder in [call.folder, *call.folders]:
            os.makedirs(stage + folder, exist_ok=True)
        for path, key in call.files.items():
            file = Path(stage + path)
            file.parent.mkdir(parents=True, exist_ok=True)
            if key in call.contents:
                file.write_bytes(call.contents[key])
            else:
                shutil.copyfile(kept(worker, key), file)
        words = [re.sub(r"(^|=)(?=/)", lambda own: own[0] + stage, word, count=1) for word in call.words]
        left = _pilotage.call(words, folder=stage + call.folder)
        files = [path for path in Path(stage).rglob("*") if path.is_file()]
        written = {str(path).removeprefix(stage): path for path in files}
        contents = {
            path: file.read_bytes().replace(stage.encode(), b"")
            for path, file in written.items()
            if path not in call.files
        }
    code, stdout, stderr, tables, texts = left
    found = [(name, text.replace(stage, "")) for name, text in texts]
    shown = code, stdout.replace(stage, ""), stderr.replace(stage, ""), tables, found
    return Done(shown, contents, time.perf_counter() - begun)


def kept(worker: Worker, key: str) -> Path:
    """Where a worker keeps a file."""
    folder = Path(worker.local_directory) / "pilotage"
    folder.mkdir(exist_ok=True)
    return folder / key


class Store:
    """Files that calls read, each read once here."""

    def __init__(self) -> None:
        self.contents: dict[str, bytes] = {}
        self._keys: dict[str, str] = {}
        self._named: dict[str, list[str]] = {}

    def call(self, words: Sequence[str]) -> dict[str, str]:
        """The files of a call: hashes by paths."""
        found: dict[str, str] = {}
        waiting = [path for word in words for path in named(endings(word), os.getcwd())]
        while waiting:
            path = waiting.pop()
            if path not in found:
                found[path] = self._key(path)
                waiting += self._named[path]
        return found

    def _key(self, path: str) -> str:
        if path not in self._keys:
            content = Path(path).read_bytes()
            key = hashlib.sha256(content).hexdigest()
            self.contents[key] = content
            self._keys[path] = key
            text = content.decode(errors="ignore") if Path(path).suffix in TEXTS else ""
            quoted = [own for sign in "\"'" for own in re.findall(f"{sign}([^{sign}\n]+){sign}", text)]
            self._named[path] = list(named(quoted, os.path.dirname(path)))
        return self._keys[path]


def endings(word: str) -> list[str]:
    """A word, and what stands after each `=` in it."""
    return [word] + [word[own.end() :] for own in re.finditer("=", word)]


def named(names: Sequence[str], folder: str) -> Iterator[str]:
    """The files among these names, and those in unpacked FMUs and SSPs."""
    for name in names:
        path = os.path.abspath(os.path.join(folder, name))
        if os.path.isfile(path):
            yield path
        elif any(os.path.isfile(os.path.join(path, root)) for root in ROOTS):
            yield from (str(file) for file in Path(path).rglob("*") if file.is_file())


def folders(word: str) -> Iterator[str]:
    """The folders into which a command with this word may write."""
    for own in endings(word):
        if own.startswith("/") and FOLDER in own:
            yield own if os.path.isdir(own) else os.path.dirname(own)


def slots(client: Client) -> int:
    """How many calls the workers make at once."""
    threads: dict[str, int] = client.nthreads()
    return max(1, sum(threads.values()))


def reason(error: Exception) -> Error:
    """Why a call left nothing."""
    if isinstance(error, Error):
        return error
    return Error(f"no worker came to an end with it: {error or type(error).__name__}")


def result(done: Done | Exception) -> Any:
    """What native code gave, or the error."""
    if isinstance(done, Exception):
        raise reason(done) from done
    return done.left
