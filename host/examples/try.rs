use mimu::{dwell::Sensor, fit::*, recording::Recording};
fn main() {
    let a: Vec<String> = std::env::args().collect();
    let r = Recording::open(a[1].as_ref()).unwrap();
    let t = std::time::Instant::now();
    let still = a.get(2).map_or(10.0, |x| x.parse().unwrap());
    let p = Prepared::read(&r, still, |_| {}).unwrap();
    println!("read {:?}", t.elapsed());
    for (i, d) in p.dwells.list.iter().enumerate() {
        println!(
            "{i} {:.2}..{:.2} {:?} {:?}",
            d.start_s, d.last_s, d.gyro_fault, d.accel_fault
        );
    }
    let t = std::time::Instant::now();
    let f = fit(
        p,
        Options {
            method: Method::LeastSquares,
            holdout_blocks: 4,
            still_factor: still,
        },
    );
    println!("fit {:?}", t.elapsed());
    let f = f.unwrap();
    for w in &f.warnings {
        println!("W {w}");
    }
    for s in &f.sensors {
        println!(
            "{} {:?} rms {:.6} held {:?} floor {:.6} static {:?} cond {:.1}",
            s.sensor,
            s.figure,
            s.rms(),
            s.held_out_rms(),
            s.noise_floor(),
            s.static_rms,
            s.estimated.condition
        );
        if s.sensor == Sensor::Gyro {
            println!(
                " deg {:.4} {:?}",
                s.rms().to_degrees(),
                s.held_out_rms().map(f64::to_degrees)
            );
        }
        println!("{:?}", s.estimated.scatter);
        println!(
            "P {} b {}",
            s.estimated.triad.forward.matrix, s.estimated.triad.forward.offset
        );
        println!(
            "{:#?}",
            s.estimated.triad.physical(mimu::triad::Angles::Exact)
        );
        for w in &s.warnings {
            println!("W {w}");
        }
        if s.figure != Figure::Direction {
            for r in &s.residuals {
                println!(
                    "R {} {:.3} {:.3} fl {:.3}",
                    r.dwell,
                    1e3 * r.value.x,
                    r.held_out.map_or(f64::NAN, |h| 1e3 * h.x),
                    1e3 * r.floor
                );
            }
        }
    }
}
