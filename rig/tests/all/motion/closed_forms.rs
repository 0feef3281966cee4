//! Cones and pendulums: chains of frames with known answers.

use std::f64::consts::TAU;

use mimu_rig::chain::{Frame, Jet};
use mimu_rig::place::Place;
use mimu_rig::rotation::{Rotation, norm};

use super::assert_near;

/// A place on an Earth without rotation.
fn standstill(gravity: f64) -> Place {
    Place {
        rotation: 0.0,
        ..Place::new(0.0, Some(gravity))
    }
}

/// Classical coning: body z describes a cone of half-angle `a` at `frequency` rad/s, without a rotation of the body about the vertical.
fn cone(a: f64, frequency: f64, t: f64) -> Frame {
    let turn = |sign: f64| Jet {
        value: sign * frequency * t,
        rate: sign * frequency,
        acceleration: 0.0,
    };
    Frame::ground(&standstill(0.0))
        .about_own::<2>(turn(1.0))
        .about_own::<0>(Jet::constant(a))
        .about_own::<2>(turn(-1.0))
}

#[test]
fn a_cone_makes_the_axial_rate_add_up_to_its_solid_angle_while_the_attitude_comes_back() {
    // Goodman and Robinson 1958: over one turn of the cone, the integral of the axial rate is the enclosed solid angle.
    let (a, frequency) = (0.2_f64, TAU * 3.0);
    let n = 200_000;
    let dt = TAU / frequency / f64::from(n);
    let start = cone(a, frequency, 0.0).attitude;
    let mut integrated = start;
    let mut axial = 0.0;
    for k in 0..n {
        let rate = cone(a, frequency, (f64::from(k) + 0.5) * dt).rate;
        axial += rate[2] * dt;
        integrated = integrated * Rotation::about(rate, norm(rate) * dt);
    }
    let solid_angle = TAU * (1.0 - a.cos());
    assert!((axial + solid_angle).abs() < 1e-9, "{axial}");
    let (_, left) = (integrated.inverse() * start).axis_angle();
    assert!(left < 1e-8, "{left}");
}

#[test]
fn a_pendulum_feels_gravity_and_its_swing_along_the_rod_and_nothing_across() {
    // Rod of length L from a pivot, body z along the rod towards the pivot, swing about x: L φ'' = -g sin φ, and from the energy L φ'² / 2 = g (cos φ
    // - cos φ0). The point mass hangs freely, so it senses nothing across the rod.
    let (g, length, start) = (9.81, 0.7, 1.2_f64);
    let place = standstill(g);
    for phi in [1.2_f64, 0.9, 0.3, 0.0, -0.5, -1.2] {
        let rate = -(2.0 * g / length * (phi.cos() - start.cos()))
            .max(0.0)
            .sqrt();
        let angle = Jet {
            value: phi,
            rate,
            acceleration: -g / length * phi.sin(),
        };
        let body = Frame::ground(&place).about_own::<0>(angle);
        let motion = body.motion(0.0, &place, [0.0, 0.0, -length], [Jet::default(); 3]);
        let along = g * phi.cos() + length * rate * rate;
        assert_near(motion.force, [0.0, 0.0, along], 1e-12);
        // At the lowest point, by energy: g (3 - 2 cos φ0).
        if phi == 0.0 {
            assert!((along - g * (3.0 - 2.0 * start.cos())).abs() < 1e-12);
        }
    }
}
