//! Nodes over temperature as bytes.

use nalgebra::Vector3;

use super::bytes::{Reader, TooLong, Writer};
use super::{NODES, StoredError};
use crate::PerSensor;
use crate::compensation::{Affine, Compensation};
use crate::die::DieLag;
use crate::table::{self, Node, Table};

/// The thermometer is the mean of the gyros' TEMP pins.
pub(super) const TEMP_PINS: u8 = 0;
/// Number of bytes before the first node: range and lags.
pub(super) const BEFORE_NODES: usize = 8 + 8;
const RANGE_KNOWN: u8 = 1;
const LAGS_KNOWN: u8 = 1 << 1;

/// Compensation over temperature, to be written.
#[derive(Debug, Clone, Copy)]
pub struct Curves<'a> {
    /// In the order of their temperatures.
    pub nodes: &'a [Node<f32>],
    /// Temperature range of the dies from which they were found, °C.
    pub range_c: Option<[f32; 2]>,
    /// Lags of the dies behind the thermometer, s; negative: they lead.
    pub lags_s: Option<PerSensor<f32>>,
}

impl<'a> Curves<'a> {
    /// These nodes, with unknown range and unknown lags.
    pub const fn of(nodes: &'a [Node<f32>]) -> Self {
        Self {
            nodes,
            range_c: None,
            lags_s: None,
        }
    }

    /// Bits that say which fields are known.
    pub(super) fn known(&self) -> u8 {
        let bit = |known: bool, bit: u8| if known { bit } else { 0 };
        bit(self.range_c.is_some(), RANGE_KNOWN) | bit(self.lags_s.is_some(), LAGS_KNOWN)
    }

    pub(super) fn write(&self, to: &mut Writer<'_>) -> Result<(), TooLong> {
        let lags_s = self.lags_s.unwrap_or_default();
        let range_c = self.range_c.unwrap_or_default();
        for value in range_c.into_iter().chain([lags_s.gyro, lags_s.accel]) {
            to.f32(value)?;
        }
        for node in self.nodes {
            to.f32(node.temp_c)?;
            for triad in [
                &node.model.gyro,
                &node.model.accel,
                &node.slope.gyro,
                &node.slope.accel,
            ] {
                to.matrix(&triad.matrix)?;
                triad.offset.iter().try_for_each(|v| to.f32(*v))?;
            }
        }
        Ok(())
    }
}

/// Fields before the nodes.
#[derive(Debug, Clone, Copy)]
pub(super) struct Head {
    /// Number of nodes.
    pub nodes: u8,
    /// As in the layout.
    pub thermometer: u8,
    /// Bits that say which fields are known.
    pub known: u8,
}

/// Reads range, lags and nodes; returns the table and the lags.
pub(super) fn read(
    from: &mut Reader<'_>,
    head: Head,
    show: impl FnMut(&Node<f32>),
) -> Result<(Table<f32, NODES>, Option<PerSensor<f32>>), StoredError> {
    let mut number = || from.f32().ok_or(StoredError::Length);
    let range_c = [number()?, number()?];
    let lags_s = PerSensor::from([number()?, number()?]);
    let table = read_nodes(from, head.nodes, show)?;
    if head.known & !(RANGE_KNOWN | LAGS_KNOWN) != 0 {
        return Err(StoredError::Header);
    }
    let known = |bit: u8| head.known & bit != 0;
    let no_lags = lags_s.map(DieLag::new).transpose().is_none();
    let no_range = !range_c.into_iter().all(table::is_temperature);
    if head.thermometer != TEMP_PINS
        || known(LAGS_KNOWN) && no_lags
        || known(RANGE_KNOWN) && no_range
    {
        return Err(StoredError::Temperature);
    }
    let table = match known(RANGE_KNOWN) {
        true => table
            .with_range(range_c)
            .map_err(|_| StoredError::Temperature)?,
        false => table,
    };
    Ok((table, known(LAGS_KNOWN).then_some(lags_s)))
}

fn read_nodes(
    from: &mut Reader<'_>,
    count: u8,
    mut show: impl FnMut(&Node<f32>),
) -> Result<Table<f32, NODES>, StoredError> {
    let (mut short, mut wrong) = (false, None);
    let read = (0..count).map_while(|at| {
        let node = node(from);
        short |= node.is_none();
        if node.as_ref().is_some_and(|node| !is_plausible(node)) {
            wrong = wrong.or(Some(at));
        }
        node.inspect(&mut show)
    });
    let table = Table::new(read);
    if short {
        return Err(StoredError::Length);
    }
    if let Some(at) = wrong {
        return Err(StoredError::Node { at });
    }
    table.map_err(|refused| match refused {
        table::TableError::Count => StoredError::Node { at: count },
        table::TableError::Order(at) | table::TableError::NotFinite(at) => {
            StoredError::Node { at: at as u8 }
        }
        table::TableError::Range => StoredError::Temperature,
    })
}

fn is_plausible(node: &Node<f32>) -> bool {
    let Node {
        temp_c,
        model,
        slope,
    } = node;
    table::is_temperature(*temp_c)
        && model.gyro.check(Some(&slope.gyro)).is_ok()
        && model.accel.check(Some(&slope.accel)).is_ok()
}

fn node(from: &mut Reader<'_>) -> Option<Node<f32>> {
    Some(Node {
        temp_c: from.f32()?,
        model: compensation(from)?,
        slope: compensation(from)?,
    })
}

fn compensation(from: &mut Reader<'_>) -> Option<Compensation<f32>> {
    Some(Compensation {
        gyro: affine(from)?,
        accel: affine(from)?,
    })
}

fn affine(from: &mut Reader<'_>) -> Option<Affine<f32>> {
    Some(Affine {
        matrix: from.matrix()?,
        offset: Vector3::new(from.f32()?, from.f32()?, from.f32()?),
    })
}
