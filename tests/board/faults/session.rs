//! A session of `mimu wizard` beside a commanded board.

use std::ops::{Deref, DerefMut};
use std::path::Path;

use mimu_board::commanded::{Commanded, Kind};
use mimu_board::inertial::with_digital_parts;
use mimu_rig::rig_file::{AffineFile, RigFile, RigTruth};
use mimu_rig::sensor::TriadTruth;
use mimu_rig::table::TableTruth;

use crate::run::{Ended, Run};
use mimu_tests::stored_calibration::Truth;

/// Where a scenario takes place.
#[derive(Clone, Copy)]
pub struct Bench<'a> {
    pub kind: Kind,
    pub folder: &'a Path,
}

impl Bench<'_> {
    /// The board's unit, long warmed up, on a table without flaws on an Earth that does not turn: the only remaining errors are noise. Fang's unit, or one
    /// of the digital part by its data sheet.
    pub fn unit(&self, seed: u64, fixture: &str) -> Result<RigTruth, String> {
        let mut file = match self.kind {
            Kind::Nucleo => {
                let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../../rig/rigs/fang.toml");
                let mut file = RigFile::read(Path::new(path))?;
                file.unit.supply_error_ppm = Some(0.0);
                file.converter.reference_error_ppm = Some(0.0);
                file
            }
            Kind::Matek { .. } => {
                let mut file = with_digital_parts(RigFile::default());
                let drawn = RigTruth::resolve(&file, seed)?.unit;
                let affine = |triad: &TriadTruth| {
                    let (matrix, bias) = triad.affine();
                    Some(AffineFile { matrix, bias })
                };
                // Written into the file, where a scenario wires them differently.
                file.unit.gyro_affine = affine(&drawn.gyro);
                file.unit.accel_affine = affine(&drawn.accel);
                file
            }
        };
        if fixture == "table" {
            file.earth_rate = Some(false);
            file.table = TableTruth::ideal();
        }
        file.thermal.on_before_s = Some(f64::INFINITY);
        file.effect.clear();
        RigTruth::resolve(&file, seed)
    }

    /// The same on a table with the flaws of a good one, the board off its axes, on an Earth that turns.
    pub fn on_real_table(&self, seed: u64) -> Result<RigTruth, String> {
        let mut file = self.unit(seed, "table")?.file;
        file.earth_rate = Some(true);
        file.table = TableTruth::default();
        RigTruth::resolve(&file, seed)
    }
}

/// A session with a board of ours.
pub struct WizardSession {
    pub board: Commanded,
    run: Run,
}

impl Deref for WizardSession {
    type Target = Run;

    fn deref(&self) -> &Run {
        &self.run
    }
}

impl DerefMut for WizardSession {
    fn deref_mut(&mut self) -> &mut Run {
        &mut self.run
    }
}

impl WizardSession {
    /// A board on a fixture; the command is not yet started.
    pub fn new(fixture: &str, seed: u64, bench: Bench<'_>, more: &[&str]) -> Result<Self, String> {
        Self::with(fixture, &bench.unit(seed, fixture)?, seed, bench, more)
    }

    /// The same with a unit that is wired differently.
    pub fn with(
        fixture: &str,
        truth: &RigTruth,
        seed: u64,
        bench: Bench<'_>,
        more: &[&str],
    ) -> Result<Self, String> {
        let mut unit_id = [0; 12];
        unit_id[4..].copy_from_slice(&seed.to_be_bytes());
        let Bench { kind, folder } = bench;
        let image = mimu_board_tests::image_of(kind);
        let board = Commanded::start(kind, &image, fixture, truth, seed, unit_id, folder)?;
        let driver = include_str!("../demo/turntable.toml");
        let driver = driver.replace("HOST:PORT", &board.address().to_string());
        std::fs::write(folder.join("driver.toml"), driver).map_err(|e| e.to_string())?;
        let by_hand = more.contains(&"hands");
        Ok(Self {
            board,
            run: Run::new(folder, "port", Truth::of(truth, by_hand)?, more),
        })
    }

    /// Waits for the end.
    pub fn end(self) -> Result<Ended, String> {
        self.run.end()
    }
}
