"""Fits a table of recordings with Dask, on this machine or a cluster.

    python many_units_dask.py recordings.parquet results
    python many_units_dask.py recordings.parquet s3://bucket/results --scheduler tcp://head:8786

The table has the columns `label` and `path`. The same command goes on after a run that was cut short. Every worker needs mimu, pyarrow and fsspec.
"""

import argparse
from collections import Counter
from contextlib import nullcontext

import dask
import mimu
import pyarrow as pa
import pyarrow.parquet as pq
from distributed import Client, LocalCluster, as_completed


def fitted(partition: pa.Table, parts: str) -> Counter[str]:
    """How many recordings of a partition have each judgement; the results stay where they are written."""
    return Counter(judgement or "refused" for judgement in mimu.fit_table(partition, parts=parts)["judgement"].to_pylist())


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n", 1)[0])
    parser.add_argument("recordings")
    parser.add_argument("results")
    parser.add_argument("--rows", type=int, default=100, help="recordings in a partition")
    parser.add_argument("--scheduler", help="address of a cluster's scheduler; without it, workers on this machine")
    given = parser.parse_args()

    left = mimu.not_fitted(pq.read_table(given.recordings), given.results)
    # A slice would be sent with the whole table behind it, `take` copies its rows.
    partitions = [left.take(list(range(first, min(first + given.rows, left.num_rows)))) for first in range(0, left.num_rows, given.rows)]
    # A fit would start a thread for each core, and Dask starts a worker for each.
    dask.config.set({"distributed.nanny.pre-spawn-environ.RAYON_NUM_THREADS": 1})
    judged: Counter[str] = Counter()
    with nullcontext(given.scheduler) if given.scheduler else LocalCluster(threads_per_worker=1, dashboard_address=":0") as cluster, Client(cluster) as client:
        for future in as_completed(client.map(fitted, partitions, parts=given.results, pure=False)):
            judged += future.result()
    print(f"{left.num_rows} recordings fitted: {dict(judged)}")


if __name__ == "__main__":
    main()
