"""Fuzzing of every reader: damaged files are read, and each is taken or refused with an error of ours.

`python -m tests.files.fuzzing --inputs 60000 --seed 1` prints how many were tried, refused, accepted and
failed, by reader; with `--crafted`, files made by hand take the place of random damage. A failure is any
other exception, more than ten seconds of computing, or more than a gibibyte of memory; the files that failed
are kept in `--keep`.
"""

from __future__ import annotations

import argparse
import faulthandler
import random
import resource
import shutil
import signal
import tempfile
import time
import traceback
import warnings
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

from layoutexplore.errors import LayoutExploreError
from tests.files.command_targets import READERS
from tests.files.crafted import craft
from tests.files.mutators import mutate
from tests.files.targets import Target

SECONDS = 10
GIBIBYTE = 1 << 30


class TooSlow(BaseException):
    """An input took longer than it may."""


@dataclass
class Figures:
    """What became of the inputs of a reader."""

    tried: int = 0
    refused: int = 0
    accepted: int = 0
    failed: int = 0
    slowest: float = 0.0
    faults: Counter[str] = field(default_factory=Counter)


How = Callable[[Path, str, random.Random], str]
"""Damages a file of a kind; says which, or how."""


def at_random(path: Path, kind: str, rng: random.Random) -> str:
    """Damage a file by its structure or byte by byte."""
    path.write_bytes(mutate(path.read_bytes(), kind, rng))
    return path.name


def fuzz(name: str, inputs: int, seed: int, keep: Path | None = None, *, how: How = at_random) -> Figures:
    """Read so many damaged files of a reader."""
    target, figures, rng = READERS[name], Figures(), random.Random(f"{name} {seed}")
    with tempfile.TemporaryDirectory() as folder:
        whole, place = Path(folder) / "whole", Path(folder) / "place"
        whole.mkdir()
        target.write(whole)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            target.read(copied(whole, place))  # compiles; and what is whole is accepted
        for number in range(inputs):
            damaged = damage(target, copied(whole, place), rng, how)
            fault = attempt(target, place, figures)
            if fault and keep:
                figures.faults[fault] += 1
                kept = keep / f"{name.replace(' ', '-')}-{seed}-{number}"
                shutil.copytree(place, kept, dirs_exist_ok=True, symlinks=True)
                (kept / "fault.txt").write_text(f"{damaged}\n{fault}\n{LAST[0]}")
            elif fault:
                figures.faults[fault] += 1
    return figures


LAST = [""]


def copied(whole: Path, place: Path) -> Path:
    shutil.rmtree(place, ignore_errors=True)
    shutil.copytree(whole, place)
    return place


def damage(target: Target, folder: Path, rng: random.Random, how: How) -> str:
    """Damage one of the files of a folder."""
    pattern, kind = rng.choice(list(target.files.items()))
    return how(rng.choice(sorted(folder.glob(pattern))), kind, rng)


def attempt(target: Target, folder: Path, figures: Figures) -> str:
    """Read the files; what went wrong, or an empty text."""
    figures.tried += 1
    began = time.process_time()
    signal.setitimer(signal.ITIMER_PROF, SECONDS)
    faulthandler.dump_traceback_later(30 * SECONDS, exit=True)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            target.read(folder)
        figures.accepted += 1
        return ""
    except LayoutExploreError as error:
        figures.refused += 1
        if len(str(error)) > 3000 or not str(error):
            return failed(figures, error, "a message of another length")
        return ""
    except (Exception, TooSlow) as error:
        return failed(figures, error, type(error).__name__)
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0)
        faulthandler.cancel_dump_traceback_later()
        figures.slowest = max(figures.slowest, time.process_time() - began)


def failed(figures: Figures, error: BaseException, what: str) -> str:
    figures.failed += 1
    frames = traceback.extract_tb(error.__traceback__)
    LAST[0] = "".join(traceback.format_exception(error))[-6000:]
    ours = [f for f in frames if "site-packages" not in f.filename and "/lib/python" not in f.filename]
    return f"{what} in {Path(ours[-1].filename).name}:{ours[-1].lineno}: {str(error)[:80]!r}"


def stop(*_: object) -> None:
    raise TooSlow(f"more than {SECONDS} s")


def limit_memory() -> None:
    """Let this process take a gibibyte more than it has."""
    pages = int(Path("/proc/self/statm").read_text().split()[0])
    resource.setrlimit(resource.RLIMIT_AS, (pages * resource.getpagesize() + GIBIBYTE,) * 2)


def inputs_of(name: str, inputs: int, names: list[str]) -> int:
    """The share of a reader."""
    return max(round(inputs * READERS[name].share / sum(READERS[n].share for n in names)), 1)


def main() -> int:
    parser = argparse.ArgumentParser(description="Read damaged files.")
    parser.add_argument("--inputs", type=int, default=1000)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--readers", nargs="*", default=list(READERS), choices=list(READERS))
    parser.add_argument("--keep", type=Path)
    parser.add_argument("--crafted", action="store_true", help="files made by hand instead")
    options = parser.parse_args()
    signal.signal(signal.SIGPROF, stop)
    for name in options.readers:  # everything is loaded and compiled before memory is limited
        fuzz(name, 1, options.seed)
    limit_memory()
    total = 0
    print(f"{'reader':16} {'tried':>7} {'refused':>8} {'accepted':>9} {'failed':>7} {'slowest':>8}")
    for name in options.readers:
        inputs = inputs_of(name, options.inputs, options.readers)
        how = craft if options.crafted else at_random
        found = fuzz(name, inputs, options.seed, options.keep, how=how)
        total += found.failed
        numbers = f"{found.tried:7} {found.refused:8} {found.accepted:9} {found.failed:7}"
        print(f"{name:16} {numbers} {found.slowest:6.1f} s", flush=True)
        for fault, count in found.faults.most_common(12):
            print(f"    {count} x {fault}", flush=True)
    return min(total, 1)


if __name__ == "__main__":
    raise SystemExit(main())
