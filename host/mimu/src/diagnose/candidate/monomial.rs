//! Terms found from the data: products of what was recorded.

use crate::diagnose::effect::Moment;
use crate::quantity::AXES;
use crate::quantity::Sensor;

/// A quantity that terms are products of.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Variable {
    /// Rate about a body axis.
    Rate(usize),
    /// Specific force along a body axis.
    Force(usize),
    /// Temperature.
    Temperature,
    /// Its rate of change, behind a lag of [`RATE_LAG_S`]: unfiltered it would be noise.
    TemperatureRate,
    /// Time since power-on, or since the recording began where nobody knows.
    Time,
}

/// Lag of the filter that the rate of change of the temperature is taken by, s.
pub const RATE_LAG_S: f64 = 30.0;

impl Variable {
    /// All of them.
    pub const ALL: [Self; 9] = [
        Self::Rate(0),
        Self::Rate(1),
        Self::Rate(2),
        Self::Force(0),
        Self::Force(1),
        Self::Force(2),
        Self::Temperature,
        Self::TemperatureRate,
        Self::Time,
    ];

    /// Name.
    pub fn name(self) -> String {
        match self {
            Self::Rate(i) => format!("rate_{}", AXES[i]),
            Self::Force(i) => format!("force_{}", AXES[i]),
            Self::Temperature => "temp".into(),
            Self::TemperatureRate => "temp_rate".into(),
            Self::Time => "time".into(),
        }
    }

    /// SI unit.
    pub fn unit(self) -> &'static str {
        match self {
            Self::Rate(_) => "(rad/s)",
            Self::Force(_) => "(m/s^2)",
            Self::Temperature => "K",
            Self::TemperatureRate => "(K/s)",
            Self::Time => "s",
        }
    }

    /// Its value, SI; of the temperature rate that of moments behind a lag of [`RATE_LAG_S`].
    fn of(self, at: &Moment) -> f64 {
        match self {
            Self::Rate(i) => at.rate[i],
            Self::Force(i) => at.force[i],
            Self::Temperature => at.warm_c,
            Self::TemperatureRate => (at.warm_c - at.late_c) / RATE_LAG_S,
            Self::Time => at.on_s,
        }
    }
}

/// A product of one to three variables.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Monomial(pub Vec<Variable>);

impl Monomial {
    /// All up to third order, each once.
    pub fn all() -> Vec<Self> {
        let v = Variable::ALL;
        let mut all = Vec::new();
        for i in 0..v.len() {
            all.push(Self(vec![v[i]]));
            for j in i..v.len() {
                all.push(Self(vec![v[i], v[j]]));
                for k in j..v.len() {
                    all.push(Self(vec![v[i], v[j], v[k]]));
                }
            }
        }
        all
    }

    /// Name: `rate_x*force_y`, `force_z^2`.
    pub fn name(&self) -> String {
        let mut parts: Vec<(Variable, usize)> = Vec::new();
        for v in &self.0 {
            match parts.last_mut() {
                Some((last, n)) if last == v => *n += 1,
                _ => parts.push((*v, 1)),
            }
        }
        let written = parts.iter().map(|(v, n)| match n {
            1 => v.name(),
            n => format!("{}^{n}", v.name()),
        });
        written.collect::<Vec<_>>().join("*")
    }

    /// Its value, SI.
    pub fn value(&self, at: &Moment) -> f64 {
        self.0.iter().map(|v| v.of(at)).product()
    }

    /// Largest value that it could have in `moments`: all of its variables at their largest together.
    pub fn largest(&self, moments: &[Moment]) -> f64 {
        let most = |v: &Variable| {
            let sizes = moments.iter().map(|at| v.of(at).abs());
            sizes.filter(|s| s.is_finite()).fold(0.0, f64::max)
        };
        self.0.iter().map(most).product()
    }

    /// Unit of its coefficient in an error of `sensor`.
    pub fn unit(&self, sensor: Sensor) -> String {
        let units: Vec<&str> = self.0.iter().map(|v| v.unit()).collect();
        format!("{}/({})", sensor.unit(), units.join("*"))
    }

    /// Whether it takes the temperature behind a lag.
    pub(super) fn lags(&self) -> bool {
        self.0.contains(&Variable::TemperatureRate)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_monomial_up_to_third_order_is_there_once() {
        // Nine variables: 9 + 45 + 165.
        let all = Monomial::all();
        let mut names: Vec<String> = all.iter().map(Monomial::name).collect();
        names.sort();
        names.dedup();
        assert_eq!((all.len(), names.len()), (219, 219));
        assert!(names.contains(&"rate_x*force_y^2".into()));
    }
}
