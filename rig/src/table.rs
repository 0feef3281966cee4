//! A turntable: three axes with realistic flaws, and a controller that does not know them.
//!
//! From the ground up: an outer axis, vertical; a middle axis perpendicular to it, east at zero; an inner axis, up at zero, which is the body's z
//! axis. At zero angles, the body axes are east, north, up. The nominal attitude (body into level axes) is `Rz(outer) Rx(middle) Rz(inner)`, so up in
//! body axes is (sin m sin i, sin m cos i, cos m).
//!
//! Neglected: axes that do not intersect, play, and the controller's noise.

mod commanded;
mod controller;
mod truth;

use controller::{Controller, INNER, MIDDLE, OUTER};

use crate::chain::{Frame, Jet};
use crate::motion::{Carrier, Instant};
use crate::place::Place;
use crate::plan::Plan;
use crate::rotation::{Rotation, Vector, scale};

pub use truth::TableTruth;

/// A table that carries out a plan, or commands.
#[derive(Debug, Clone)]
pub struct Table {
    place: Place,
    controller: Controller,
    cursor: usize,
    duration_s: f64,
    base: Frame,
    mounting: Rotation,
    wobble: Vector,
    nonorthogonality: [f64; 2],
    encoder: Vector,
    /// Reported over true rate.
    stated: Vector,
    offset: Vector,
    still: Option<([usize; 3], Instant)>,
}

impl Table {
    /// The table `truth`, ready to carry out `plan`, which must be within its [`TableTruth::limits`].
    pub fn new(plan: &Plan, truth: &TableTruth) -> Result<Self, String> {
        truth.check()?;
        plan.check(&truth.limits())?;
        let controller = Controller::carry_out(plan, truth).map_err(|e| plan.beyond(&e))?;
        let duration_s = controller.dwells.last().map_or(0.0, |dwell| dwell.end_s);
        Ok(Self::driven(controller, duration_s, plan, truth))
    }

    fn driven(controller: Controller, duration_s: f64, plan: &Plan, truth: &TableTruth) -> Self {
        let arcsec = |x: f64| (x / 3600.0).to_radians();
        let [east, north] = truth.level_arcsec.map(arcsec);
        Self {
            place: plan.place,
            duration_s,
            controller,
            cursor: 0,
            base: Frame::ground(&plan.place).fixed(Rotation::by([east, north, 0.0])),
            mounting: Rotation::by(truth.mounting_arcsec.map(arcsec)),
            wobble: truth.wobble_arcsec.map(arcsec),
            nonorthogonality: truth.nonorthogonality_arcsec.map(arcsec),
            encoder: truth.encoder_arcsec.map(arcsec),
            stated: truth.rate_scale_ppm.map(|ppm| 1.0 / (1.0 + 1e-6 * ppm)),
            offset: scale(1e-3, truth.offset_mm),
            still: None,
        }
    }
}

impl Carrier for Table {
    fn duration_s(&self) -> f64 {
        self.duration_s
    }

    fn at(&mut self, t_s: f64) -> Instant {
        let dwells = &self.controller.dwells;
        while dwells
            .get(self.cursor)
            .is_some_and(|dwell| dwell.end_s <= t_s)
        {
            self.cursor += 1;
        }
        let dwell = dwells.get(self.cursor).filter(|dwell| dwell.start_s <= t_s);
        let step = dwell.map(|_| self.cursor as u32);
        let by_angle = dwell.is_some_and(|dwell| dwell.by_angle);
        let mut resting = true;
        for axis in &mut self.controller.axes {
            resting &= axis.advance(t_s);
        }
        let segments = [0, 1, 2].map(|i| self.controller.axes[i].cursor());
        if let Some((of, mut still)) = self.still
            && resting
            && of == segments
        {
            still.motion.t_s = t_s;
            still.step = step;
            return still;
        }
        let stated = if by_angle { [1.0; 3] } else { self.stated };
        let instant = self.moving(t_s, step, stated);
        self.still = resting.then_some((segments, instant));
        instant
    }
}

impl Table {
    /// `stated` is reported over true rate of each axis.
    fn moving(&self, t_s: f64, step: Option<u32>, stated: Vector) -> Instant {
        let mut angle = [Jet::default(); 3];
        let mut tilt = [Jet::default(); 3];
        let mut rate = [0.0; 3];
        let (mut sine, mut cosine) = ([0.0; 3], [0.0; 3]);
        for i in 0..3 {
            let (commanded, lag) = self.controller.axes[i].at(t_s);
            let (s, c) = commanded.value.sin_cos();
            angle[i] = commanded + commanded.through([s, c, -s]).times(self.encoder[i]) + lag;
            tilt[i] = commanded.through([c, -s, -c]).times(self.wobble[i]);
            rate[i] = commanded.rate * stated[i];
            (sine[i], cosine[i]) = (s, c);
        }
        // Each axis wobbles about a direction of the part that carries it: the outer and the inner axis about x. The middle axis, which is along x,
        // wobbles about y, where the tilt adds to its angle with the outer axis.
        let body = self
            .base
            .about_own::<0>(tilt[OUTER])
            .about_own::<2>(angle[OUTER])
            .about_own::<1>(tilt[MIDDLE] + Jet::constant(self.nonorthogonality[0]))
            .about_own::<0>(angle[MIDDLE])
            .about_own::<1>(Jet::constant(self.nonorthogonality[1]))
            .about_own::<0>(tilt[INNER])
            .about_own::<2>(angle[INNER])
            .fixed(self.mounting);
        // Up and the middle axis, in nominal body axes.
        let up = [
            sine[MIDDLE] * sine[INNER],
            sine[MIDDLE] * cosine[INNER],
            cosine[MIDDLE],
        ];
        Instant {
            motion: body.motion(t_s, &self.place, self.offset, [Jet::default(); 3]),
            step,
            stated_rate: Some([
                rate[OUTER] * up[0] + rate[MIDDLE] * cosine[INNER],
                rate[OUTER] * up[1] - rate[MIDDLE] * sine[INNER],
                rate[OUTER] * up[2] + rate[INNER],
            ]),
            stated_force: Some(scale(self.place.gravity, up)),
        }
    }
}
