// What can be taken away, and how `mimu export` is asked for it.

/** `needs`: what the format is made from beside a calibration, or in its place. */
export const FORMATS = [
  { name: "C header", file: "mimu.h", args: ["c"] },
  { name: "Rust with mimu-core", file: "calibration.rs", args: ["rust"] },
  { name: "JSON", file: "calibration.json", args: ["json"] },
  { name: "bytes for mimu-core", file: "calibration.bin", args: ["core"] },
  { name: "PX4, for QGroundControl", file: "px4.params", args: ["px4", "--qgc"] },
  { name: "ArduPilot", file: "ardupilot.parm", args: ["ardupilot"] },
  { name: "ROS imu_calib", file: "imu_calib.yaml", args: ["imu-calib"] },
  { name: "IMU-TK, accelerometer", file: "acc.calib", args: ["imu-tk", "--sensor", "accel"] },
  { name: "IMU-TK, gyro", file: "gyro.calib", args: ["imu-tk", "--sensor", "gyro"] },
  { name: "Fusion (x-io)", file: "fusion.h", args: ["fusion"] },
  { name: "RealSense, EEPROM", file: "realsense.bin", args: ["realsense"] },
  { name: "RealSense, calibration.json", file: "realsense.json", args: ["realsense", "--layout", "json"] },
  { name: "MCAP for Foxglove", file: "unit.mcap", args: ["mcap", "--recording", "rec"] },
];
