"""Manners: other threads go on, Ctrl-C stops within a second, progress, threads, forks, and no panic."""

from __future__ import annotations

import multiprocessing
import os
import random
import signal
import subprocess
import sys
import textwrap
import threading
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest
from conftest import PROGRAM, sheet

import lloydar
from lloydar import _tasks

SCAN = sheet(300)


def interrupted(code: str, after: float) -> tuple[float, str]:
    """Runs `code` in a process, sends it SIGINT, and returns how long it took to end and what it printed.

    The code prints "ready" before its work.
    """
    # A shell may have started this process with SIGINT ignored, which children inherit.
    code = "import signal; signal.signal(signal.SIGINT, signal.default_int_handler)\n" + textwrap.dedent(code)
    with subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None and process.stdout.readline() == "ready\n"
        time.sleep(after)
        process.send_signal(signal.SIGINT)
        start = time.perf_counter()
        said = process.stdout.read()
        took = time.perf_counter() - start
    assert process.returncode == 0, said
    return took, said


@pytest.mark.parametrize("after", [0.0, 0.1, 0.4, 0.9])
def test_an_interruption_ends_the_work_in_memory_within_a_second(after: float) -> None:
    code = """
        import lloydar, numpy as np, os
        scan = np.random.default_rng(0).uniform(0, 2, (3_000_000, 3)) * [1, 1, 0]
        try:
            print("ready", flush=True)
            lloydar.resample(scan, count=200_000)
        except KeyboardInterrupt:
            print("interrupted", flush=True)
        os._exit(0)
    """
    took, said = interrupted(code, after)
    assert said == "interrupted\n" and took < 1


@pytest.fixture(scope="module")
def larger_street(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return lloydar.simulate(tmp_path_factory.mktemp("street"), points="600K", length=50)[0].parent


def test_an_interrupted_job_ends_within_a_second_and_is_continued(
    larger_street: Path, tmp_path: Path
) -> None:
    def run(output: Path) -> str:
        options = "count='60K', memory='300MiB', threads=2"
        return f"lloydar.run({str(larger_street)!r}, {str(output)!r}, {options})"

    even, whole = tmp_path / "even.laz", tmp_path / "whole.laz"
    code = """
        import lloydar, os
        try:
            print("ready", flush=True)
            {run}
        except KeyboardInterrupt:
            print("interrupted", flush=True)
        os._exit(0)
    """
    moments = random.Random(7)
    for _ in range(4):
        took, said = interrupted(code.format(run=run(even)), moments.uniform(0, 2))
        assert took < 1
        if said != "interrupted\n":
            break
        assert not even.exists()
    exec(run(even) if not even.exists() else "", {"lloydar": lloydar})
    exec(run(whole), {"lloydar": lloydar})
    assert even.read_bytes() == whole.read_bytes()
    assert not Path(f"{even}.job").exists()


def test_a_job_continues_in_the_process_in_which_it_was_interrupted(
    larger_street: Path, tmp_path: Path
) -> None:
    class Enough(Exception):
        pass

    def stop(progress: lloydar.Progress) -> None:
        if progress.stage == "solve":
            raise Enough

    output = tmp_path / "even.laz"
    with pytest.raises(Enough):
        lloydar.run(larger_street, output, count="40K", progress=stop)
    assert not output.exists()
    assert lloydar.run(larger_street, output, count="40K").output.exists()


def test_the_command_stops_at_an_interruption(larger_street: Path, tmp_path: Path) -> None:
    words = [PROGRAM, "run", larger_street, "-o", tmp_path / "even.laz", "--count", "200K", "--quiet"]
    process = subprocess.Popen(list(map(str, words)), stderr=subprocess.DEVNULL)
    time.sleep(1)
    process.send_signal(signal.SIGINT)
    start = time.perf_counter()
    assert process.wait(5) == 130 and time.perf_counter() - start < 1.2
    measuring = subprocess.Popen([PROGRAM, "measure", larger_street], stdout=subprocess.DEVNULL)
    time.sleep(0.5)
    measuring.send_signal(signal.SIGINT)
    assert measuring.wait(1) == -signal.SIGINT


def test_an_exception_of_the_callable_ends_the_work_and_is_raised() -> None:
    raised_at = 0.0

    class Enough(Exception):
        pass

    def stop(progress: lloydar.Progress) -> None:
        nonlocal raised_at
        raised_at = time.perf_counter()
        raise Enough(progress.stage)

    with pytest.raises(Enough, match="resample"):
        lloydar.resample(sheet(1000), count=50_000, progress=stop)
    assert time.perf_counter() - raised_at < 1


def test_progress_does_not_fall_and_comes_in_the_thread_of_the_caller() -> None:
    shares: list[float] = []
    threads: set[int] = set()

    def note(progress: lloydar.Progress) -> None:
        shares.append(progress.share)
        threads.add(threading.get_ident())

    lloydar.resample(SCAN, count=10_000, progress=note)
    assert shares == sorted(shares) and shares[-1] == 1
    assert threads == {threading.get_ident()}


def test_a_bar_is_shown_with_tqdm_and_lines_are_logged_without(
    capsys: pytest.CaptureFixture[str],
    caplog: pytest.LogCaptureFixture,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    lloydar.resample(SCAN, count=5000, progress=True)
    assert "resample" in capsys.readouterr().err
    monkeypatch.setitem(sys.modules, "tqdm.auto", None)
    with caplog.at_level("INFO", "lloydar"):
        lloydar.resample(SCAN, count=5000, progress=True)
    assert "resample: 100 %" in caplog.text


def test_other_threads_of_python_go_on() -> None:
    # With one worker there is a core for the counter, if the machine has two.
    steps = 0
    counting = threading.Event()

    def count() -> None:
        nonlocal steps
        while counting.is_set():
            steps += 1

    def pace(work) -> float:
        nonlocal steps
        steps = 0
        start = time.perf_counter()
        work()
        return steps / (time.perf_counter() - start)

    counting.set()
    thread = threading.Thread(target=count)
    thread.start()
    try:
        alone = pace(lambda: time.sleep(0.5))
        beside = pace(lambda: lloydar.resample(SCAN, count=20_000, threads=1))
    finally:
        counting.clear()
        thread.join()
    # A machine with other work is no place for the bar of nine tenths; a lock that is held leaves nothing.
    assert beside > 0.3 * alone


def test_several_threads_may_call_at_once() -> None:
    expected = lloydar.resample(SCAN, count=3000).points
    with ThreadPoolExecutor(6) as pool:
        clouds = list(pool.map(lambda _: lloydar.resample(SCAN, count=3000, threads=2), range(12)))
    assert all(np.array_equal(cloud.points, expected) for cloud in clouds)


def test_several_threads_may_measure_and_run_at_once(street: list[Path], tmp_path: Path) -> None:
    def job(number: int) -> tuple[bytes, lloydar.Measured]:
        output = lloydar.run(street, tmp_path / f"{number}.las", count=2000, threads=1).output
        return output.read_bytes(), lloydar.measure(output, against=street)

    with ThreadPoolExecutor(4) as pool:
        (cloud, measured), *others = pool.map(job, range(6))
    assert all(other == (cloud, measured) for other in others)


class Interrupted:
    """Work that was interrupted, and ends when it is told to."""

    def __init__(self) -> None:
        self.ended = threading.Event()

    def wait(self, seconds: float) -> bool:
        return self.ended.wait(seconds)


def test_several_threads_may_wait_for_interrupted_work(monkeypatch: pytest.MonkeyPatch) -> None:
    work = [Interrupted() for _ in range(3)]
    monkeypatch.setattr(_tasks, "_abandoned", list(work))
    with ThreadPoolExecutor(4) as pool:
        waiting = [pool.submit(_tasks.wait_for_abandoned) for _ in range(4)]
        for interrupted_work in work:
            time.sleep(0.1)
            interrupted_work.ended.set()
        for waiter in waiting:
            waiter.result(timeout=10)
    assert _tasks._abandoned == []


def points_in_child(queue: multiprocessing.Queue[bytes]) -> None:
    queue.put(lloydar.resample(SCAN, count=3000).points.tobytes())


@pytest.mark.skipif(not hasattr(os, "fork"), reason="there is no fork")
@pytest.mark.filterwarnings("ignore:.*multi-threaded.*fork:DeprecationWarning")
@pytest.mark.parametrize("method", ["fork", "spawn", "forkserver"])
def test_a_forked_process_gives_the_same_points(method: str) -> None:
    expected = lloydar.resample(SCAN, count=3000).points.tobytes()
    context = multiprocessing.get_context(method)
    queue: multiprocessing.Queue[bytes] = context.Queue()
    child = context.Process(target=points_in_child, args=(queue,))
    child.start()
    assert queue.get(timeout=60) == expected
    child.join()


def test_files_are_resampled_in_a_forked_process(street: list[Path], tmp_path: Path) -> None:
    lloydar.run(street, tmp_path / "parent.laz", count=3000)
    child = os.fork() if sys.version_info < (3, 12) else 0
    if sys.version_info >= (3, 12):
        pytest.skip("a fork of a process with threads warns")
    if child == 0:
        try:
            lloydar.run(street, tmp_path / "child.laz", count=3000)
        finally:
            os._exit(0)
    os.waitpid(child, 0)
    assert (tmp_path / "child.laz").read_bytes() == (tmp_path / "parent.laz").read_bytes()


@pytest.mark.parametrize("seed", range(25))
def test_no_cloud_however_strange_is_a_panic(seed: int) -> None:
    random = np.random.default_rng(seed)
    count = int(random.integers(1, 300))
    scan = random.normal(size=(count, 3)) * 10.0 ** random.integers(-9, 12, 3)
    scan[:, seed % 3] = random.choice([0.0, scan[0, 0]])
    scan[random.random(count) < 0.3] = scan[0]
    if seed % 5 == 0:
        scan = np.round(scan)
    density = [{"count": int(random.integers(1, 400))}, {"spacing": float(np.ptp(scan) / 7 + 1e-9)}]
    for options in [*density, {"ratio": float(random.random())}]:
        try:
            cloud = lloydar.resample(scan, **options)
        except lloydar.Error as error:
            assert isinstance(error, ValueError), error
        else:
            assert np.isfinite(cloud.points).all() and len(cloud) == len(cloud.source)
