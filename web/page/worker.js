// Runs the program on the person's files, away from the page, so that the page answers while it computes.

import { DroppedFile, Folder, Input, MemoryFile } from "./files.js";
import { run, start } from "./wasi.js";

// Least time between two reports of progress, ms.
const EVERY = 100;

const root = new Folder();
let module;
/** The open session with a board: the program that conducts it, and its input. */
let session = null;

const tell = (() => {
  let last = 0;
  return (what, share) => {
    const now = performance.now();
    if (share < 1 && now - last < EVERY) return;
    last = now;
    postMessage({ progress: { what, share } });
  };
})();

/** The message of a trap, from which the program cannot recover. */
function broken(trap) {
  const panic = /panicked at [^\n]*\n([^\n]*)/.exec(trap.stderr ?? "");
  const memory = /memory allocation of (\d+) bytes failed/.exec(trap.stderr ?? "");
  if (memory) return `the page has no memory left (${memory[1]} bytes wanted); use the command mimu, or give a part of the recording`;
  const why = panic ? panic[1] : trap.message;
  return `the program broke down (${why}); make the file again from its source, and if that helps nothing, report this`;
}

const answers = {
  module(message) {
    module = message.module;
  },
  /** Puts dropped files in the folder, which is emptied first. */
  files({ files }) {
    root.entries.clear();
    for (const { name, file } of files) root.entries.set(name, new DroppedFile(file, (share) => tell(`reading ${name}`, share)));
  },
  write({ name, text }) {
    root.entries.set(name, new MemoryFile(new TextEncoder().encode(text)));
  },
  run({ args }) {
    try {
      return run(module, root, ["mimu", ...args], tell);
    } catch (trap) {
      return { status: 1, stdout: "", stderr: `mimu: ${broken(trap)}` };
    }
  },
  /** Begins a session with a board by the arguments of `mimu wizard`, or resumes the one in the folder. */
  begin({ args }) {
    const input = new Input();
    const said = (line) => postMessage({ said: JSON.parse(line) });
    const call = start(module, root, ["mimu", "session", ...args], input, said);
    const begun = call("_start");
    session = begun.status === 0 ? { call, input } : null;
    return begun;
  },
  /** Sends these lines to the session. Returns whether it has ended. */
  hear({ lines }) {
    if (!session) return true;
    session.input.push(lines.map((line) => JSON.stringify(line) + "\n").join(""));
    try {
      if (session.call("mimu_go_on").status === 0) return false;
    } catch (trap) {
      postMessage({ said: { ended: { refused: `${broken(trap)}; the journal is whole up to the last dwell` } } });
    }
    session = null;
    return true;
  },
  /** Puts files into the folder `name`, which is replaced. */
  unpack({ name, files }) {
    root.entries.delete(name);
    for (const [path, bytes] of files) {
      let folder = root;
      const names = [name, ...path.split("/")];
      for (const part of names.slice(0, -1)) {
        if (!folder.entries.has(part)) folder.entries.set(part, new Folder());
        folder = folder.entries.get(part);
      }
      folder.entries.set(names.at(-1), new MemoryFile(bytes));
    }
  },
  /** The content of a file that the program wrote; for a folder, all of its files by their paths. */
  read({ name }) {
    const found = root.find(name);
    if (found instanceof MemoryFile) return found.content().slice();
    if (found instanceof Folder) return new Map(found.files());
    return null;
  },
};

onmessage = ({ data }) => {
  try {
    postMessage({ id: data.id, answer: answers[data.do](data) });
  } catch (error) {
    postMessage({ id: data.id, failed: String(error?.message ?? error) });
  }
};
