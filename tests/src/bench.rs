//! Units with known truth on the virtual bench, recorded and read as a user's recordings are.

use std::fmt::Write as _;
use std::path::Path;

use mimu::noise::noise_file::NoiseFile;
use mimu::prepared::Prepared;
use mimu::signal::stillness::STILL_FACTOR;
use mimu_recording::{Recording, Reference, Turntable};
use mimu_rig::located::Source;
use mimu_rig::plan::Plan;
use mimu_rig::random::Random;
use mimu_rig::record::{Output, samples, write};
use mimu_rig::rig_file::{AffineFile, RigFile, RigTruth};
use mimu_rig::table::TableTruth;
use nalgebra::{Matrix3, SVector, Vector3};

/// A forward model, SI to raw, of sensors like fang's (Table 4: 5 mV per deg/s about 2.5 V, 80 mV per m/s² about 1.65 V)
/// with errors of some per cent and some degrees.
pub fn gyro(random: &mut Random) -> AffineFile {
    affine(5e-3f64.to_degrees(), 2.5, random)
}

/// The same for an accelerometer. Its matrix is lower triangular, so its x axis and xy plane are the body's; by hand, nothing else defines the body's
/// axes.
pub fn accel(random: &mut Random) -> AffineFile {
    in_own_frame(affine(0.08, 1.65, random))
}

/// The model with its frame aligned to the sensors: x along the sensor x, the xy plane through the sensor y.
pub fn in_own_frame(mut model: AffineFile) -> AffineFile {
    for i in 0..3 {
        for j in i + 1..3 {
            model.matrix[i][j] = 0.0;
        }
    }
    model
}

fn affine(scale: f64, null: f64, random: &mut Random) -> AffineFile {
    let mut matrix = [[0.0; 3]; 3];
    for (i, row) in matrix.iter_mut().enumerate() {
        for (j, element) in row.iter_mut().enumerate() {
            let diagonal = if i == j { 1.0 } else { 0.0 };
            *element = scale * (diagonal + random.within(0.03));
        }
    }
    AffineFile {
        matrix,
        bias: std::array::from_fn(|_| null + random.within(0.05)),
    }
}

/// P by rows, then b.
pub fn parameters(model: &AffineFile) -> SVector<f64, 12> {
    let matrix = Matrix3::from_fn(|i, j| model.matrix[i][j]);
    mimu::triad::vector(&matrix, &Vector3::from(model.bias))
}

/// The unit that the numbers of this seed and name draw, clean.
pub fn drawn(seed: u64, name: &str) -> RigFile {
    let mut random = Random::new(seed, name);
    clean(gyro(&mut random), accel(&mut random))
}

/// A unit of the usual parts with their noise and the given affine models, on a table without flaws. The only remaining errors are noise.
pub fn clean(gyro: AffineFile, accel: AffineFile) -> RigFile {
    let mut file = RigFile {
        table: TableTruth::ideal(),
        ..RigFile::default()
    };
    file.unit.gyro_affine = Some(gyro);
    file.unit.accel_affine = Some(accel);
    file.unit.supply_error_ppm = Some(0.0);
    file.converter.reference_error_ppm = Some(0.0);
    file
}

/// Plan of six faces, four corners and four rates about each axis, 3 s each at 100 Hz; in random order by the seed, or as listed.
///
/// Sensor biases wander. Neighbouring dwells share this wander, so it enters the parameters that their difference determines. In random order it acts
/// like any other noise.
pub fn table_plan(order: Option<u64>) -> String {
    let mut steps = Vec::new();
    for axis in 0..3 {
        let up: [f64; 3] = std::array::from_fn(|i| f64::from(u8::from(i == axis)));
        steps.push((up, 0.0));
        steps.extend([-200.0, -60.0, 60.0, 200.0].map(|rate| (up, rate)));
        steps.push((up.map(|u| -u), 0.0));
    }
    let corners = [
        [1.0, 1.0, 1.0],
        [-1.0, 1.0, -1.0],
        [1.0, -1.0, -1.0],
        [-1.0, -1.0, 1.0],
    ];
    steps.extend(corners.map(|up| (up, 0.0)));
    if let Some(seed) = order {
        let mut random = Random::new(seed, "order of the steps");
        for k in (1..steps.len()).rev() {
            steps.swap(k, (random.uniform() * (k + 1) as f64) as usize);
        }
    }
    let mut plan =
        String::from("format = \"mimu-plan/1\"\nsample_rate_hz = 100.0\ncarrier = \"table\"\n");
    for (up, rate_dps) in steps {
        let _ = writeln!(
            plan,
            "[[step]]\nup = {up:?}\nrate_dps = {rate_dps:?}\ndwell_s = 3.0"
        );
    }
    plan
}

/// Plan of the faces, of rates about each axis upright, and of turns about the body's z axis, level and slanted, with and without a rate about the
/// vertical. Gravity turns through the accelerometer, and the rate through the gyro. The seed draws the order.
pub fn turning_plan(seed: u64) -> String {
    let mut steps: Vec<([f64; 3], f64, f64)> = Vec::new();
    for axis in 0..3 {
        let up: [f64; 3] = std::array::from_fn(|i| f64::from(u8::from(i == axis)));
        steps.push((up, 0.0, 0.0));
        steps.push((up.map(|u| -u), 0.0, 0.0));
        steps.extend([-200.0, 200.0].map(|rate| (up, rate, 0.0)));
    }
    for up in [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]] {
        steps.extend([-180.0, -60.0, 60.0, 180.0].map(|spin| (up, 0.0, spin)));
    }
    for up in [[1.0, 0.0, 1.0], [1.0, 0.0, -1.0]] {
        steps.extend([-90.0, 90.0].map(|spin| (up, 0.0, spin)));
    }
    for (rate, spin) in [(60.0, 45.0), (-60.0, 45.0), (120.0, -90.0), (-120.0, 90.0)] {
        steps.push(([0.0, 1.0, 0.0], rate, spin));
    }
    let mut random = Random::new(seed, "order of the steps");
    for k in (1..steps.len()).rev() {
        steps.swap(k, (random.uniform() * (k + 1) as f64) as usize);
    }
    let mut plan =
        String::from("format = \"mimu-plan/1\"\nsample_rate_hz = 100.0\ncarrier = \"table\"\n");
    for (up, rate_dps, spin_dps) in steps {
        let _ = writeln!(
            plan,
            "[[step]]\nup = {up:?}\nrate_dps = {rate_dps:?}\nspin_dps = {spin_dps:?}\ndwell_s = 6.0"
        );
    }
    plan
}

/// Plan of a record player: in each of `orientations` random orientations a rest, 33 1/3 rpm and 45 rpm, 5 s each at 100 Hz. `off` gives the relative
/// errors of the two rates.
///
/// In the first six an axis is near the vertical, as when a phone lies on its faces and edges; in the others the unit leans on something.
pub fn record_player_plan(orientations: usize, off: [f64; 2], seed: u64) -> String {
    let mut random = Random::new(seed, "orientations");
    let mut plan =
        String::from("format = \"mimu-plan/1\"\nsample_rate_hz = 100.0\ncarrier = \"table\"\n");
    for k in 0..orientations {
        let up: [f64; 3] = std::array::from_fn(|i| match k {
            0..6 if k / 2 == i => [1.0, -1.0][k % 2],
            0..6 => random.within(0.1),
            _ => random.normal(),
        });
        for rate_dps in [0.0, 200.0 * (1.0 + off[0]), 270.0 * (1.0 + off[1])] {
            let _ = writeln!(
                plan,
                "[[step]]\nup = {up:?}\nrate_dps = {rate_dps:?}\ndwell_s = 5.0"
            );
        }
    }
    plan
}

/// Plan of `poses` poses by hand, 3 s each at 100 Hz.
pub fn hand_plan(poses: usize) -> String {
    format!(
        "format = \"mimu-plan/1\"\nsample_rate_hz = 100.0\ncarrier = \"hands\"\n[[step]]\nposes = {poses}\ndwell_s = 3.0\n"
    )
}

/// The same with each face up in turn, tipped about a random axis by at most `most_deg`.
pub fn near_faces_plan(poses: usize, most_deg: f64, random: &mut Random) -> String {
    let mut plan =
        String::from("format = \"mimu-plan/1\"\nsample_rate_hz = 100.0\ncarrier = \"hands\"\n");
    for pose in 0..poses {
        let (axis, sign) = (pose % 3, if pose / 3 % 2 == 0 { 1.0 } else { -1.0 });
        let (tip, heading) = (random.within(most_deg).to_radians(), random.within(180.0));
        let mut up = [0.0; 3];
        up[axis] = sign * tip.cos();
        up[(axis + 1) % 3] = tip.sin() * heading.to_radians().cos();
        up[(axis + 2) % 3] = tip.sin() * heading.to_radians().sin();
        let _ = writeln!(plan, "[[step]]\nup = {up:?}\ndwell_s = 3.0");
    }
    plan
}

/// The recording of a plan, in the folder `recording` of a temporary folder.
pub fn written(plan: &str, file: &RigFile, seed: u64) -> tempfile::TempDir {
    let folder = tempfile::tempdir().expect("a folder");
    written_in(&folder.path().join("recording"), plan, file, seed);
    folder
}

/// The recording of a plan, in a folder that does not exist yet.
pub fn written_in(folder: &Path, plan: &str, file: &RigFile, seed: u64) {
    let plan = Plan::parse(Source::new("plan", plan)).expect("a plan");
    let truth = RigTruth::resolve(file, seed).expect("a rig");
    let output = Output::new(folder, &plan).expect("a name");
    write(&plan, &truth, seed, &output).expect("written");
}

/// The recording of a plan on a turntable: only the magnitudes of its rates are known.
pub fn on_a_turntable(plan: &str, file: &RigFile, seed: u64, turntable: Turntable) -> Prepared {
    let folder = written(plan, file, seed);
    let recording = Recording::open(&folder.path().join("recording"));
    let mut recording = recording.expect("a recording");
    recording.manifest.reference = Reference::TurntableRate;
    recording.manifest.turntable = Some(turntable);
    Prepared::read(&recording, STILL_FACTOR, |_| ()).expect("readable")
}

/// The recording of a plan.
pub fn recorded(plan: &str, file: &RigFile, seed: u64) -> Prepared {
    let folder = written(plan, file, seed);
    let recording = Recording::open(&folder.path().join("recording")).expect("a recording");
    Prepared::read(&recording, STILL_FACTOR, |_| ()).expect("readable")
}

/// The average contribution of slow noise (bias instability, rate random walk) to the biases of gyro and accelerometer over a recording. It is the
/// difference of two recordings, with and without slow noise and otherwise equal bit by bit.
///
/// A recording of one session can only determine the bias of that session. The average of 1/f noise over all sessions does not converge.
pub fn wander(plan: &str, file: &RigFile, seed: u64) -> [[f64; 3]; 2] {
    let plan = Plan::parse(Source::new("plan", plan)).expect("a plan");
    let mut still = file.clone();
    for axes in [&mut still.unit.gyro_axes, &mut still.unit.accel_axes] {
        axes.instability_si = Some([0.0; 3]);
        axes.walk_si = Some([0.0; 3]);
    }
    let mut sums = [[0.0; 3]; 2];
    let all = differences(&plan, [file, &still], seed);
    for (_, difference) in &all {
        for (sum, d) in sums.iter_mut().flatten().zip(difference.iter().flatten()) {
            *sum += d / all.len() as f64;
        }
    }
    sums
}

/// Difference that an effect makes to the readings at `at_s`, raw. `files[0]` has the effect and `files[1]` lacks it; the effect must be linear in
/// time.
///
/// A line is fitted to all samples, because the converter rounds each: from the first and the last alone, a fifth of a count became half a count.
pub fn drifted(plan: &str, files: [&RigFile; 2], seed: u64, at_s: f64) -> [[f64; 3]; 2] {
    let plan = Plan::parse(Source::new("plan", plan)).expect("a plan");
    let all = differences(&plan, files, seed);
    let n = all.len() as f64;
    let mean_s = all.iter().map(|d| d.0).sum::<f64>() / n;
    let spread = all.iter().map(|d| (d.0 - mean_s).powi(2)).sum::<f64>();
    std::array::from_fn(|k| {
        std::array::from_fn(|i| {
            let mean = all.iter().map(|d| d.1[k][i]).sum::<f64>() / n;
            let along = all.iter().map(|d| (d.0 - mean_s) * d.1[k][i]).sum::<f64>();
            mean + along / spread * (at_s - mean_s)
        })
    })
}

/// Time, and the readings of the first unit minus those of the second: gyro and accelerometer, raw. Apart from the units, both runs are equal bit by
/// bit.
fn differences(plan: &Plan, files: [&RigFile; 2], seed: u64) -> Vec<(f64, [[f64; 3]; 2])> {
    let truths = files.map(|file| RigTruth::resolve(file, seed).expect("a rig"));
    let [with, without] = truths
        .each_ref()
        .map(|truth| samples(plan, truth, seed).expect("a run"));
    let each = with.zip(without).map(|(a, b)| {
        let less = |x: &[f64; 3], y: &[f64; 3]| std::array::from_fn(|i| x[i] - y[i]);
        let (a_, b_) = (&a.readings, &b.readings);
        (
            a.stamp_s,
            [less(&a_.gyro, &b_.gyro), less(&a_.accel, &b_.accel)],
        )
    });
    each.collect()
}

/// Noise file with the true coefficients of a unit whose affine models are given, in volts.
pub fn noise_file(file: &RigFile, seed: u64, period_s: f64) -> NoiseFile {
    let truth = RigTruth::resolve(file, seed).expect("a rig");
    let mut text = String::from(
        "format = \"mimu-noise/1\"\ndevice = \"unit-007\"\nsample_rate_hz = 100.0\nduration_s = 10800.0\nconfidence = 0.95\n",
    );
    let (unit, converter) = (&truth.unit, &truth.converter);
    let code_v = unit.converter_reference.nominal_v / f64::from(converter.bits).exp2();
    let models = [&file.unit.gyro_affine, &file.unit.accel_affine];
    for (k, sensor) in [&unit.gyro, &unit.accel].into_iter().enumerate() {
        let divider = [converter.gyro_divider, converter.accel_divider][k];
        // A sample is the mean of several conversions, each with the noise of the converter.
        let conversion =
            converter.noise_codes * code_v / divider / f64::from(converter.conversions).sqrt();
        for (i, axis) in sensor.axes.iter().enumerate() {
            let row = models[k].as_ref().expect("stated").matrix[i];
            let volts = row.iter().map(|p| p * p).sum::<f64>().sqrt();
            let noise = &axis.noise;
            let n = (volts * noise.white).hypot(conversion * period_s.sqrt());
            let _ = writeln!(
                text,
                "[[channel]]\nname = \"{}_{}\"\nunit = \"V\"\nsamples = 1080000",
                ["gyro", "accel"][k],
                ["x", "y", "z"][i]
            );
            for (key, value, unit) in [
                ("n", n, "V/sqrt(Hz)"),
                ("b", volts * noise.instability, "V"),
                ("k", volts * noise.walk, "V/sqrt(s)"),
            ] {
                let _ = writeln!(
                    text,
                    "{key} = {{ value = {value:e}, sigma = 0.0, lower = {value:e}, upper = {value:e}, unit = \"{unit}\" }}"
                );
            }
        }
    }
    NoiseFile::parse(&text, "noise").expect("a noise file")
}
