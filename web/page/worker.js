// Runs the program on the person's files, away from the page, so that the page answers while it computes.

import { DroppedFile, Folder, MemoryFile, run } from "./wasi.js";

// Of what is told while a file is read, ms.
const EVERY = 100;

const root = new Folder();
let module;

const tell = (() => {
  let last = 0;
  return (file, share) => {
    const now = performance.now();
    if (share < 1 && now - last < EVERY) return;
    last = now;
    postMessage({ progress: { file, share } });
  };
})();

/** What a trap says in the place of an error: the program has no way back from it. */
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
  /** Puts dropped files in the folder, in the place of what was there. */
  files({ files }) {
    root.entries.clear();
    for (const { name, file } of files) root.entries.set(name, new DroppedFile(file, (share) => tell(name, share)));
  },
  write({ name, text }) {
    root.entries.set(name, new MemoryFile(new TextEncoder().encode(text)));
  },
  run({ args }) {
    const begun = performance.now();
    try {
      return { ...run(module, root, ["mimu", ...args]), ms: performance.now() - begun };
    } catch (trap) {
      return { status: 1, stdout: "", stderr: `mimu: ${broken(trap)}`, ms: performance.now() - begun };
    }
  },
  /** The content of a file that the program wrote; of a folder, all of its files. */
  read({ name }) {
    const found = root.find(name);
    if (found instanceof MemoryFile) return found.content().slice();
    if (found instanceof Folder) return new Map([...found.entries].map(([entry, file]) => [entry, file.content().slice()]));
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
