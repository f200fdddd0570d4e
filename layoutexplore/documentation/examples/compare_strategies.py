"""A small benchmark from Python: three strategies, two buildings, and who needs how many metres."""

import csv
from pathlib import Path

from layoutexplore.benchmark.config import BenchmarkConfig
from layoutexplore.benchmark.runner import run_benchmark

if __name__ == "__main__":
    config = BenchmarkConfig(plans=("apartment:1-2",), agents=("nearest", "tour", "cost-utility"), starts=1)
    run_benchmark(config, Path("results"), jobs=1)
    with Path("results/results.csv").open() as file:
        for row in csv.DictReader(file):
            print(f"{row['plan']} {row['agent']}: {float(row['d95']):.0f} m to 95 %")
