"""Calls `effigy bench` and reads its figures."""

import argparse
import json
import pathlib
import statistics
import subprocess
import tempfile
import time

ROOT = pathlib.Path(__file__).resolve().parents[2]


def arguments(description):
    parser = argparse.ArgumentParser(description=description)
    parser.add_argument("--effigy", default=str(ROOT / "target/release/effigy"))
    parser.add_argument("--rounds", type=int, default=3)
    return parser


def bench(effigy, part, *more):
    """Milliseconds by name."""
    with tempfile.TemporaryDirectory() as folder:
        report = pathlib.Path(folder) / "bench.json"
        command = [effigy, "bench", "--only", part, "--json", str(report), *more]
        subprocess.run(command, check=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        rows = json.loads(report.read_text())["rows"]
    return {row["name"]: row["value"] for row in rows if row["unit"] == "ms"}


def timed(step, count):
    """A function that takes the median milliseconds of so many calls, after one that warms up."""

    def milliseconds():
        step()
        seconds = []
        for _ in range(count):
            start = time.perf_counter()
            step()
            seconds.append(time.perf_counter() - start)
        return 1e3 * statistics.median(seconds)

    return milliseconds


def compare(rounds, ours, peers):
    """Runs all in turn; `ours()` gives milliseconds by name, each of `peers` is (its name, ours' name, function)."""
    seen = [(ours(), {name: call() for name, _, call in peers}) for _ in range(rounds)]
    print("| what | Effigy, ms | peer | peer, ms | ratio, median of %d |" % rounds)
    print("|---|---|---|---|---|")
    for name, of_ours, _ in peers:
        us = [mine[of_ours] for mine, _ in seen]
        them = [theirs[name] for _, theirs in seen]
        ratio = statistics.median(b / a for a, b in zip(us, them))
        middle = statistics.median
        print(f"| {of_ours} | {middle(us):.2f} | {name} | {middle(them):.2f} | {ratio:.2f} |")
