//! Nodes over temperature as bytes.

use nalgebra::Vector3;

use super::bytes::{Reader, TooLong, Writer};
use super::{NODES, Refused};
use crate::compensation::{Affine, Compensation};
use crate::die::DieLag;
use crate::table::{self, Node, Table};

/// The thermometer is the mean of the gyros' TEMP pins.
pub(super) const TEMP_PINS: u8 = 0;
const RANGE_KNOWN: u8 = 1;
const LAG_KNOWN: u8 = 1 << 1;

/// Compensation over temperature as it is written.
#[derive(Debug, Clone, Copy)]
pub struct Curves<'a> {
    /// In the order of their temperatures.
    pub nodes: &'a [Node<f32>],
    /// Dies' temperatures that they were found from, °C.
    pub range_c: Option<[f32; 2]>,
    /// Lag of the dies behind the thermometer, s; negative: they lead.
    pub lag_s: Option<f32>,
}

impl<'a> Curves<'a> {
    /// These nodes, of no known range and no known lag.
    pub const fn of(nodes: &'a [Node<f32>]) -> Self {
        Self {
            nodes,
            range_c: None,
            lag_s: None,
        }
    }

    /// Bits of what is known.
    pub(super) fn known(&self) -> u8 {
        let bit = |known: bool, bit: u8| if known { bit } else { 0 };
        bit(self.range_c.is_some(), RANGE_KNOWN) | bit(self.lag_s.is_some(), LAG_KNOWN)
    }

    pub(super) fn write(&self, to: &mut Writer<'_>) -> Result<(), TooLong> {
        let [from_c, to_c] = self.range_c.unwrap_or_default();
        to.f32(from_c)?;
        to.f32(to_c)?;
        to.f32(self.lag_s.unwrap_or_default())?;
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

/// Range, lag and nodes.
pub(super) fn read(
    from: &mut Reader<'_>,
    nodes: u8,
    thermometer: u8,
    known: u8,
    show: impl FnMut(&Node<f32>),
) -> Result<(Table<f32, NODES>, Option<f32>), Refused> {
    let mut number = || from.f32().ok_or(Refused::Length);
    let (range_c, lag_s) = ([number()?, number()?], number()?);
    let table = read_nodes(from, nodes, true, show)?;
    let known = |bit: u8| known & bit != 0;
    if thermometer != TEMP_PINS || known(LAG_KNOWN) && DieLag::new(lag_s).is_none() {
        return Err(Refused::Temperature);
    }
    let table = match known(RANGE_KNOWN) {
        true => table
            .with_range(range_c)
            .map_err(|_| Refused::Temperature)?,
        false => table,
    };
    Ok((table, known(LAG_KNOWN).then_some(lag_s)))
}

/// Nodes of a version without derivatives.
pub(super) fn read_straight(
    from: &mut Reader<'_>,
    nodes: u8,
    show: impl FnMut(&Node<f32>),
) -> Result<Table<f32, NODES>, Refused> {
    Ok(read_nodes(from, nodes, false, show)?.with_straight_lines())
}

fn read_nodes(
    from: &mut Reader<'_>,
    count: u8,
    slopes: bool,
    mut show: impl FnMut(&Node<f32>),
) -> Result<Table<f32, NODES>, Refused> {
    let mut short = false;
    let read = (0..count).map_while(|_| {
        let node = node(from, slopes);
        short |= node.is_none();
        node.inspect(&mut show)
    });
    let table = Table::new(read);
    if short {
        return Err(Refused::Length);
    }
    table.map_err(|refused| match refused {
        table::Refused::Count => Refused::Node { at: count },
        table::Refused::Order(at) | table::Refused::NotFinite(at) => Refused::Node { at: at as u8 },
        table::Refused::Range => Refused::Temperature,
    })
}

fn node(from: &mut Reader<'_>, slopes: bool) -> Option<Node<f32>> {
    let temp_c = from.f32()?;
    let model = compensation(from)?;
    match slopes {
        true => Some(Node {
            temp_c,
            model,
            slope: compensation(from)?,
        }),
        false => Some(Node::constant(temp_c, model)),
    }
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
