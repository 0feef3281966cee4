"""A board that writes lines of text, for the page and for the command: an MPU-6050 in a hand on the virtual bench, which shares no code with
what calibrates it.

The same unit as in the tests of the wizard (host/cli/tests/all/wizard/text.rs), at the port that the page sees and at a socket.
"""
import csv
import json
import os
import pathlib
import socket
import subprocess
import threading
import time

import numpy

GYRO = numpy.array([[3790.0, 31.0, -22.0], [-45.0, 3715.0, 18.0], [27.0, -39.0, 3801.0]]), numpy.array([120.0, -210.0, 64.0])
ACCEL = numpy.array([[1689.0, 0.0, 0.0], [14.0, 1655.0, 0.0], [-21.0, 9.0, 1702.0]]), numpy.array([410.0, -385.0, 702.0])
COLUMNS = "t_us,ax,ay,az,gx,gy,gz"
DWELL_S = 1.2
# Options of `mimu wizard`, used on both sides.
SESSION = ["--gravity", "9.80665", "--text", COLUMNS, "--device", "plane-7", "--dwell", str(DWELL_S), "--warm-up", "0", "--as-planned", "--trust-clock"]


class Socket:
    """The board at `tcp://...`, which writes its lines from the beginning to every client."""

    def __init__(self, lines, per_second=4000.0):
        self.lines, self.per_second = lines, per_second
        self.listener = socket.create_server(("127.0.0.1", 0))
        self.port = f"tcp://127.0.0.1:{self.listener.getsockname()[1]}"
        threading.Thread(target=self.serve, daemon=True).start()

    def serve(self):
        while True:
            try:
                line = self.listener.accept()[0]
                begun, at = time.monotonic(), 0
                while at < len(self.lines):
                    due = min(int((time.monotonic() - begun) * self.per_second), len(self.lines))
                    line.sendall("".join(self.lines[at:due]).encode())
                    at = due
                    time.sleep(0.005)
                time.sleep(60)
            except OSError:
                if self.listener.fileno() < 0:
                    return

    def close(self):
        self.listener.close()


def wizard(port, folder, until=None):
    """Runs `mimu wizard` at `port`, to its end or until `until(events)`; returns its output."""
    events = folder.parent / "events.jsonl"
    command = [os.environ["MIMU"], "wizard", "-o", str(folder), "--port", port, *SESSION, "--events", str(events)]
    running = subprocess.Popen(command, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
    if until is not None:
        while running.poll() is None:
            time.sleep(0.05)
            lines = events.read_text().splitlines() if events.exists() else []
            if until([json.loads(line) for line in lines if line.endswith("}")]):
                running.terminate()
                break
    return running.communicate(timeout=120)[0]


def spins(axes, turns=10):
    """Steps of a plan: each axis up against an edge, and turned both ways."""
    steps = ""
    for axis in axes:
        up = [float(k == "xyz".index(axis)) for k in range(3)]
        steps += f"[[step]]\nup = {up}\ndwell_s = 3.0\n"
        steps += "".join(f"[[step]]\nwhole_turns = {n}\nabout = {up}\ndwell_s = 3.0\n" for n in [turns, -turns])
    return steps


def lines(folder, whole_turns=False, field=None):
    """The lines of the board, some lost and some truncated. Its poses are those that a session asks for, repeated; with `whole_turns` they are
    followed by ten turns each way about each axis, and those of the verification by turns about z. With a `field`, in the words of the rig, the board
    has a magnetometer."""
    rest = [f"{10_000 * k},700,-400,17400,120,-210,{64 + k % 3}\r\n" for k in range(3000)]
    board = Socket(rest)
    wizard(board.port, folder / "plan", until=lambda _: (folder / "plan" / "session.json").exists())
    board.close()
    asked = json.loads((folder / "plan" / "session.json").read_text())["asked"]
    first, then = asked["steps"], asked["verification"]
    plan = 'format = "mimu-plan/1"\nsample_rate_hz = 100.0\ncarrier = "hands"\nlead_in_s = 30.0\n'
    poses = lambda steps: "".join(f"[[step]]\nup = {step['up']}\ndwell_s = 3.0\n" for step in steps)
    plan += poses([*first, *first]) + spins("zxy") + 2 * (poses(then) + spins("z")) if whole_turns else poses([*first, *then, *first, *then, *then])
    (folder / "plan.toml").write_text(plan)
    # White noise, so that a diagnosis finds nothing else.
    still = "instability_si = [0.0, 0.0, 0.0]\nwalk_si = [0.0, 0.0, 0.0]\n"
    rig = 'format = "mimu-rig/1"\nearth_rate = false\n[unit]\ngyro = "MPU6050-gyro"\naccel = "MPU6050-accel"\n'
    rig += f"[unit.gyro_axes]\n{still}[unit.accel_axes]\n{still}"
    for sensor, (matrix, bias) in {"gyro": GYRO, "accel": ACCEL}.items():
        rig += f"[unit.{sensor}_affine]\nmatrix = {matrix.tolist()}\nbias = {bias.tolist()}\n"
    mag = f'[[triad]]\nname = "mag"\nrotation_deg = [1.0, -2.0, 90.0]\n{field}' if field else ""
    (folder / "rig.toml").write_text(rig + "[thermal]\non_before_s = inf\n" + mag)
    bench = pathlib.Path(os.environ["MIMU"]).parent / "mimu-rig"
    command = [bench, "record", "plan.toml", "--rig", "rig.toml", "--seed", "3", "-o", "truth", "--format", "csv"]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    written = ["MPU6050 OK\r\n", "t,ax,ay,az,gx,gy,gz" + (",mx,my,mz" if field else "") + "\r\n"]
    sensors = ["accel", "gyro", "mag"][: 3 if field else 2]
    with open(folder / "truth" / "samples.csv", newline="") as file:
        for k, row in enumerate(csv.DictReader(file)):
            codes = [round(float(row[f"{sensor}_{axis}"])) for sensor in sensors for axis in "xyz"]
            line = ",".join(map(str, [700_000 + 10_000 * k, *codes])) + "\r\n"
            # Only a few: a turn with a missing sample cannot be integrated.
            if k % 7001 == 500:
                continue
            written.append(line[20:] if k % 9001 == 700 else line)
    return written


def assert_true(calibration):
    """Asserts that a calibration's intervals contain the truth, as required of the command's session too."""
    inside = every = 0
    for sensor, (matrix, bias) in {"gyro": GYRO, "accel": ACCEL}.items():
        table = calibration[sensor]
        inverse = numpy.linalg.inv(matrix)
        offset = -inverse @ bias
        for i in range(3):
            pairs = [(table["C"][i][j], table["interval_C"][i][j], inverse[i][j]) for j in range(3) if sensor == "gyro" or j <= i]
            for value, interval, truth in [*pairs, (table["o"][i], table["interval_o"][i], offset[i])]:
                off = abs(value - truth) / interval
                assert off < 2, (sensor, i, value, interval, truth)
                every += 1
                inside += off <= 1
    # Of 21 intervals at 95 %, five or more miss with a probability of 0.3 %.
    assert inside + 4 >= every, (inside, every)


# The page's serial port: replaces `navigator.serial`, with a board that can be unplugged. `board` is for the tests.
MOCK = """(() => {
  const board = (window.board = { lines: [], at: 0, perSecond: 100, held: false, refused: false, opened: [], garbage: null });
  const ports = new EventTarget();
  class Port extends EventTarget {
    readable = null;
    async open({ baudRate }) {
      if (this.readable) throw new DOMException("The port is already open.", "InvalidStateError");
      if (board.held || board.away) throw new DOMException("Failed to open serial port.", "NetworkError");
      board.opened.push(baudRate);
      this.readable = new ReadableStream({ start: (to) => (this.to = to), cancel: () => (this.to = null) });
      let begun = performance.now(), done = 0;
      const speak = () => {
        if (!this.to) return;
        const now = performance.now();
        // What is due since the last time; the pace may have changed in between.
        done += ((now - begun) / 1000) * board.perSecond;
        begun = now;
        const count = Math.floor(done);
        done -= count;
        const text = board.garbage ?? board.lines.slice(board.at, board.at + count).join("");
        if (board.garbage === null) board.at += count;
        if (count > 0 && text) this.to.enqueue(Uint8Array.from(text, (c) => c.charCodeAt(0)));
        setTimeout(speak, 5);
      };
      speak();
    }
    async close() {
      this.readable = this.to = null;
    }
  }
  const port = new Port();
  board.unplug = () => {
    board.away = true;
    const to = port.to;
    port.readable = port.to = null;
    to.error(new DOMException("The device has been lost.", "NetworkError"));
  };
  board.plug = (tells) => {
    board.away = false;
    if (tells) ports.dispatchEvent(new Event("connect"));
  };
  ports.requestPort = async () => {
    if (board.refused) throw new DOMException("No port selected by the user.", "NotFoundError");
    return port;
  };
  Object.defineProperty(navigator, "serial", { value: ports, configurable: true });
})();"""
