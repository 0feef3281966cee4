//! The poses of the dwells on a sphere, with their residuals.

use maud::{Markup, html};
use mimu::diagnose::picture::Picture;
use mimu::{Calibration, Dwell, Prepared, Sensor};
use nalgebra::Vector3;

use crate::report::svg::{Panel, px};

/// Residual from which a pose is marked, in noise sigmas.
const FAR: f64 = 2.5;
/// Radius of a hemisphere, and distance of the centres, pixels.
const RADIUS: f64 = 92.0;
const APART: f64 = 250.0;

/// Directions of the specific force of all dwells at rest, in the body frame.
pub fn figure(prepared: &Prepared, calibration: &Calibration, accel: Option<&Picture>) -> Markup {
    let Some(model) = calibration.inverse(Sensor::Accel) else {
        return html! {};
    };
    let from = Sensor::Accel.channels().start;
    let at_rest = prepared.dwells.list.iter();
    let at_rest = at_rest.filter(|d| d.faults.accel.is_none() && d.raw[from].mean.is_finite());
    let poses: Vec<(Vector3<f64>, f64)> = at_rest
        .map(|dwell| {
            let raw = Vector3::from_fn(|i, _| dwell.raw[from + i].mean);
            (model.apply(&raw).normalize(), residual(dwell, accel))
        })
        .collect();
    if poses.is_empty() {
        return html! {};
    }
    let centres = [145.0, 145.0 + APART];
    let place = |(up, _): &(Vector3<f64>, f64)| {
        let below = usize::from(up.z < 0.0);
        // Equal-area projection: an area without poses appears in its true proportion.
        let distance = (1.0 - up.z.abs()).max(0.0).sqrt();
        let across = up.xy().norm().max(1e-9);
        let x = centres[below] + RADIUS * distance * up.x / across;
        let y = 118.0 - RADIUS * distance * up.y / across;
        (x, y)
    };
    let marks = |far: bool| {
        let ours = poses.iter().filter(move |p| (p.1 > FAR) == far);
        ours.fold(String::new(), |d, p| {
            let (x, y) = place(p);
            format!("{d}M{} {}h0", px(x), px(y))
        })
    };
    let far = poses.iter().filter(|p| p.1 > FAR).count();
    let drawn = html! {
        @for (centre, name) in centres.iter().zip(["z up", "z down"]) {
            circle class="sphere" cx=(px(*centre)) cy="118" r=(px(RADIUS)) {}
            circle class="sphere" cx=(px(*centre)) cy="118" r=(px(RADIUS * (1.0 - 0.5f64.sqrt()).sqrt())) {}
            path class="grid" d={ "M" (px(centre - RADIUS)) " 118h" (px(2.0 * RADIUS)) "M" (px(*centre)) " " (px(118.0 - RADIUS)) "v" (px(2.0 * RADIUS)) } {}
            text class="heading" x=(px(centre - RADIUS)) y="16" { (name) }
            text class="tick" x=(px(centre + RADIUS + 4.0)) y="122" { "+x" }
            text class="tick" x=(px(*centre)) y=(px(118.0 - RADIUS - 4.0)) text-anchor="middle" { "+y" }
        }
        path class="dot" d=(marks(false)) {}
        path class="far" d=(marks(true)) {}
    };
    let label = format!("{} poses on the sphere of directions", poses.len());
    html! { figure.whole {
        div.figures { (Panel::ONE.drawing(&label, None, &drawn)) }
        figcaption {
            (poses.len()) " poses: the direction that points up, in the body frame. Left: z upward, right: z downward; equal areas, with circles at 45° and 90° from z."
            @if accel.is_some() { " Orange: the residual is more than " (FAR) " times the noise (" (far) ")." }
        }
    } }
}

/// Largest residual of a dwell with all effects, relative to its noise.
fn residual(dwell: &Dwell, accel: Option<&Picture>) -> f64 {
    let middle_s = dwell.start_s + 0.5 * dwell.duration_s;
    let tracks = accel.into_iter().flat_map(|p| &p.tracks);
    let samples = tracks.flat_map(|t| &t.samples);
    let ours = samples.filter(|s| (s.t_s - middle_s).abs() < 0.25 * dwell.duration_s);
    ours.map(|s| (s.residual[1] / s.sigma).abs())
        .fold(0.0, f64::max)
}
