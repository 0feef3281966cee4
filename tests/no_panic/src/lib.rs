//! All functions of `mimu-core` in the device's precision, instantiated so that a compiler must generate them.
//!
//! `check.sh` compiles this crate and its dependencies for the target. From these functions it follows every call and every address in the assembly;
//! none may leave it, except to a few functions that are known not to panic. A function that is missing here is not checked.
#![no_std]

use mimu_core::compensation::{Affine, Compensation, Sample};
use mimu_core::compensator::{self, Compensator};
use mimu_core::die::{self, DieLag};
use mimu_core::effects::{DeviceEffect, Directions, EffectError, Effects, State, Variable};
use mimu_core::kalman::{Bank, Filter, Innovation, Rejected};
use mimu_core::single;
use mimu_core::stored::{self, Curves, NODES, Origin, ROOM, Stored, TooLong};
use mimu_core::table::{self, Node, Table};
use mimu_core::wire::{
    Call, CompensatedBatch, Counts, Decoder, EncodeError, MAX_FRAME, Message, RawBatch, SelfTest,
    TestRow, TestTable, Triad, effects_of_this_build, encode, reading,
};
use mimu_core::{PerSensor, Sensor};
use nalgebra::{Matrix3, Matrix4, Vector3, Vector4};

/// [`Affine::apply`].
#[inline(never)]
pub fn affine(model: &Affine<f32>, raw: &Vector3<f32>) -> Vector3<f32> {
    model.apply(raw)
}

/// [`Compensation::apply`].
#[inline(never)]
pub fn compensation(model: &Compensation<f32>, raw: &Sample<f32>) -> Sample<f32> {
    model.apply(raw)
}

/// [`DeviceEffect::named`], and with it everything that the table of effects refers to.
#[inline(never)]
pub fn effect_named(
    id: &str,
    coefficients: &[f32],
    form: Option<f32>,
) -> Result<DeviceEffect<f32>, EffectError> {
    DeviceEffect::named(id, coefficients, form)
}

/// [`DeviceEffect::term`].
#[inline(never)]
pub fn effect_term(
    sensor: Sensor,
    axis: usize,
    coefficient: f32,
    variables: &[Variable],
) -> Result<DeviceEffect<f32>, EffectError> {
    DeviceEffect::term(sensor, axis, coefficient, variables)
}

/// [`Effects::push`].
#[inline(never)]
pub fn effects_push(
    effects: &mut Effects<f32, 8>,
    effect: DeviceEffect<f32>,
) -> Result<(), EffectError> {
    effects.push(effect)
}

/// [`State::new`].
#[inline(never)]
pub fn effects_state(sample_rate_hz: f32) -> State<f32, 8> {
    State::new(sample_rate_hz)
}

/// [`Effects::slow`].
#[inline(never)]
pub fn effects_slow(effects: &Effects<f32, 8>, state: &mut State<f32, 8>, dt_s: f32, temp_c: f32) {
    effects.slow(state, dt_s, temp_c);
}

/// [`Effects::remove`].
#[inline(never)]
pub fn effects_remove(
    effects: &Effects<f32, 8>,
    state: &mut State<f32, 8>,
    compensated: &Sample<f32>,
) -> Sample<f32> {
    effects.remove(state, compensated)
}

/// [`Filter::with_prior`].
#[inline(never)]
pub fn filter_with_prior(mean: [f32; 4], variance: [f32; 4]) -> Filter<f32> {
    Filter::with_prior(mean, variance)
}

/// [`Filter::update`].
#[inline(never)]
pub fn filter_update(
    filter: &mut Filter<f32>,
    input: &Vector3<f32>,
    raw: f32,
    noise: f32,
) -> Result<Innovation<f32>, Rejected> {
    filter.update(input, raw, noise)
}

/// [`Filter::mean`], [`Filter::covariance`] and [`Filter::diagonal`].
#[inline(never)]
pub fn filter_state(filter: &Filter<f32>) -> (Vector4<f32>, Matrix4<f32>, Vector4<f32>) {
    (filter.mean(), filter.covariance(), filter.diagonal())
}

/// [`Bank::diffuse`], which calls [`Filter::diffuse`].
#[inline(never)]
pub fn bank_diffuse(noise: &Vector3<f32>, span: f32) -> Bank<f32> {
    Bank::diffuse(noise, span)
}

/// [`Bank::update`].
#[inline(never)]
pub fn bank_update(
    bank: &mut Bank<f32>,
    input: &Vector3<f32>,
    raw: &Vector3<f32>,
    noise: &Vector3<f32>,
) -> Result<(), Rejected> {
    bank.update(input, raw, noise)
}

/// [`Effects::new`].
#[inline(never)]
pub fn effects_new(models: &Compensation<f64>) -> Option<Effects<f32, 8>> {
    Effects::new(models)
}

/// [`Effects::of`], which the device calls when it receives a calibration, and [`State::gap`].
#[inline(never)]
pub fn effects_of(of: PerSensor<Directions<f32>>, state: &mut State<f32, 8>) -> Effects<f32, 8> {
    state.gap();
    Effects::of(of)
}

/// [`Table::new`].
#[inline(never)]
pub fn table_new(nodes: &[Node<f32>]) -> Result<Table<f32, 16>, table::TableError> {
    Table::new(nodes.iter().copied())
}

/// [`Table::state`] and [`Table::follow`].
#[inline(never)]
pub fn table_follow(table: &Table<f32, 16>, dies_c: PerSensor<f32>) -> table::State<f32> {
    let mut state = table.state();
    table.follow(&mut state, dies_c);
    state
}

/// [`Table::with_range`] and [`Effects::within`].
#[inline(never)]
pub fn table_within(
    table: Table<f32, 16>,
    range_c: [f32; 2],
    effects: Effects<f32, 8>,
) -> Result<(Table<f32, 16>, Effects<f32, 8>), table::TableError> {
    let table = table.with_range(range_c)?;
    let effects = effects.within(table.limits());
    Ok((table, effects))
}

/// [`DieLag`].
#[inline(never)]
pub fn die_follow(lag_s: f32, dt_s: f32, readings_c: [f32; 2]) -> Option<f32> {
    let lag = DieLag::new(lag_s).unwrap_or_else(DieLag::none);
    let [before_c, now_c] = readings_c;
    let die_c = lag.follow(&mut die::State::new(), dt_s, before_c)?;
    lag.follow(&mut lag.state_of(before_c, die_c), dt_s, now_c)
}

/// [`stored::encode`].
#[inline(never)]
pub fn stored_encode(
    origin: &Origin,
    found_with: PerSensor<&Matrix3<f32>>,
    curves: &Curves<'_>,
    effects: &[DeviceEffect<f32>],
    out: &mut [u8],
) -> Result<usize, TooLong> {
    stored::encode(origin, found_with, curves, effects, out)
}

/// [`stored::decode`] and [`stored::hash`].
#[inline(never)]
pub fn stored_decode(bytes: &[u8]) -> (u64, Result<Stored, stored::StoredError>) {
    (stored::hash(bytes), stored::decode(bytes))
}

/// [`stored::trim`].
#[inline(never)]
pub fn stored_trim(
    bytes: &mut [u8],
    add: PerSensor<[f32; 3]>,
    trimmed_s: u64,
) -> Result<(), stored::StoredError> {
    stored::trim(bytes, add, trimmed_s)
}

/// [`encode`] for messages that a device sends.
#[inline(never)]
pub fn wire_send(message: &Message<'_>, out: &mut [u8; MAX_FRAME]) -> Result<usize, EncodeError> {
    encode(message, out)
}

/// [`encode`] for messages that a host sends.
#[inline(never)]
pub fn wire_ask(call: &Call<'_>, out: &mut [u8; MAX_FRAME]) -> Result<usize, EncodeError> {
    encode(call, out)
}

/// [`Decoder`], as a device uses it.
#[inline(never)]
pub fn wire_asked(decoder: &mut Decoder, byte: u8) -> Option<(Option<Call<'_>>, Option<u16>)> {
    let frame = decoder.push(byte)?;
    Some((frame.call(), frame.id()))
}

/// [`Decoder`], as a host uses it.
#[inline(never)]
pub fn wire_received(decoder: &mut Decoder, byte: u8) -> Option<Message<'_>> {
    decoder.push(byte)?.message()
}

/// [`RawBatch`] as a host reads it.
#[inline(never)]
pub fn wire_raw(
    batch: &RawBatch<'_>,
    take: &mut dyn FnMut(u32, [u8; 18], Sample<f32>, u64, Option<f32>),
) {
    if batch.is_whole() {
        let temp_c = batch.temperatures_c().next();
        let of = batch.counts().zip(batch.readings());
        for (((number, counts), (_, reading)), t_ns) in of.zip(batch.head.times_ns()) {
            take(number, RawBatch::pack(&counts), reading, t_ns, temp_c);
        }
    }
}

/// [`SelfTest`] as a host reads it, and its rows as a device writes them.
#[inline(never)]
pub fn wire_self_test<'a>(test: &SelfTest<'a>, take: &mut dyn FnMut(&TestRow<'a>)) -> bool {
    let mut table = TestTable::new();
    for row in test.rows() {
        take(&row);
        let again = TestRow::within(row.name, row.value, row.unit, row.limits);
        if !table.push(&again) {
            return false;
        }
    }
    test.is_whole() && table.result().is_whole()
}

/// [`Origin::check_sensors`].
#[inline(never)]
pub fn stored_sensors(
    origin: &Origin,
    triads: &PerSensor<Triad<'_>>,
) -> Result<(), stored::StoredError> {
    origin.check_sensors(triads)
}

/// [`CompensatedBatch`] as a host reads it.
#[inline(never)]
pub fn wire_compensated(batch: &CompensatedBatch<'_>, take: &mut dyn FnMut(u32, Sample<f32>)) {
    if batch.is_whole() {
        for (number, sample) in batch.values() {
            take(number, sample);
        }
    }
}

/// [`effects_of_this_build`].
#[inline(never)]
pub fn wire_effects() -> u32 {
    effects_of_this_build()
}

/// [`Compensator::state`], [`Compensator::take_over`], [`Compensator::follow`] and its other state, as when a device continues with another
/// calibration.
#[inline(never)]
pub fn compensator_follow(
    now: &Compensator<f32, NODES, ROOM>,
    before: &Compensator<f32, NODES, ROOM>,
    dt_s: f32,
    thermometer_c: Option<f32>,
) -> (
    compensator::State<f32, ROOM>,
    Option<PerSensor<f32>>,
    table::Place,
) {
    let mut state = before.state(1000.0).long_after_power_on();
    state.at_rate(1030.0);
    before.follow(&mut state, dt_s, thermometer_c);
    now.take_over(before, &mut state);
    state.gap();
    let place = now.follow(&mut state, dt_s, thermometer_c);
    (state, state.dies_c(), place)
}

#[rustfmt::skip]
#[path = "../../../core/examples/stream/calibrate.rs"]
mod readme;

/// The program of the README of mimu-core.
#[inline(never)]
pub fn readme_program(
    calibration: &[u8],
    samples: &[([f32; 3], [f32; 3], f32)],
    out: &mut dyn FnMut(Sample<f32>, table::Place),
) -> Result<(), stored::StoredError> {
    readme::calibrate(calibration, 1000.0, samples.iter().copied(), out)
}

/// The device's work for every sample: integers to raw units, the whole calibration at the temperature of the batch, bytes of both streams.
#[inline(never)]
pub fn sample_path(
    counts: &Counts,
    scale: &PerSensor<f32>,
    compensator: &Compensator<f32, NODES, ROOM>,
    state: &mut compensator::State<f32, ROOM>,
) -> ([u8; 18], [u8; 24]) {
    let sample = single::apply(compensator, state, &reading(counts, scale));
    (RawBatch::pack(counts), CompensatedBatch::pack(&sample))
}

/// The same without effects: the compensation alone, whose instructions are counted.
#[inline(never)]
pub fn sample_compensation(at: &table::State<f32>, raw: &Sample<f32>) -> Sample<f32> {
    single::compensate(&at.model, raw)
}
