//! `mimu design --prior`: what it is for, the targets, and the fewest dwells that meet them.

use std::path::Path;

use mimu::plan::design::Problem;
use mimu::plan::design::fewest::{MOST, Widths};
use mimu::plan::design::population::Population;
use mimu::plan::design::reach::Fixture;
use mimu::result::design::Design;
use mimu::{Prior, STANDARD_GRAVITY, Sensor, significant};
use mimu_recording::{Error, Reference, Result};
use mimu_wizard::procedure::Targets;

use super::DesignArgs;
use crate::arguments::targets;

impl DesignArgs {
    /// The problem beside the prior, if one is given.
    pub(super) fn beside_prior(&self, problem: Problem) -> Result<Problem> {
        let Some(path) = &self.prior else {
            return Ok(problem);
        };
        let (_, _, sigma) = self.dwell()?;
        let population = Population::of(&Prior::read(path)?, &path.display().to_string())?;
        problem.beside(population, sigma, self.aim.to_radians())
    }

    /// Refuses what a prior is not for, by its option.
    pub(super) fn refuse_beside_prior(&self) -> Result<()> {
        if self.prior.is_none() {
            return Ok(());
        }
        let refuse = |option: String, problem: &str, remedy: &str| {
            Err(Error::new(
                format!("{option} with --prior"),
                problem,
                remedy,
            ))
        };
        let by_hand =
            "a prior is for poses by hand with gravity as the reference, as in mimu fit --prior";
        if self.effects.is_some() {
            return refuse(
                "--effects".into(),
                "a prior is of the affine parameters, and a diagnosis uses none",
                "leave --prior out",
            );
        }
        if self.sensor == Sensor::Gyro {
            return refuse(
                "--sensor gyro".into(),
                "by hand a gyro's known inputs are the turns between dwells, which this command does not design",
                "leave --sensor out: mimu fit --prior uses the prior of the gyro in the same recording",
            );
        }
        if let Some(reference) = self.reference.filter(|r| *r != Reference::Gravity) {
            return refuse(
                format!("--reference {reference}"),
                by_hand,
                "leave --reference out, or --prior: known inputs determine every parameter without it",
            );
        }
        if let Some(table) = self.table.filter(|table| *table != Fixture::Hand) {
            return refuse(
                format!("--table {}", table.name()),
                by_hand,
                "leave --table out, or --prior: on a table, known inputs determine every parameter without it",
            );
        }
        Ok(())
    }

    /// Half-widths that the accelerometer is to have, SI; and in words.
    pub(super) fn widths(&self) -> Result<(Widths, String)> {
        if let Some(of_gyro) = self.targets.iter().find(|t| t.starts_with("gyro")) {
            return Err(Error::new(
                format!("--target {of_gyro}"),
                "this command designs the accelerometer's poses",
                "leave it out; mimu wizard has targets of the gyro",
            ));
        }
        let Targets {
            accel_bias_mg: bias,
            accel_scale_ppm: scale,
            accel_angle_urad: angle,
            ..
        } = targets(&self.targets)?;
        let words = format!(
            "{} mg, {} ppm, {} µrad",
            significant(bias),
            significant(scale),
            significant(angle)
        );
        let widths = Widths {
            bias: bias * 1e-3 * STANDARD_GRAVITY,
            scale: scale * 1e-6,
            angle: angle * 1e-6,
        };
        Ok((widths, words))
    }

    /// The design of the fewest dwells that meet the targets.
    pub(super) fn fewest(&self, problem: &Problem) -> Result<Design> {
        let (_, dwell_s, sigma) = self.dwell()?;
        let (wanted, words) = self.widths()?;
        let found = problem.fewest_with(sigma, self.seed, |j| Widths::of(j).meet(&wanted));
        let Some(n) = found else {
            let path = self.prior.as_deref().unwrap_or(Path::new("the prior"));
            return Err(Error::new(
                path.display(),
                format!(
                    "with it, {MOST} dwells of {} s do not have half-widths of {words} or less",
                    significant(dwell_s)
                ),
                "hold still for longer (--dwell), allow more (--target), or give the number of dwells (-n)",
            ));
        };
        let title = format!("fewest found for {words}: {n} (seed {})", self.seed);
        let design = self.best(problem, n, title)?;
        Ok(design.beside_population(problem, self.seed, Some(&wanted)))
    }
}
