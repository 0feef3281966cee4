//! A regressor as data: what an error of one axis is proportional to.
//!
//! Its value, unit, formula, what it depends on and how often the device has to evaluate it all follow from the same few numbers, so an effect states
//! its law once.

use super::quantity::{Conditions, Need, Quantity};
use crate::quantity::Sensor;

/// A product of powers of up to three quantities, with a sign.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Product {
    /// 1 or -1.
    pub sign: f64,
    /// Quantities with their powers, in the order of the product. A power of 0 marks an unused place.
    pub factors: [(Quantity, u8); 3],
}

impl Product {
    /// A power of one quantity.
    pub const fn power(of: Quantity, power: u8) -> Self {
        let none = (of, 0);
        Self {
            sign: 1.0,
            factors: [(of, power), none, none],
        }
    }

    /// The product of two quantities.
    pub const fn of(first: Quantity, second: Quantity) -> Self {
        Self {
            sign: 1.0,
            factors: [(first, 1), (second, 1), (first, 0)],
        }
    }

    /// The same with the other sign.
    pub const fn negative(self) -> Self {
        Self {
            sign: -self.sign,
            ..self
        }
    }

    /// The product of one to three quantities in ascending order, each as often as it occurs in the list; `None` for any other list.
    pub fn term(quantities: &[Quantity]) -> Option<Self> {
        let mut parts: Vec<(Quantity, u8)> = Vec::new();
        for q in quantities {
            match parts.last_mut() {
                Some((last, power)) if last == q => *power += 1,
                _ => parts.push((*q, 1)),
            }
        }
        let none = (*quantities.first()?, 0);
        (quantities.len() <= 3 && quantities.is_sorted()).then(|| Self {
            sign: 1.0,
            factors: std::array::from_fn(|k| parts.get(k).copied().unwrap_or(none)),
        })
    }

    /// All terms up to third order, each once.
    pub fn terms() -> Vec<Self> {
        let q = Quantity::OF_TERMS;
        let mut all = Vec::new();
        for i in 0..q.len() {
            all.extend(Self::term(&[q[i]]));
            for j in i..q.len() {
                all.extend(Self::term(&[q[i], q[j]]));
                for k in j..q.len() {
                    all.extend(Self::term(&[q[i], q[j], q[k]]));
                }
            }
        }
        all
    }

    /// Its quantities with their powers.
    pub fn parts(&self) -> impl Iterator<Item = (Quantity, u8)> + '_ {
        self.factors.iter().copied().filter(|f| f.1 > 0)
    }

    /// How many quantities are multiplied, powers counted.
    pub fn order(&self) -> u8 {
        self.factors.iter().map(|f| f.1).sum()
    }

    /// Its value in the error of sensor axis `axis`, SI.
    pub fn value(&self, at: &Conditions, axis: usize) -> f64 {
        let powers = self.parts().map(|(q, p)| q.of(at, axis).powi(i32::from(p)));
        powers.fold(self.sign, |product, v| product * v)
    }

    /// Name of a term: `rate_x*force_y`, `force_z^2`. Quantities that terms do not contain are left out.
    pub fn name(&self) -> String {
        let written = self.parts().filter_map(|(q, p)| {
            let name = q.name()?;
            Some(match p {
                1 => name,
                p => format!("{name}^{p}"),
            })
        });
        written.collect::<Vec<_>>().join("*")
    }

    /// Unit of the coefficient of a term in an error of `sensor`.
    pub fn term_unit(&self, sensor: Sensor) -> String {
        let each = self.parts().flat_map(|(q, p)| {
            let unit = match q {
                Quantity::Rate(_) | Quantity::Force(_) => format!("({})", q.unit(sensor)),
                q => q.unit(sensor).into(),
            };
            std::iter::repeat_n(unit, usize::from(p))
        });
        let units: Vec<String> = each.collect();
        format!("{}/({})", sensor.unit(), units.join("*"))
    }

    /// Unit of the coefficient of an effect of `sensor`.
    ///
    /// An input of the sensor itself cancels the unit of the error; along a body axis it leaves an angle, as for a misalignment. Beside metres
    /// radians are dropped: rate squared times an arm is an acceleration.
    fn unit(&self, sensor: Sensor) -> String {
        let count = |of: &dyn Fn(Quantity) -> bool| -> u8 {
            self.parts().filter(|(q, _)| of(*q)).map(|(_, p)| p).sum()
        };
        let own = count(&|q| q.is_input_of(sensor));
        let rates = count(&|q| q.unit(sensor) == "rad/s");
        let angular = count(&|q| q.unit(sensor) == "rad/s^2");
        if sensor == Sensor::Accel && own == 0 && (rates == 2 || angular == 1) {
            return "m".into();
        }
        let kelvins = count(&|q| q.unit(sensor) == "K");
        let seconds = count(&|q| q.unit(sensor) == "s");
        let across = self
            .parts()
            .any(|(q, _)| matches!(q, Quantity::Rate(_) | Quantity::Force(_)));
        let (base, first) = sensor.pick(("rad/s", 1), ("m/s^2", 2));
        let mut unit = match (own, seconds) {
            (1, _) if across && kelvins > 0 => "rad".to_string(),
            (1.., _) => "1".into(),
            (0, 0) => base.into(),
            (0, n) => format!("{}^{}", base.split('^').next().unwrap_or(base), first + n),
        };
        let mut over = |of: &str, power: u8| match power {
            0 => {}
            1 => unit += &format!("/{of}"),
            p => unit += &format!("/{of}^{p}"),
        };
        let other = sensor.pick(
            ("(m/s^2)", count(&|q| q.unit(sensor) == "m/s^2")),
            ("(rad/s)", rates),
        );
        over(other.0, other.1);
        over(&format!("({base})"), own.saturating_sub(1));
        over("K", kelvins);
        unit
    }
}

/// The function that an error of one axis is proportional to. The *parameter* is the nonlinear parameter of the effect.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Regressor {
    /// A product.
    Product(Product),
    /// The sum of two.
    Sum(Product, Product),
    /// The absolute value of a quantity.
    Absolute(Quantity),
    /// exp(-quantity / parameter).
    Decay(Quantity),
    /// ln(1 + quantity / parameter).
    Logarithm(Quantity),
    /// 1 from a time of a recording on, 0 before and in the others.
    Since {
        /// Index of the recording.
        session: usize,
        /// Time, s since it began.
        t_s: f64,
    },
}

impl Regressor {
    /// A quantity itself.
    pub const fn linear(of: Quantity) -> Self {
        Self::power(of, 1)
    }

    /// A power of a quantity.
    pub const fn power(of: Quantity, power: u8) -> Self {
        Self::Product(Product::power(of, power))
    }

    /// Its value in the error of sensor axis `axis`, SI.
    pub fn value(&self, at: &Conditions, parameter: f64, axis: usize) -> f64 {
        match self {
            Self::Product(product) => product.value(at, axis),
            Self::Sum(a, b) => a.value(at, axis) + b.value(at, axis),
            Self::Absolute(q) => q.of(at, axis).abs(),
            Self::Decay(q) => (-q.of(at, axis) / parameter).exp(),
            Self::Logarithm(q) => (q.of(at, axis) / parameter).ln_1p(),
            Self::Since { session, t_s } => {
                f64::from(u8::from(at.session == *session && at.t_s >= *t_s))
            }
        }
    }

    /// The products that it consists of. An absolute value, a decay and a logarithm count as the first power of their quantity.
    fn products(&self) -> [Option<Product>; 2] {
        match self {
            Self::Product(product) => [Some(*product), None],
            Self::Sum(a, b) => [Some(*a), Some(*b)],
            Self::Absolute(q) | Self::Decay(q) | Self::Logarithm(q) => {
                [Some(Product::power(*q, 1)), None]
            }
            Self::Since { .. } => [None; 2],
        }
    }

    /// Its quantities, each once, in ascending order.
    pub fn quantities(&self) -> Vec<Quantity> {
        let products = self.products();
        let each = products
            .iter()
            .flatten()
            .flat_map(|p| p.parts().map(|(q, _)| q));
        let mut all: Vec<Quantity> = each.collect();
        all.sort_unstable();
        all.dedup();
        all
    }

    /// Whether `other` is a higher power of the quantity that this one is proportional to.
    pub(crate) fn is_slope_of(&self, other: &Self) -> bool {
        let (Self::Product(slope), Self::Product(other)) = (self, other) else {
            return false;
        };
        let (mut a, mut b) = (slope.parts(), other.parts());
        match (a.next(), a.next(), b.next(), b.next()) {
            (Some((p, 1)), None, Some((q, 2..)), None) => p == q,
            _ => false,
        }
    }

    /// Whether it equals `term` in an error of `axis` of `sensor`. The input along a sensitive direction counts as that along the body axis, from
    /// which it differs by the misalignment.
    pub(crate) fn is_on_axis(&self, term: &Product, axis: usize, sensor: Sensor) -> bool {
        let Self::Product(own) = self else {
            return false;
        };
        let along = sensor.pick(Quantity::Rate(axis), Quantity::Force(axis));
        let of_body = |product: &Product| {
            let parts = product.parts().map(|(q, p)| match q {
                Quantity::Input => (along, p),
                // The two times differ by a constant, so the errors differ by a bias.
                Quantity::SessionTime => (Quantity::Time, p),
                q => (q, p),
            });
            let mut all: Vec<(Quantity, u8)> = parts.collect();
            all.sort_unstable();
            all
        };
        of_body(own) == of_body(term)
    }

    /// Whether it depends on temperature or time.
    pub fn is_slow(&self) -> bool {
        matches!(self, Self::Since { .. }) || self.quantities().iter().any(|q| q.is_slow())
    }

    /// Whether the device can fold it into a bias or a matrix: beside factors that change only with temperature and time it has at most one, an input
    /// of the sensor.
    pub fn folds(&self, sensor: Sensor) -> bool {
        let fast = |p: &Product| -> Vec<(Quantity, u8)> {
            p.parts().filter(|(q, _)| !q.is_slow()).collect()
        };
        let products = self.products();
        self.is_slow()
            && products.iter().flatten().all(|p| match fast(p)[..] {
                [] => true,
                [(q, 1)] => q.is_input_of(sensor),
                _ => false,
            })
    }

    /// Whether `need` has to be known to compute it, in an error of `sensor`.
    pub(crate) fn needs(&self, need: Need, sensor: Sensor) -> bool {
        self.quantities().iter().any(|q| q.needs(need, sensor))
    }

    /// SI unit of its coefficient in an error of `sensor`.
    pub fn unit(&self, sensor: Sensor) -> String {
        match self {
            Self::Product(product) | Self::Sum(product, _) => product.unit(sensor),
            Self::Absolute(q) => Product::power(*q, 1).unit(sensor),
            Self::Decay(_) | Self::Logarithm(_) | Self::Since { .. } => sensor.unit().into(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_term_up_to_third_order_is_there_once() {
        // Nine quantities: 9 + 45 + 165.
        let all = Product::terms();
        let mut names: Vec<String> = all.iter().map(Product::name).collect();
        names.sort();
        names.dedup();
        assert_eq!((all.len(), names.len()), (219, 219));
        assert!(names.contains(&"rate_x*force_y^2".into()));
    }

    #[test]
    fn units_of_coefficients_follow_from_the_quantities() {
        use Quantity::{AngularAcceleration, Force, Input, Rate, Temperature, Time};
        let of = |sensor, p: Product| Regressor::Product(p).unit(sensor);
        let power = Product::power;
        for (sensor, product, unit) in [
            (Sensor::Gyro, power(Force(1), 1), "rad/s/(m/s^2)"),
            (Sensor::Gyro, power(Force(1), 2), "rad/s/(m/s^2)^2"),
            (Sensor::Gyro, power(Input, 3), "1/(rad/s)^2"),
            (Sensor::Gyro, power(Time, 1), "rad/s^2"),
            (Sensor::Accel, power(Time, 1), "m/s^3"),
            (Sensor::Accel, power(Temperature, 2), "m/s^2/K^2"),
            (Sensor::Accel, Product::of(Temperature, Input), "1/K"),
            (Sensor::Gyro, Product::of(Temperature, Rate(1)), "rad/K"),
            (Sensor::Accel, Product::of(Rate(0), Rate(1)), "m"),
            (Sensor::Accel, power(AngularAcceleration(2), 1), "m"),
        ] {
            assert_eq!(of(sensor, product), unit, "{product:?}");
        }
        assert_eq!(Regressor::Absolute(Input).unit(Sensor::Gyro), "1");
        assert_eq!(Regressor::Decay(Time).unit(Sensor::Accel), "m/s^2");
        let term = Product::term(&[Rate(0), Force(1), Force(1)]).unwrap();
        assert_eq!(
            term.term_unit(Sensor::Gyro),
            "rad/s/((rad/s)*(m/s^2)*(m/s^2))"
        );
    }
}
