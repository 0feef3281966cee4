//! The presets. To add a maker, add an entry here and a line in the table of `docs/import.md`.

use super::layout::{Beside, Layout, Preset};
use crate::declared::RawUnit;

/// A file of Sensor Logger: all have the same header, so the name shows the sensor.
const fn sensor_logger(file: &'static str, columns: &'static str) -> Layout {
    Layout {
        file: Some(file),
        scales: &["t_s=1e-9"],
        ..Layout::of(columns)
    }
}

const LOGGED_GYRO: &str = "t_s=time,gyro_x=x,gyro_y=y,gyro_z=z";
const LOGGED_ACCEL: &str = "t_s=time,accel_x=x,accel_y=y,accel_z=z";
/// In µT on both systems.
const LOGGED_MAG: &str = "t_s=time,mag_x=x,mag_y=y,mag_z=z";
const MAG_FILES: [&str; 2] = ["MagnetometerUncalibrated.csv", "Magnetometer.csv"];

/// A file of Sensor Logger with an acceleration that is not a reading of a sensor.
const fn without_gravity(file: &'static str) -> Layout {
    Layout {
        refusal: Some([
            "it contains the acceleration without gravity, or gravity alone: estimates of the phone, not readings of a sensor",
            "record AccelerometerUncalibrated.csv or TotalAcceleration.csv, and import that file",
        ]),
        ..sensor_logger(file, LOGGED_ACCEL)
    }
}

/// The switch "Standardise Units & Frames" makes an iPhone write as Android does; without it signs and units are Apple's.
const AS_ANDROID: [(&str, &str); 2] = [("platform", "android"), ("standardisation", "true")];

const LOGGED_FOLDER: [&[&str]; 6] = [
    &["GyroscopeUncalibrated.csv", "AccelerometerUncalibrated.csv"],
    &["GyroscopeUncalibrated.csv", "TotalAcceleration.csv"],
    &["Gyroscope.csv", "AccelerometerUncalibrated.csv"],
    &["Gyroscope.csv", "TotalAcceleration.csv"],
    &["AccelerometerUncalibrated.csv"],
    &["TotalAcceleration.csv"],
];

/// Calibrated readings of the packets, and temperature and magnetometer (in a unit of its own) if they were exported.
const XSENS: Layout = Layout {
    optional: &["temp_c=Temperature", "mag_x=Mag_X,mag_y=Mag_Y,mag_z=Mag_Z"],
    rate_after: Some("Update Rate:"),
    ..Layout::of("")
};

/// All of them.
pub(super) const PRESETS: [Preset; 5] = [
    // The header of every imu0/data.csv of the EuRoC sequences and of those laid out like them (TUM VI, MRPT, OpenVINS); Burri et al., The EuRoC
    // micro aerial vehicle datasets, IJRR 2016. Stamps count from 1970; sensor.yaml beside the file gives no units.
    Preset {
        name: "euroc",
        title: "EuRoC/ASL: imu0/data.csv",
        raw_unit: Some(RawUnit::Si),
        layouts: &[Layout {
            scales: &["t_s=1e-9"],
            ..Layout::of(
                "t_s=timestamp [ns],gyro_x=w_RS_S_x [rad s^-1],gyro_y=w_RS_S_y [rad s^-1],gyro_z=w_RS_S_z [rad s^-1],\
                 accel_x=a_RS_S_x [m s^-2],accel_y=a_RS_S_y [m s^-2],accel_z=a_RS_S_z [m s^-2]",
            )
        }],
        in_folder: &[&["data.csv"], &["imu0/data.csv"], &["mav0/imu0/data.csv"]],
        mag_in_folder: &[],
        beside: None,
    },
    // github.com/tszheichoi/awesome-sensor-logger at b10f5c5: README.md (Metadata.csv), UNITS.md, COORDINATES.md, CROSSPLATFORM.md. The columns are
    // in the order z, y, x and are read by name. Uncalibrated files are preferred, because Android subtracts its own estimate of the gyro's bias from
    // the others.
    Preset {
        name: "sensor-logger",
        title: "Sensor Logger on Android, or on iOS with standardised units and frames",
        raw_unit: Some(RawUnit::Si),
        layouts: &[
            sensor_logger("GyroscopeUncalibrated.csv", LOGGED_GYRO),
            sensor_logger("Gyroscope.csv", LOGGED_GYRO),
            sensor_logger("AccelerometerUncalibrated.csv", LOGGED_ACCEL),
            sensor_logger("TotalAcceleration.csv", LOGGED_ACCEL),
            without_gravity("Accelerometer.csv"),
            without_gravity("Gravity.csv"),
            sensor_logger(MAG_FILES[0], LOGGED_MAG),
            sensor_logger(MAG_FILES[1], LOGGED_MAG),
        ],
        in_folder: &LOGGED_FOLDER,
        mag_in_folder: &MAG_FILES,
        beside: Some(Beside {
            file: "Metadata.csv",
            values: &AS_ANDROID,
            belongs_if_present: true,
        }),
    },
    // The same sources. On iOS, uncalibrated acceleration is in g (of 9.80665 m/s²) with the opposite sign on all three axes: a phone on its back
    // reads -1 on z, where its specific force is +g. Rates have the same sign on both systems.
    Preset {
        name: "sensor-logger-ios",
        title: "Sensor Logger on iOS, without standardised units and frames",
        raw_unit: Some(RawUnit::Si),
        layouts: &[
            sensor_logger("GyroscopeUncalibrated.csv", LOGGED_GYRO),
            sensor_logger("Gyroscope.csv", LOGGED_GYRO),
            Layout {
                scales: &["t_s=1e-9", "accel=-9.80665"],
                ..sensor_logger("AccelerometerUncalibrated.csv", LOGGED_ACCEL)
            },
            without_gravity("Accelerometer.csv"),
            without_gravity("Gravity.csv"),
            sensor_logger(MAG_FILES[0], LOGGED_MAG),
            sensor_logger(MAG_FILES[1], LOGGED_MAG),
        ],
        in_folder: &LOGGED_FOLDER,
        mag_in_folder: &MAG_FILES,
        beside: Some(Beside {
            file: "Metadata.csv",
            values: &AS_ANDROID,
            belongs_if_present: false,
        }),
    },
    // github.com/phyphox/phyphox-experiments at 972923d: <export> of accelerometer, gyroscope and linear_accelerometer; files and separators by
    // DataExport.java of phyphox-android. On both systems the signs are those of specific force and rate.
    Preset {
        name: "phyphox",
        title: "phyphox: \"Acceleration (with g)\" and \"Gyroscope\", any separator",
        raw_unit: Some(RawUnit::Si),
        layouts: &[
            Layout::of(
                "t_s=Time (s),gyro_x=Gyroscope x (rad/s),gyro_y=Gyroscope y (rad/s),gyro_z=Gyroscope z (rad/s),\
                 accel_x=Acceleration x (m/s^2),accel_y=Acceleration y (m/s^2),accel_z=Acceleration z (m/s^2)",
            ),
            Layout::of(
                "t_s=Time (s),accel_x=Acceleration x (m/s^2),accel_y=Acceleration y (m/s^2),accel_z=Acceleration z (m/s^2)",
            ),
            // Some experiments write the square as a sign.
            Layout::of(
                "t_s=Time (s),accel_x=Acceleration x (m/s²),accel_y=Acceleration y (m/s²),accel_z=Acceleration z (m/s²)",
            ),
            Layout::of(
                "t_s=Time (s),gyro_x=Gyroscope x (rad/s),gyro_y=Gyroscope y (rad/s),gyro_z=Gyroscope z (rad/s)",
            ),
            Layout::of(
                "t_s=Time (s),mag_x=Magnetic field x (µT),mag_y=Magnetic field y (µT),mag_z=Magnetic field z (µT)",
            ),
            Layout {
                refusal: Some([
                    "it contains the acceleration without gravity, which is not a reading of a sensor",
                    "record the experiment \"Acceleration (with g)\"",
                ]),
                ..Layout::of(
                    "t_s=Time (s),accel_x=Linear Acceleration x (m/s^2),accel_y=Linear Acceleration y (m/s^2),accel_z=Linear Acceleration z (m/s^2)",
                )
            },
        ],
        in_folder: &[
            &["Gyroscope.csv", "Accelerometer.csv"],
            &["Raw Data.csv"],
            &["Accelerometer.csv"],
        ],
        mag_in_folder: &["Magnetometer.csv"],
        beside: None,
    },
    // Text exports of MT Manager: lines with // above the names, one of which has the rate. Units by the MTw user manual (table of exported data):
    // m/s², rad/s, °C, a counter that wraps at 65535. SampleTimeFine counts at 10 kHz (MTi Family Reference Manual, XDI_SampleTimeFine); a wireless
    // unit leaves it empty. Xsens DOT has the same names in other units, and no such lines.
    Preset {
        name: "xsens",
        title: "Xsens MT Manager, export as text",
        raw_unit: Some(RawUnit::Si),
        layouts: &[
            Layout {
                columns: "t_s=SampleTimeFine,accel_x=Acc_X,accel_y=Acc_Y,accel_z=Acc_Z,gyro_x=Gyr_X,gyro_y=Gyr_Y,gyro_z=Gyr_Z",
                scales: &["t_s=1e-4"],
                ..XSENS
            },
            Layout {
                columns: "sample=PacketCounter,accel_x=Acc_X,accel_y=Acc_Y,accel_z=Acc_Z,gyro_x=Gyr_X,gyro_y=Gyr_Y,gyro_z=Gyr_Z",
                ..XSENS
            },
        ],
        in_folder: &[],
        mag_in_folder: &[],
        beside: None,
    },
];
