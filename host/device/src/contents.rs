//! What stands in a stored calibration, for people: the numbers of the layout of [`mimu_core::stored`], which the device turns into
//! what it computes with and does not give back.

use mimu_core::stored::{self, Refused};

use mimu::effects::converter::BITS;

/// A stored calibration, number by number.
#[derive(Debug, Clone, PartialEq)]
pub struct Contents {
    /// Sensitive directions of gyro and accelerometer in the body frame, by rows, and their inverse: of the calibration that the
    /// effects were found with.
    pub directions: [[[[f32; 3]; 3]; 2]; 2],
    /// Temperature nodes, the coldest first.
    pub nodes: Vec<NodeContents>,
    /// What the affine model lacks.
    pub effects: Vec<EffectContents>,
}

/// A temperature node: `x = C u + o`, raw to SI, u in V at the sensors.
#[derive(Debug, Clone, PartialEq)]
pub struct NodeContents {
    /// °C.
    pub temp_c: f32,
    /// C of gyro and accelerometer, rad/s and m/s² per V, by rows.
    pub c: [[[f32; 3]; 3]; 2],
    /// o of both, rad/s and m/s².
    pub o: [[f32; 3]; 2],
}

/// An effect, SI.
#[derive(Debug, Clone, PartialEq)]
pub struct EffectContents {
    /// Public id; of a term in the form `term:accel_y~rate_x*force_y`.
    pub id: String,
    /// All of its coefficients.
    pub coefficients: Vec<f32>,
    /// Time constant, s, of an effect that has one.
    pub time_constant_s: Option<f32>,
    /// Of errors by the code.
    pub converter: Option<ConverterContents>,
}

/// A converter.
#[derive(Debug, Clone, PartialEq)]
pub struct ConverterContents {
    /// Axes that it reads: x, y, z or xyz.
    pub axes: &'static str,
    /// Weight of its first bit, V.
    pub weight_of_bit_0_v: f32,
    /// Reading of its code 0, V.
    pub reading_of_code_0_v: f32,
}

/// Bytes of the layout that are read with the others before them.
struct Rest<'a>(&'a [u8]);

impl Rest<'_> {
    fn take<const N: usize>(&mut self) -> Option<[u8; N]> {
        let (taken, rest) = self.0.split_first_chunk::<N>()?;
        self.0 = rest;
        Some(*taken)
    }

    fn f32(&mut self) -> Option<f32> {
        self.take().map(f32::from_le_bytes)
    }

    fn significant(&mut self) -> Option<[f32; 3]> {
        Some([self.f32()?, self.f32()?, self.f32()?])
    }

    fn matrix(&mut self) -> Option<[[f32; 3]; 3]> {
        Some([
            self.significant()?,
            self.significant()?,
            self.significant()?,
        ])
    }

    fn node(&mut self) -> Option<NodeContents> {
        let temp_c = self.f32()?;
        let (gyro_c, gyro_o) = (self.matrix()?, self.significant()?);
        let (accel_c, accel_o) = (self.matrix()?, self.significant()?);
        Some(NodeContents {
            temp_c,
            c: [gyro_c, accel_c],
            o: [gyro_o, accel_o],
        })
    }

    fn effect(&mut self) -> Option<EffectContents> {
        match self.take()? {
            [0] => self.named(),
            [1] => self.term(),
            _ => self.code(),
        }
    }

    fn named(&mut self) -> Option<EffectContents> {
        let [length] = self.take()?;
        let (id, rest) = self.0.split_at_checked(usize::from(length))?;
        self.0 = rest;
        let [count] = self.take()?;
        Some(EffectContents {
            coefficients: (0..count).map(|_| self.f32()).collect::<Option<_>>()?,
            time_constant_s: Some(self.f32()?).filter(|form| *form != 0.0),
            id: String::from_utf8_lossy(id).into_owned(),
            converter: None,
        })
    }

    fn code(&mut self) -> Option<EffectContents> {
        let [triad, axis] = self.take()?;
        let converter = ConverterContents {
            axes: ["x", "y", "z", "xyz"].get(usize::from(axis))?,
            weight_of_bit_0_v: self.f32()?,
            reading_of_code_0_v: self.f32()?,
        };
        Some(EffectContents {
            id: format!("{}_readout_code", SENSORS.get(usize::from(triad))?),
            coefficients: (0..BITS).map(|_| self.f32()).collect::<Option<_>>()?,
            time_constant_s: None,
            converter: Some(converter),
        })
    }

    fn term(&mut self) -> Option<EffectContents> {
        let [triad, axis, count] = self.take()?;
        let mut names: Vec<&str> = Vec::new();
        for _ in 0..count {
            let [variable] = self.take()?;
            names.push(VARIABLES.get(usize::from(variable).checked_sub(1)?)?);
        }
        let sensor = SENSORS.get(usize::from(triad))?;
        let axis = ["x", "y", "z"].get(usize::from(axis))?;
        Some(EffectContents {
            id: format!("term:{sensor}_{axis}~{}", names.join("*")),
            coefficients: vec![self.f32()?],
            time_constant_s: None,
            converter: None,
        })
    }
}

const SENSORS: [&str; 2] = ["gyro", "accel"];

/// By the numbers of [`mimu_core::effects::Variable`], which begin at 1.
const VARIABLES: [&str; 9] = [
    "rate_x",
    "rate_y",
    "rate_z",
    "force_x",
    "force_y",
    "force_z",
    "temp",
    "temp_rate",
    "time",
];

/// What stands in `bytes`. Refused where the device would refuse it.
pub fn contents(bytes: &[u8]) -> Result<Contents, Refused> {
    stored::decode(bytes)?;
    read(bytes).ok_or(Refused::Length)
}

fn read(bytes: &[u8]) -> Option<Contents> {
    let (_magic, rest) = bytes.split_first_chunk::<4>()?;
    let mut rest = Rest(rest);
    let [_version, _length] = [rest.take::<2>()?, rest.take::<2>()?];
    let [nodes, effects, ..] = rest.take::<4>()?;
    Some(Contents {
        directions: [
            [rest.matrix()?, rest.matrix()?],
            [rest.matrix()?, rest.matrix()?],
        ],
        nodes: (0..nodes).map(|_| rest.node()).collect::<Option<_>>()?,
        effects: (0..effects).map(|_| rest.effect()).collect::<Option<_>>()?,
    })
}
