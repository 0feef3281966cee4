#!/usr/bin/env python3
"""Fits a table of recordings as an array of jobs of Slurm.

    python many_units_slurm.py recordings.parquet results       # on the login node: queues what has no result

The table has the columns `label` and `path`. A task that is queued again skips the files that it has written.
"""

import argparse
import os
import subprocess
import sys
import tempfile

# A fit would start a thread for each core of the node, and Slurm gives a task one.
os.environ["RAYON_NUM_THREADS"] = "1"

import mimu
import pyarrow.parquet as pq


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n", 1)[0])
    parser.add_argument("recordings")
    parser.add_argument("results")
    parser.add_argument("--rows", type=int, default=100, help="recordings in a file of the results")
    parser.add_argument("--tasks", type=int, default=1000, help="most tasks in the array")
    given = parser.parse_args()

    if "SLURM_ARRAY_TASK_ID" not in os.environ:
        left = mimu.not_fitted(pq.read_table(given.recordings), given.results)
        tasks = min(given.tasks, -(-left.num_rows // given.rows))
        print(f"{left.num_rows} recordings are left", flush=True)
        if tasks:
            # A file for this array alone: an earlier one may still read its own.
            queued = tempfile.mkstemp(prefix="left-", suffix=".parquet", dir=os.getcwd())[1]
            pq.write_table(left, queued)
            job = f'"{sys.executable}" "{os.path.abspath(__file__)}" "{queued}" "{given.results}" --rows {given.rows}'
            subprocess.run(["sbatch", f"--array=0-{tasks - 1}", "--cpus-per-task=1", "--requeue", f"--wrap={job}"], check=True)
        return
    task, tasks = (int(os.environ[f"SLURM_ARRAY_TASK_{name}"]) for name in ("ID", "COUNT"))
    table = pq.read_table(given.recordings)
    for first in range(task * given.rows, table.num_rows, tasks * given.rows):
        mimu.fit_table(table.slice(first, given.rows), parts=given.results)


if __name__ == "__main__":
    main()
