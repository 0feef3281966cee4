"""Fits a table of recordings with Spark, on this machine or a cluster.

    spark-submit many_units_spark.py recordings.parquet results             # or hdfs:///recordings.parquet s3://bucket/results
    python many_units_spark.py recordings.parquet results --master 'local[8,4]' --rows 50

The table has the columns `label` and `path`. The same command goes on after a run that was cut short. Every executor needs mimu, pyarrow and fsspec.
"""

import argparse
import os
import sys
from collections.abc import Iterator

import mimu
import pyarrow as pa
from pyspark.sql import SparkSession
from pyspark.sql.pandas.types import from_arrow_schema


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n", 1)[0])
    parser.add_argument("recordings")
    parser.add_argument("results")
    parser.add_argument("--rows", type=int, default=100, help="recordings in a file of the results")
    parser.add_argument("--master", help="as `spark-submit --master`; local[CORES,ATTEMPTS] on this machine, where Spark otherwise tries a task once")
    given = parser.parse_args()

    # Spark takes the first python3 otherwise. A fit would start a thread for each core, and Spark starts a task for each.
    os.environ |= {"RAYON_NUM_THREADS": "1", "PYSPARK_PYTHON": sys.executable}
    builder = SparkSession.builder.config("spark.executorEnv.RAYON_NUM_THREADS", "1")
    spark = (builder.master(given.master) if given.master else builder).getOrCreate()
    # A batch of Arrow is a call of `fit_table`, and a file of the results: a whole partition, whose size varies a little.
    spark.conf.set("spark.sql.execution.arrow.maxRecordsPerBatch", 2 * given.rows)
    left = spark.createDataFrame(mimu.not_fitted(spark.read.parquet(given.recordings).toArrow(), given.results))
    partitions = max(1, -(-left.count() // given.rows))

    def fitted(batches: Iterator[pa.RecordBatch]) -> Iterator[pa.RecordBatch]:
        for batch in batches:
            yield from mimu.fit_table(batch, parts=given.results).to_batches()

    results = left.repartition(partitions).mapInArrow(fitted, from_arrow_schema(mimu.fit_table_schema()))
    judged = {row["judgement"] or "refused": row["count"] for row in results.groupBy("judgement").count().collect()}
    print(f"{sum(judged.values())} recordings fitted: {judged}")
    spark.stop()


if __name__ == "__main__":
    main()
