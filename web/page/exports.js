// The formats that can be exported, with the arguments of `mimu export`.

/** `of`: what the format requires. */
export const FORMATS = [
  { name: "C header", file: "mimu.h", args: ["c"], of: "calibration" },
  { name: "Rust with mimu-core", file: "calibration.rs", args: ["rust"], of: "calibration" },
  { name: "JSON", file: "calibration.json", args: ["json"], of: "calibration" },
  { name: "bytes for mimu-core", file: "calibration.bin", args: ["core"], of: "calibration" },
  { name: "PX4, for QGroundControl", file: "px4.params", args: ["px4", "--qgc"], of: "calibration" },
  { name: "ArduPilot", file: "ardupilot.parm", args: ["ardupilot"], of: "calibration" },
  { name: "ROS imu_calib", file: "imu_calib.yaml", args: ["imu-calib"], of: "calibration" },
  { name: "IMU-TK, accelerometer", file: "acc.calib", args: ["imu-tk", "--sensor", "accel"], of: "calibration" },
  { name: "IMU-TK, gyro", file: "gyro.calib", args: ["imu-tk", "--sensor", "gyro"], of: "calibration" },
  { name: "Fusion (x-io)", file: "fusion.h", args: ["fusion"], of: "calibration" },
  { name: "RealSense, EEPROM", file: "realsense.bin", args: ["realsense"], of: "calibration" },
  { name: "RealSense, calibration.json", file: "realsense.json", args: ["realsense", "--layout", "json"], of: "calibration" },
  { name: "Kalibr", file: "imu.yaml", args: ["kalibr"], of: "noise" },
  { name: "OpenVINS", file: "kalibr_imu_chain.yaml", args: ["openvins"], of: "noise" },
  { name: "VINS-Fusion", file: "vins.yaml", args: ["vins"], of: "noise" },
  { name: "ORB-SLAM3", file: "orbslam3.yaml", args: ["orbslam3"], of: "noise" },
  { name: "LIO-SAM", file: "liosam.yaml", args: ["liosam"], of: "noise" },
  { name: "FAST-LIO", file: "fastlio.yaml", args: ["fastlio"], of: "noise" },
];
