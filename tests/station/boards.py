"""Boards that write lines: replays recordings over TCP in real time, from their beginning for each connection.

    python boards.py 7001=unit-1 7002=unit-2
"""

from __future__ import annotations

import csv
import socketserver
import sys
import threading
import time
from pathlib import Path

COLUMNS = ["accel_x", "accel_y", "accel_z", "gyro_x", "gyro_y", "gyro_z", "temp_c"]


def board(recording: Path) -> type[socketserver.BaseRequestHandler]:
    """The handler that replays a recording in CSV."""
    with (recording / "samples.csv").open(newline="") as file:
        rows = [(float(row["t_s"]), ",".join(row[c] for c in COLUMNS)) for row in csv.DictReader(file)]

    class Board(socketserver.BaseRequestHandler):
        def handle(self) -> None:
            begun = time.monotonic()
            for t_s, numbers in rows:
                time.sleep(max(0.0, t_s - (time.monotonic() - begun)))
                try:
                    self.request.sendall(f"{1e6 * t_s:.0f},{numbers}\r\n".encode())
                except OSError:
                    return

    return Board


for argument in sys.argv[1:]:
    port, recording = argument.split("=", 1)
    server = socketserver.ThreadingTCPServer(("127.0.0.1", int(port)), board(Path(recording)))
    threading.Thread(target=server.serve_forever).start()
print("ready", flush=True)
