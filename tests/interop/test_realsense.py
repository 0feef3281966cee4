"""The EEPROM of a RealSense camera by the structs of librealsense's ds-private.h, and its correct_motion_helper."""
import json
import struct
import zlib

import numpy
import pytest
from conftest import triad
from test_kalibr import driver

HEADER = struct.Struct("<2sHIII")


def header(data):
    """table_header: a big-endian version, type, size of what follows, a parameter, CRC of what follows."""
    version, kind, size, _, crc = HEADER.unpack_from(data)
    return struct.unpack(">H", version)[0], kind, size, crc


def read_eeprom(data):
    """dm_v2_eeprom, dm_v2_calib_info, dm_v2_calibration_table; check_calib for the first, and checks of the other two."""
    assert len(data) == 520
    content, found = data, []
    for _ in range(3):
        version, kind, size, crc = header(content)
        found.append((version, kind))
        content = content[16:]
        assert size <= len(content)
        content = content[:size]
        assert zlib.crc32(content) == crc
    # The first two bytes, read as a little-endian number, select the parser: dm_v2_eeprom_id.
    assert struct.unpack_from("<H", data)[0] == 0x0101
    assert found == [(0x0101, 0x09), (0x0200, 0x20), (0x0201, 0x20)]
    extrinsic_valid, intrinsic_valid = content[0], content[1]
    assert (extrinsic_valid, intrinsic_valid) == (0, 1) and len(content) == 244
    triads = {}
    for sensor, at in [("accel", 4 + 48), ("gyro", 4 + 48 + 48)]:
        values = numpy.frombuffer(content, "<f4", 12, at).astype(float)
        # float3x3 is column-major.
        triads[sensor] = values[:9].reshape(3, 3).T, values[9:]
    # get_intrinsic: the gyro's bias is in deg/s.
    triads["gyro"] = triads["gyro"][0], numpy.radians(triads["gyro"][1])
    return triads


def read_json(data):
    """calibration.json of rs-imu-calibration.py: X.flatten(), with X the transpose of the sensitivity."""
    imu = json.loads(data)["imus"][0]
    names = {"accel": "accelerometer", "gyro": "gyroscope"}
    return {s: (numpy.array(imu[n]["scale_and_alignment"]).reshape(3, 3).T, numpy.array(imu[n]["bias"])) for s, n in names.items()}


@pytest.mark.parametrize("layout, read, relative", [("eeprom", read_eeprom, 4e-7), ("json", read_json, 1e-9)])
@pytest.mark.parametrize("zero", [0.0, 100.0])
def test_corrected_motion_is_what_apply_gives(layout, read, relative, zero, unit):
    arguments = ["--layout", layout, "--gyro-zero", zero, "--accel-zero", zero]
    path, _ = unit.export("realsense", *arguments, name=f"realsense.{layout}")
    triads = read(path.read_bytes())
    for sensor in ["gyro", "accel"]:
        sensitivity, bias = triads[sensor]
        readings, _ = driver(unit, sensor, zero=zero)
        applied = triad(unit.applied, sensor)
        error = numpy.abs(readings @ sensitivity.T - bias - applied).max()
        assert error < 1e-6 + relative * (numpy.abs(readings).max() + numpy.abs(bias).max())


def test_a_flipped_bit_is_found(unit):
    path, _ = unit.export("realsense", name="realsense.bin")
    data = bytearray(path.read_bytes())
    data[150] ^= 1
    with pytest.raises(AssertionError):
        read_eeprom(bytes(data))
