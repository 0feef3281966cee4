// The program in its worker, as promises.

/** A refusal of the program, with its one line. */
export class Refused extends Error {}

/** The person has cancelled. */
export class Cancelled extends Error {}

/** The line of a refusal. */
const lineOf = ({ stderr }) => stderr.trim().split("\n").at(-1).replace(/^mimu: /, "");

let compiled;

/** Compiles the program once; successive workers share it. */
export function load() {
  compiled ??= (async () => {
    const response = await fetch("mimu.wasm");
    if (!response.ok) throw new Refused(`mimu.wasm: the server answers ${response.status}; put all files of the page in one folder`);
    // Without the right content type, the file cannot be compiled while it streams.
    const streams = response.headers.get("content-type")?.startsWith("application/wasm");
    return streams ? WebAssembly.compileStreaming(response) : WebAssembly.compile(await response.arrayBuffer());
  })();
  compiled.catch(() => (compiled = undefined));
  return compiled;
}

/** One worker, with its own files. */
export class Program {
  constructor(onProgress = () => {}, onSaid = () => {}) {
    this.waiting = new Map();
    this.next = 0;
    this.worker = new Worker("worker.js", { type: "module" });
    this.worker.onmessage = ({ data }) => {
      if (data.progress) return onProgress(data.progress);
      if (data.said) return onSaid(data.said);
      const { resolve, reject } = this.waiting.get(data.id);
      this.waiting.delete(data.id);
      if (data.failed === undefined) resolve(data.answer);
      else reject(new Refused(data.failed));
    };
    this.worker.onerror = (event) => this.end(new Refused(`the worker does not start (${event.message ?? "no reason is given"}); load the page again`));
    this.ready = load().then((module) => this.ask("module", { module }));
    this.ready.catch(() => {});
  }

  ask(what, message, transfer = []) {
    return new Promise((resolve, reject) => {
      if (this.ended) return reject(this.ended);
      const id = this.next++;
      this.waiting.set(id, { resolve, reject });
      this.worker.postMessage({ id, do: what, ...message }, transfer);
    });
  }

  async files(files) {
    await this.ready;
    return this.ask("files", { files });
  }

  write(name, text) {
    return this.ask("write", { name, text });
  }

  read(name) {
    return this.ask("read", { name });
  }

  /** Runs `mimu` with these arguments. Returns its output, or throws `Refused` with its line. */
  async run(...args) {
    await this.ready;
    const done = await this.ask("run", { args });
    if (done.status !== 0) throw new Refused(lineOf(done));
    return done;
  }

  /** Begins a session with a board by these arguments of `mimu wizard`. Returns its warnings, or throws `Refused` with its line. */
  async begin(...args) {
    await this.ready;
    const begun = await this.ask("begin", { args });
    if (begun.status !== 0) throw new Refused(lineOf(begun));
    return begun.stderr.split("\n");
  }

  /** Sends these lines to the session. Returns whether it has ended. */
  hear(lines) {
    return this.ask("hear", { lines });
  }

  async text(name) {
    const bytes = await this.read(name);
    return bytes && new TextDecoder().decode(bytes);
  }

  async json(name) {
    return JSON.parse(await this.text(name));
  }

  /** Ends the worker, whatever it is doing. */
  end(why = new Cancelled("cancelled")) {
    this.ended = why;
    this.worker.terminate();
    for (const { reject } of this.waiting.values()) reject(why);
    this.waiting.clear();
  }
}
