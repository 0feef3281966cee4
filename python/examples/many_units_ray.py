"""Fits a table of recordings with Ray, on this machine or a cluster.

    python many_units_ray.py recordings.parquet results            # or s3://bucket/results
    python many_units_ray.py recordings.parquet results --rows 50  # recordings in a task

The table has the columns `label` and `path`. The same command goes on after a run that was cut short. On a cluster, `ray job submit` sets RAY_ADDRESS,
and every node needs mimu, pyarrow and fsspec.
"""

import argparse
from collections import Counter

import mimu
import pyarrow.parquet as pq
import ray


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n", 1)[0])
    parser.add_argument("recordings")
    parser.add_argument("results")
    parser.add_argument("--rows", type=int, default=100)
    given = parser.parse_args()

    left = mimu.not_fitted(pq.read_table(given.recordings), given.results)
    # A block of Ray is a call of `fit_table`, and a file of the results.
    blocks = [left.slice(first, given.rows) for first in range(0, left.num_rows, given.rows)]
    judged: Counter[str] = Counter()
    if blocks:
        # A fit would start a thread for each core, and Ray starts a task for each.
        ray.init(runtime_env={"env_vars": {"RAYON_NUM_THREADS": "1"}}, log_to_driver=False)
        parts = {"parts": given.results}
        fitted = ray.data.from_arrow(blocks).map_batches(mimu.fit_table, fn_kwargs=parts, batch_size=None, batch_format="pyarrow")
        for batch in fitted.select_columns(["judgement"]).iter_batches(batch_size=None, batch_format="pyarrow"):
            judged.update(judgement or "refused" for judgement in batch["judgement"].to_pylist())
    print(f"{left.num_rows} recordings fitted: {dict(judged)}")


if __name__ == "__main__":
    main()
