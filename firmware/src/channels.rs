//! The channels of a sample, by name, and the order of their conversion.

/// Number of channels.
pub const CHANNELS: usize = 10;

/// One value of every channel.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Channels<T> {
    /// Rates of the gyros x, y, z.
    pub gyro: [T; 3],
    /// Accelerometer x, y, z.
    pub accel: [T; 3],
    /// Temperatures of the gyros x, y, z.
    pub temperature: [T; 3],
    /// The 2.5 V reference of gyro x.
    pub reference: T,
}

impl<T> Channels<T> {
    /// Applies `f` to every channel.
    pub fn map<U>(self, mut f: impl FnMut(T) -> U) -> Channels<U> {
        Channels {
            gyro: self.gyro.map(&mut f),
            accel: self.accel.map(&mut f),
            temperature: self.temperature.map(&mut f),
            reference: f(self.reference),
        }
    }
}

// The order of conversion, in both directions. The three axes of a triad are adjacent: neighbours are 50 µs apart, which at the gyro's 40
// Hz is 0.7 degrees of phase.
impl<T: Copy> Channels<T> {
    /// The channels of a scan.
    pub const fn from_scan_order(scan: [T; CHANNELS]) -> Self {
        let [gx, gy, gz, ax, ay, az, tx, ty, tz, reference] = scan;
        Self {
            gyro: [gx, gy, gz],
            accel: [ax, ay, az],
            temperature: [tx, ty, tz],
            reference,
        }
    }

    /// Their values in the order of a scan.
    pub const fn in_scan_order(&self) -> [T; CHANNELS] {
        let Self {
            gyro: [gx, gy, gz],
            accel: [ax, ay, az],
            temperature: [tx, ty, tz],
            reference,
        } = *self;
        [gx, gy, gz, ax, ay, az, tx, ty, tz, reference]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_scan_begins_with_the_gyros_and_ends_with_their_reference() {
        let scan = core::array::from_fn(|place| place);
        let channels = Channels::from_scan_order(scan);
        assert_eq!(channels.gyro, [0, 1, 2]);
        assert_eq!(channels.accel, [3, 4, 5]);
        assert_eq!(channels.temperature, [6, 7, 8]);
        assert_eq!(channels.reference, 9);
        assert_eq!(channels.in_scan_order(), scan);
    }
}
