-- Questions to the results of `mimu.fit_table`, in the folder that has them:  duckdb < many_units.sql
-- Labels are like line=B/batch=2026-10/unit-00007.

create or replace view results as
select *, regexp_extract(label, 'line=([^/]*)', 1) as line, regexp_extract(label, 'batch=([^/]*)', 1) as batch from read_parquet('results/*.parquet', union_by_name = true);

-- Worst held-out error by batch.
select line, batch, count(*) as units, round(degrees(max(gyro_held_out)), 4) as gyro_worst_deg, arg_max(device, gyro_held_out) as gyro_worst,
       round(1e3 * max(accel_held_out), 2) as accel_worst_mmps2, arg_max(device, accel_held_out) as accel_worst
from results where error is null group by all order by gyro_worst_deg desc limit 5;

-- Drift of a line: slope of the bias over the serial number. It drifts if that exceeds four standard deviations.
with biases as (
    unpivot (select line, regexp_extract(device, '[0-9]+$')::int as number, columns('^(gyro|accel)_bias_[xyz]$') from results where error is null)
    on * exclude (line, number) into name parameter value bias
), slopes as (
    select line, parameter, count(*) as units, regr_slope(bias, number) as slope,
           sqrt((1 - regr_r2(bias, number)) / (count(*) - 2)) * stddev_samp(bias) / stddev_samp(number) as sigma
    from biases group by all
)
select line, parameter, units, round(100 * slope, 1) as per_100_units, round(100 * sigma, 1) as sigma_per_100_units, abs(slope) > 4 * sigma as drifts
from slopes order by abs(slope) / sigma desc limit 5;

-- Share of refusals by reason; every number is replaced by #.
select regexp_replace(error_problem, '[0-9][0-9.e-]*', '#', 'g') as reason, count(*) as recordings,
       round(100.0 * count(*) / (select count(*) from results), 1) as percent, min(label) as for_example,
       arg_min(error_row, label) as row, arg_min(error_column, label) as column
from results where error is not null group by all order by recordings desc, reason;

-- Units that exceed limits, or whose result may not be used.
select label, judgement, gyro_held_out, accel_held_out from results
where gyro_held_out > 0.01 or accel_held_out > 0.05 or judgement in ('suspect', 'misfit') order by gyro_held_out desc limit 20;
