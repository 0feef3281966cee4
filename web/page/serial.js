// A serial port of the browser: what it receives, with the times of arrival, and its errors with remedies.

import { Refused } from "./program.js";

export const NO_SERIAL =
  "this browser has no serial ports (Web Serial): open this page in Chrome, Edge or Opera on a computer, over https or from localhost; or run mimu wizard --text; or save the lines of the board to a file and drop it here";

/** Seconds on the clock that stamps all arrivals. */
export const now = () => performance.now() / 1000;

/** Names of passing errors: a byte was lost, and the stream must be opened again. */
const PASSING = ["BreakError", "BufferOverrunError", "FramingError", "ParityError"];

export class Port {
  /** `heard(at, bytes)` and `lost(at, why)` are called with what comes. */
  constructor(heard, lost) {
    Object.assign(this, { heard, lost, port: null, reading: null });
  }

  static get exists() {
    return "serial" in navigator;
  }

  /** Lets the person choose a port. */
  async choose() {
    try {
      this.port = await navigator.serial.requestPort();
    } catch (error) {
      if (error.name === "NotFoundError")
        throw new Refused("no port was chosen: plug the board in and connect again; a board that is not in the list needs its driver, or a cable that carries data");
      throw new Refused(`the browser does not list its ports (${error.message}); allow serial ports for this page in the settings of the browser, and connect again`);
    }
  }

  get isOpen() {
    return this.reading !== null;
  }

  /** Opens the port that was chosen, and listens to it until it is closed or lost. */
  async open(baudRate) {
    try {
      await this.port.open({ baudRate, bufferSize: 65536 });
    } catch (error) {
      if (error.name === "TypeError") throw new Refused(`the port does not open at ${baudRate} bits a second (${error.message}); give the number that the board's program sets`);
      throw new Refused("the port does not open: another tab or program, such as a serial monitor, holds it, or the board was unplugged; close the other one, check the cable, and connect again");
    }
    this.reading = this.listen();
  }

  async listen() {
    const { port } = this;
    for (let goesOn = true; goesOn && port.readable && !this.closing; ) {
      this.reader = port.readable.getReader();
      goesOn = await this.read().catch((error) => PASSING.includes(error.name));
      this.reader.releaseLock();
    }
    await port.close().catch(() => {});
    this.reading = this.reader = null;
    if (!this.closing) this.lost(now(), "the port has vanished");
  }

  /** Passes on what comes until the stream ends; throws its errors. */
  async read() {
    for (;;) {
      const { value, done } = await this.reader.read();
      if (done) return false;
      this.heard(now(), value);
    }
  }

  async close() {
    if (!this.reading) return;
    this.closing = true;
    await this.reader?.cancel().catch(() => {});
    await this.reading;
    this.closing = false;
  }
}
